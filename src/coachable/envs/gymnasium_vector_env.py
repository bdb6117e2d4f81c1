"""Many walking tasks as one Gymnasium vector environment, which `gymnasium.make_vec` makes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool

from coachable.envs.compiled_walk import (
    Facts,
    begin_run,
    begin_some,
    facts_of_start,
    facts_of_step,
    info_of,
    start_observation,
    step_all,
)
from coachable.envs.gymnasium_env import PlantEnv, picture
from coachable.envs.vector_infos import masked, only
from coachable.foundation.errors import ParameterError

Walkers = Bool[np.ndarray, " walkers"]
"""Which of them."""


class PlantVectorEnv(gymnasium.vector.VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many of `PlantEnv`, stepped together by one compiled program.

    It gives what Gymnasium's `SyncVectorEnv` of as many single environments gives, number by number, seeds,
    infos and final observations included, in each of the autoreset modes:

    - `NEXT_STEP`: an episode that has ended begins anew in the next step, whose action is ignored;
    - `SAME_STEP`: it begins anew at once, and its end is in `final_obs` and `final_info` of the info;
    - `DISABLED`: it is for the caller to reset it, with `reset(options={"reset_mask": …})`.

    **Arguments:** `num_envs`; `autoreset_mode`, a mode or its value (`"NextStep"`, `"SameStep"`,
    `"Disabled"`); the rest as for one `PlantEnv`, but there is no render mode `"human"`.

    **Raises:** `ParameterError` for a number or a mode that cannot be, `ResetNeeded` in a step without a
    reset, and what `PlantEnv` raises.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Any,
    ):
        if num_envs < 1:
            raise ParameterError(f"num_envs is {num_envs}; at least one walker is needed")
        if render_mode not in (None, "rgb_array"):
            raise ParameterError(f"render_mode {render_mode!r} is not for many walkers; there is 'rgb_array'")
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            known = ", ".join(repr(mode.value) for mode in AutoresetMode)
            raise ParameterError(f"unknown autoreset_mode {autoreset_mode!r}; known: {known}") from None
        self._one = PlantEnv(**options, render_mode=render_mode)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": PlantEnv.metadata["render_fps"],
            "autoreset_mode": self.autoreset_mode,
        }
        self.single_observation_space = self._one.observation_space
        self.single_action_space = self._one.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._weights = np.array(self._one.task.weights)
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._seeds = [-1] * num_envs
        state, _ = begin_run(self._one.task, self._one.task.x0)
        self._states = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (num_envs, *leaf.shape)), state)
        self._x0 = np.zeros((num_envs, *self._one.task.x0.shape), np.float32)
        self._ended = np.zeros(num_envs, bool)
        self._began = np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode of every walker, or of those that `options["reset_mask"]` names.

        **Arguments:** `seed`, the first walker's, the next has the next; or one for each.
        """
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        seeds = [None] * self.num_envs if seeds is None else list(seeds)
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
        chosen = self._chosen(options)
        if not chosen.all() and not (self._began | chosen).all():
            raise ResetNeeded("some environments have never been reset; reset them all first")
        self._seed({int(walker): seeds[walker] for walker in np.flatnonzero(chosen)})
        anew = ~self._began | np.array([seed is not None for seed in seeds])
        begun = self._begin(chosen, anew)
        self._ended = self._ended & ~chosen
        if chosen.all():
            self._facts = begun
            self._observations = start_observation(self._one.task, self._states)
            self._touchdowns = np.zeros(self.num_envs, int)
        else:
            self._put(chosen, begun)
        info = masked(info_of(only(self._facts, chosen), self._weights), chosen)
        return self._observations.copy(), info

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Hold the clipped controls of every walker for one control step."""
        controls = np.asarray(actions, np.float32)
        if controls.shape != self.action_space.shape:
            raise InvalidAction(f"actions have shape {controls.shape}, not {self.action_space.shape}")
        if not self._began.all():
            raise ResetNeeded("no episode has begun; call reset()")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            over = ", ".join(map(str, np.flatnonzero(self._ended)))
            raise ResetNeeded(f"episodes {over} are over; reset them with options={{'reset_mask': …}}")
        waiting, begun = self._ended, None
        if waiting.any():
            begun = self._begin(waiting, np.zeros(self.num_envs, bool))
        self._states, timesteps = step_all(self._one.task, self._states, controls, waiting)
        timesteps = jax.device_get(timesteps)
        self._touchdowns += timesteps.foot_x != self._facts["foot_x"]
        self._observations, self._facts = np.array(timesteps.observation), facts_of_step(timesteps)
        rewards = timesteps.reward.astype(np.float64)
        terminated, truncated = np.array(timesteps.terminated), np.array(timesteps.truncated)
        if begun is not None:
            self._put(waiting, begun)
            rewards[waiting], terminated[waiting], truncated[waiting] = 0.0, False, False
        self._ended = terminated | truncated
        info: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._ended.any():
            info = self._last_words(self._ended)
            self._put(self._ended, self._begin(self._ended, np.zeros(self.num_envs, bool)))
            self._ended = np.zeros(self.num_envs, bool)
        info |= masked(info_of(self._facts, self._weights), np.ones(self.num_envs, bool))
        return self._observations.copy(), rewards, terminated, truncated, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of every walker, if the render mode is `rgb_array`."""
        if self.render_mode is None:
            return None
        if not self._began.all():
            raise ResetNeeded("there is nothing to see before reset()")
        return tuple(
            np.asarray(picture(self._one, x, self._facts_of(walker), int(self._touchdowns[walker])))
            for walker, x in enumerate(self._observations)
        )

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The walkers' random number generators."""
        return tuple(self._generator(walker) for walker in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Their seeds."""
        _ = self.np_random
        return tuple(self._seeds)

    def _chosen(self, options: dict[str, Any] | None) -> Walkers:
        """Who is reset: everyone, or those in the mask."""
        if options is None or "reset_mask" not in options:
            return np.ones(self.num_envs, bool)
        mask = options["reset_mask"]
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self.num_envs,)):
            raise TypeError(f"options['reset_mask'] must be an array of {self.num_envs} booleans")
        if not mask.any():
            raise ValueError("options['reset_mask'] names no environment")
        return mask.copy()

    def _seed(self, seeds: dict[int, int | None]) -> None:
        for walker, seed in seeds.items():
            if seed is not None:
                self._generators[walker], self._seeds[walker] = seeding.np_random(seed)

    def _generator(self, walker: int) -> np.random.Generator:
        generator = self._generators[walker]
        if generator is None:
            generator, self._seeds[walker] = seeding.np_random()
            self._generators[walker] = generator
        return generator

    def _begin(self, chosen: Walkers, anew: Walkers) -> Facts:
        """Set the chosen walkers to a start; returns the facts of a start, which are theirs alone."""
        for walker in np.flatnonzero(chosen):
            self._x0[walker] = self._one.start.draw(self._generator(int(walker)))
        self._states, phase = begin_some(self._one.task, self._x0, self._states, chosen, anew)
        self._began |= chosen
        return facts_of_start(self._states, phase)

    def _put(self, chosen: Walkers, begun: Facts) -> None:
        """The chosen walkers are seen at their start."""
        for name, values in begun.items():
            self._facts[name][chosen] = values[chosen]
        self._observations[chosen] = start_observation(self._one.task, self._states)[chosen]
        self._touchdowns[chosen] = 0

    def _facts_of(self, walker: int) -> Facts:
        return {name: np.asarray(values[walker]) for name, values in self._facts.items()}

    def _last_words(self, over: Walkers) -> dict[str, Any]:
        """The final observation and the final info of those whose episode is over."""
        infos: dict[str, Any] = {}
        for walker in map(int, np.flatnonzero(over)):
            info = info_of(self._facts_of(walker), self._weights)
            final = {"final_obs": self._observations[walker].copy(), "final_info": info}
            infos = self._add_info(infos, final, walker)
        return infos
