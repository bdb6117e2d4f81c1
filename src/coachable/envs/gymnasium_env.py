"""The walking task of a plant as a Gymnasium environment."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import jax
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded
from jaxtyping import Float

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.compiled_walk import (
    Facts,
    begin_episode,
    begin_run,
    facts_of_start,
    facts_of_step,
    info_of,
    start_observation,
    step,
)
from coachable.envs.start_distribution import Distribution, Start
from coachable.envs.walking_task import Clock, WalkingState, make_task
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.named import make_plant
from coachable.plants.plant import Plant
from coachable.rewards.forms import RewardForm
from coachable.rewards.setup import RewardSetup, Semantics, paper_setup

if TYPE_CHECKING:
    from PIL.Image import Image

    from coachable.drawing.window import Window

PICTURES_A_SECOND = 100
"""One a control step."""


class PlantEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """An episode of a plant, in float32: `WalkingTask`, one compiled step a call.

    **Observation:** the plant's state, and with `observe="memory"` in the setup what its reward form shows of
    its memory; its bounds are those of `Plant.observation_bounds`. Of the compass
    walker (θ1, θ2, θ̇1, θ̇2), angles of the stance and the swing leg from upright [rad] and their velocities
    [rad/s], within bounds that no policy can leave.

    **Action:** the plant's controls; what is outside of its `action_box` is clipped to that. Of the compass
    walker the torques (ankle, hip) [N m], between −2 and 0 as in the code released with the paper. They are
    held for 0.01 s, or until a touchdown if `clock="touchdown"`.

    **End:** a fall terminates the episode. So does the time T, at which the paper's return ends; with
    `truncate=True` the time truncates it instead, and a trainer goes on with its value estimate.

    **Info**, after a step and after a reset:

    | key | meaning |
    |---|---|
    | `phase` | location in the behaviour: 0 … K−1, or K outside all K phases |
    | `hip_x`, `foot_x` | where the hip and the stance foot are [m] |
    | `time` | since the start of the episode [s] |
    | `fell` | whether the walker fell, its feet chattered, or its state left the finite numbers |
    | `terms` | the reward's terms by name (`TERM_NAMES`), without their weights; zeros after a reset |
    | `rewards` | the same times their weights: they add up to the reward |

    **Arguments:**
        setup: a `RewardSetup`, or one of the paper's by name. semantics, reward_variant, clock, parameters,
            seconds: as in `make_task`.
        behaviour: a `Behaviour`, or what `load_behaviour` takes; by default the one that ships for the plant.
        plant: a `Plant`, or what `plant_class` takes.
        start_noise, start_distribution: how far from x₀ episodes start; see `Start`.
        truncate: whether the time truncates the episode rather than terminates it, whatever the setup says.
        shared_evaluation_every: as in `make_task`; for training in `released-code` semantics.
        render_mode: `"rgb_array"`, or `"human"` for a window, which needs the [window] extra.

    `reset(seed=…)` begins a new run. `reset()` begins the next episode of the run, and in `released-code`
    semantics the reward remembers the last one's end, as in that code.

    **Raises:** what `make_task`, `load_behaviour`, `Start` and `Window` raise. `step` raises `ResetNeeded`
    outside of an episode and `InvalidAction` for an action that is not one number a control.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": PICTURES_A_SECOND}  # noqa: RUF012

    def __init__(
        self,
        setup: str | RewardSetup = "orthant",
        semantics: Semantics = "paper",
        reward_variant: RewardForm | str | None = None,
        clock: Clock = "free",
        parameters: Any = None,
        behaviour: Behaviour | str | Path | None = None,
        seconds: int | float = 10.0,
        *,
        plant: Plant | str = "compass",
        start_noise: int | float | tuple[int | float, ...] | list[int | float] = 0.0,
        start_distribution: Distribution = "normal",
        truncate: bool = False,
        shared_evaluation_every: int = 0,
        render_mode: str | None = None,
    ):
        if render_mode not in (None, *self.metadata["render_modes"]):
            hint = suggestion(str(render_mode), self.metadata["render_modes"])
            raise ParameterError(f"unknown render_mode {render_mode!r}; {hint}")
        plant = make_plant(plant, parameters).under(semantics)
        if behaviour is None:
            behaviour = plant.behaviour_under(semantics)
        self.behaviour = behaviour if isinstance(behaviour, Behaviour) else load_behaviour(behaviour)
        setup = setup if isinstance(setup, RewardSetup) else paper_setup(setup)
        if setup.observe == "value-only":
            raise ParameterError(
                "observe = 'value-only': an environment shows all that it shows to the policy"
            )
        if truncate:
            setup = replace(setup, time_limit="truncates")
        with jax.enable_x64(False):
            self.task = make_task(
                setup,
                semantics,
                reward_variant,
                clock,
                None,
                self.behaviour,
                float(seconds),
                plant=plant,
                shared_evaluation_every=shared_evaluation_every,
            )
        self.start = Start(plant, start_noise, start_distribution)
        self.render_mode = render_mode
        longest = self.task.seconds + self.task.control_dt  # a touchdown's clock may overshoot by a step
        bounds = plant.observation_bounds(plant.action_box, self.start.largest, longest)
        shares = np.ones(len(self.task.memory_names), bounds.dtype)  # all in [0, 1]
        low, high = np.append(-bounds, 0 * shares), np.append(bounds, shares)
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        low, high = (np.array(torques, np.float32) for torques in plant.action_box)
        self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        self._weights = np.array(self.task.weights)
        self._state: WalkingState | None = None
        self._ended = True
        self._touchdowns = 0
        self._window: Window | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; with a seed, a run whose starts repeat. There are no options."""
        super().reset(seed=seed)
        x0 = self.start.draw(self.np_random)
        if self._state is None or seed is not None:
            state, phase = begin_run(self.task, x0)
        else:
            state, phase = begin_episode(self.task, x0, self._state)
        self._state, self._ended, self._touchdowns = state, False, 0
        return self._tell(facts_of_start(state, phase), start_observation(self.task, state))

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Hold the clipped controls for one control step."""
        control = np.asarray(action, np.float32)
        if control.shape != self.action_space.shape:
            names = ", ".join(self.task.plant.control_names)
            raise InvalidAction(f"an action is one number each for {names}, but its shape is {control.shape}")
        if self._ended or self._state is None:
            raise ResetNeeded("the episode is over, or none has begun; call reset()")
        state, timestep = step(self.task, self._state, control)
        timestep = jax.device_get(timestep)
        self._touchdowns += int(timestep.foot_x != self._facts["foot_x"])
        terminated, truncated = bool(timestep.terminated), bool(timestep.truncated)
        self._state, self._ended = state, terminated or truncated
        observation, info = self._tell(facts_of_step(timestep), timestep.observation)
        return observation, float(timestep.reward), terminated, truncated, info

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The picture of now, 640 × 360, if the render mode is `rgb_array`; a window needs no asking."""
        if self.render_mode is None:
            gymnasium.logger.warn('nothing is rendered; make the environment with render_mode="rgb_array"')
        if self.render_mode != "rgb_array":
            return None
        return np.asarray(self._picture())

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _tell(
        self, facts: Facts, observation: Float[np.ndarray, " observation"]
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """The observation and the info, each in memory of its own; in human mode also the picture."""
        assert self._state is not None
        self._facts = facts
        if self.render_mode == "human":
            from coachable.drawing.window import Window

            self._window = self._window or Window(f"coachable: {self.task.plant.name}")
            self._window.show(self._picture(), PICTURES_A_SECOND)
        return np.array(observation), info_of(facts, self._weights)

    def _picture(self) -> Image:
        if self._state is None:
            raise ResetNeeded("there is nothing to see before reset()")
        return picture(self, np.asarray(self._state.observation), self._facts, self._touchdowns)


def picture(env: PlantEnv, x: Float[np.ndarray, " observation"], facts: Facts, touchdowns: int) -> Image:
    """A robot of this environment that is observed at x, after so many touchdowns."""
    from coachable.drawing.stage import draw_instant

    plant = env.task.plant
    x = np.asarray(x)[: len(plant.state_names)]
    points = plant.kinematics(x, np.asarray(facts["foot_x"]))
    phase, time = int(facts["phase"]), float(facts["time"])
    return draw_instant(plant.skeleton, points, touchdowns, env.behaviour.phases, phase, time)
