"""A described reward on a Gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array, iterate
from jaxtyping import Bool, Float

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.behaviour_reward import described_reward, require_known_on_nan, taken, untried_dt
from coachable.envs.observed_memory import MemoryObserver, Observe
from coachable.envs.signals.reading import OnNaN, Signals, after, reader_of_many, require_info, reward_numbers
from coachable.envs.signals.time_step import one_step_counted, require_single_steps
from coachable.envs.vector_infos import at_the_end, masked, only
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.rewards.described_reward import VERDICTS, RewardMemory, StepInfo
from coachable.rewards.forms import RewardForm

Envs = Bool[np.ndarray, " envs"]
"""Which of them."""


class VectorBehaviourReward(gymnasium.vector.VectorWrapper):
    """Pays for a described behaviour in every environment of a vector environment.

    It gives what a `BehaviourReward` around each of them gives, in all autoreset modes, infos with their
    masks included. The step that merely begins an episode, in the next-step mode, pays nothing.

    **Arguments:** as for `BehaviourReward`, but each signal is a function of (unwrapped vector environment,
    batched observations, infos) that gives a number for each environment. In the same-step mode it is also
    asked about the end of an episode, with the final observations and infos in their places; what it reads
    in the environment itself would by then be of the next episode. A pack looks into the environments one by
    one, so it needs them to be there (`SyncVectorEnv`) and another mode.

    **Raises:** as `BehaviourReward`, and `ParameterError` for an environment whose metadata have no
    autoreset mode, and a pack that cannot look.
    """

    def __init__(
        self,
        env: gymnasium.vector.VectorEnv,
        behaviour: Behaviour | str | Path,
        signals: Signals = None,
        weight: int | float = 1.0,
        replace: bool = False,
        *,
        form: RewardForm | str = "stay",
        cycle_bonus: int | float = 0.0,
        dt: int | float | None = None,
        on_nan: OnNaN = "raise",
        observe: Observe = "nothing",
        key: str = "behaviour",
    ):
        super().__init__(env)
        require_known_on_nan(on_nan)
        real_number(weight, "weight", ParameterError)
        try:
            self.autoreset_mode = AutoresetMode(env.metadata.get("autoreset_mode"))
        except ValueError:
            raise ParameterError(
                f"the metadata of {env} do not give its autoreset mode; set metadata['autoreset_mode'] to "
                "what it does, such as gymnasium.vector.AutoresetMode.NEXT_STEP"
            ) from None
        self.behaviour_reward = described_reward(env, behaviour, form, dt, cycle_bonus)
        self.on_nan: OnNaN = on_nan
        self.weight, self.replace, self.key = weight, replace, key
        reward = self.behaviour_reward
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        self._read = reader_of_many(env, reward.behaviour.signal_names, signals, on_nan, same_step)
        self._observer = MemoryObserver.of(
            observe, reward.observation_names, env.single_observation_space, key
        )
        if self._observer is not None:
            self.single_observation_space = self._observer.space
            self.observation_space = batch_space(self._observer.space, env.num_envs)
        self._names = np.array(self.behaviour_reward.phase_names, object)
        self._memory: RewardMemory | None = None
        self._ended = np.zeros(env.num_envs, bool)
        self._steps = 0
        self._untried_dt = untried_dt(reward, dt)
        require_single_steps(env, self._untried_dt)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every environment, or in those that `options["reset_mask"]` names."""
        chosen = np.ones(self.num_envs, bool)
        if options is not None and "reset_mask" in options:
            chosen = np.array(options["reset_mask"], bool)
            if self._memory is None and not chosen.all():
                raise ResetNeeded("some environments have never been reset; reset them all first")
        observations, infos = self.env.reset(seed=seed, options=options)  # pyright: ignore[reportArgumentType]
        require_info(infos, self.env, 0)
        self._steps = 0
        self._begin(chosen, self._signals(observations, infos, "after the reset", chosen))
        self._ended &= ~chosen
        info = only(self._info_at_the_start(), chosen)
        return self._observed(observations), self._with(infos, masked(info, chosen), chosen)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One step of every environment, paid for where it led."""
        if self._memory is None:
            raise ResetNeeded("no episode has begun; call reset()")
        if self._untried_dt is None:
            observations, base, terminated, truncated, infos = self.env.step(actions)
        else:
            with one_step_counted(self.env, self._untried_dt):
                observations, base, terminated, truncated, infos = self.env.step(actions)
            self._untried_dt = None
        self._steps += 1
        require_info(infos, self.env, self._steps)
        base = reward_numbers(base, self.env, self._steps)
        everyone, ended = np.ones(self.num_envs, bool), np.asarray(terminated | truncated)
        begun_in_the_step = ended & (self.autoreset_mode is AutoresetMode.SAME_STEP)
        last_observations, last_infos = observations, infos
        if begun_in_the_step.any():
            last_observations, last_infos = self._at_the_end(observations, infos, ended)
        signals = self._signals(last_observations, last_infos, after(self._steps), everyone)
        self._memory, paid, step = self.behaviour_reward.step(self._memory, signals, np.asarray(terminated))
        info, ours = self._info(step, base, paid)
        if self._ended.any():
            self._begin(self._ended, signals)
            info, ours = self._begun(info, self._ended), np.where(self._ended, 0.0, ours)
        if begun_in_the_step.any():
            infos = self._with_the_end(infos, info, ended)
            self._begin(
                ended, self._signals(observations, infos, f"after the reset in step {self._steps}", ended)
            )
            info = self._begun(info, ended)
        self._ended = ended & ~begun_in_the_step
        rewards = ours if self.replace else base + ours
        infos = self._with(infos, masked(info, everyone), everyone)
        return self._observed(observations), rewards, terminated, truncated, infos

    def _signals(
        self, observations: Any, infos: Mapping[str, Any], when: str, chosen: Envs
    ) -> Float[np.ndarray, "envs num_signals"]:
        return self._read(self.env, observations, infos, when, chosen)

    def _begin(self, chosen: Envs, signals: Float[np.ndarray, "envs num_signals"]) -> None:
        """The chosen ones remember nothing but where they are."""
        begun = self.behaviour_reward.init(signals)
        if self._memory is None:
            self._memory = begun
        else:
            self._memory = jax.tree.map(lambda one, other: np.where(chosen, one, other), begun, self._memory)

    def _at_the_end(
        self, observations: Any, infos: dict[str, Any], ended: Envs
    ) -> tuple[Any, dict[str, Any]]:
        """The observations and infos before those that have ended began anew."""
        one = self.env.single_observation_space
        last = list(iterate(self.env.observation_space, observations))
        for index in np.flatnonzero(ended):
            last[index] = infos["final_obs"][index]
        last = concatenate(one, last, create_empty_array(one, self.num_envs))
        return last, at_the_end(infos, ended)

    def _with_the_end(self, infos: dict[str, Any], info: dict[str, Any], ended: Envs) -> dict[str, Any]:
        """The final infos and observations with what the behaviour adds."""
        final_info = {**infos.get("final_info", {}), self.key: masked(only(info, ended), ended)}
        final_info[f"_{self.key}"] = ended.copy()
        infos = {**infos, "final_info": final_info, "_final_info": ended.copy()}
        if self._observer is not None:
            final_obs, numbers = np.full(self.num_envs, None, object), self._numbers()
            for index in np.flatnonzero(ended):
                final_obs[index] = self._observer.append(infos["final_obs"][index], numbers[index])
            infos["final_obs"] = final_obs
        return infos

    def _info(
        self, step: StepInfo, base: Float[np.ndarray, " envs"], paid: Float[np.ndarray, " envs"]
    ) -> tuple[dict[str, Any], Float[np.ndarray, " envs"]]:
        """The behaviour's info after a step, and what the behaviour pays."""
        ours = self.weight * paid
        verdict = {name: np.array(getattr(step, name)) for name in VERDICTS}
        return {
            **self._locations(),
            "verdict": verdict,
            "cycles": step.cycles.astype(np.int64),
            "rewards": {"base": np.array(base, np.float64), "behaviour": ours.copy()},
            **_form_info(step.form),
        }, ours

    def _info_at_the_start(self) -> dict[str, Any]:
        """The behaviour's info after a reset."""
        assert self._memory is not None
        no, zero = np.zeros(self.num_envs, bool), np.zeros(self.num_envs)
        form = self.behaviour_reward.initial_info(self._memory.form, self._memory.phase.location, zero)
        return {
            **self._locations(),
            "verdict": {name: no.copy() for name in VERDICTS},
            "cycles": np.zeros(self.num_envs, np.int64),
            "rewards": {name: zero.copy() for name in ("base", "behaviour")},
            **_form_info(form),
        }

    def _begun(self, info: dict[str, Any], begun: Envs) -> dict[str, Any]:
        """The behaviour's info, in which some environments have begun an episode."""
        return jax.tree.map(lambda one, other: np.where(begun, one, other), self._info_at_the_start(), info)

    def _locations(self) -> dict[str, Any]:
        assert self._memory is not None
        location = self._memory.phase.location
        return {"phase": self._names[location], "location": location.astype(np.int64)}

    def _with(self, infos: dict[str, Any], info: dict[str, Any], chosen: Envs) -> dict[str, Any]:
        if self.key in infos:
            raise taken(self.key)
        return {**infos, self.key: info, f"_{self.key}": chosen.copy()}

    def _numbers(self) -> np.ndarray:
        assert self._memory is not None
        memory = self._memory
        zero = np.zeros(self.num_envs)
        return self.behaviour_reward.observed(memory.form, memory.phase.location, zero)

    def _observed(self, observations: Any) -> Any:
        return (
            observations if self._observer is None else self._observer.append(observations, self._numbers())
        )


def _form_info(form: Mapping[str, Any]) -> dict[str, Any]:
    """What the form reports, in the dtypes that Gymnasium gives to Python's numbers."""
    wide = {"b": bool, "i": np.int64, "u": np.int64, "f": np.float64}
    arrays = {name: np.asarray(value) for name, value in form.items()}
    report = {name: array.astype(wide[array.dtype.kind]) for name, array in arrays.items()}
    return {"form": report} if report else {}
