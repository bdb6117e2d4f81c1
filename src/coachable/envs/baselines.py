"""The written controllers that learning is measured against, each walked once in float64."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.rollout import Episode, Summary, Trajectory, rollout, summary
from coachable.envs.walking_task import NO_BOX, WalkingTask, make_task
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.controllers import with_settings
from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import SampledState, sampled_step
from coachable.rewards.setup import PAPER_SETUPS, Semantics

SETTLED_STEPS = 4
"""Period, step length and speed are means over the last so many whole steps, when the gait has settled."""


@dataclass(frozen=True, eq=False)
class BaselineReport:
    """How far, how fast and for what reward a baseline walks."""

    controller: str
    semantics: Semantics
    hip_x: float
    """Where the hip was at the end [m]."""
    foot_x: float
    """Where the stance foot was at the end [m]."""
    touchdowns: int
    period: float
    """Time from touchdown to touchdown [s]; NaN if there were not two."""
    step_length: float
    """Distance from stance foot to stance foot [m]; NaN if there were not two touchdowns."""
    speed: float
    """step_length / period [m/s]."""
    share_in_cycle: float
    """Share of the samples after the first one that lie in a phase of the behaviour."""
    rewards: Mapping[str, float]
    """Return of the episode under each of the paper's reward setups, by name."""
    fell: bool
    trajectory: Trajectory


def baseline(
    controller_name: str,
    semantics: Semantics = "paper",
    parameters: Any = None,
    seconds: float = 10.0,
    *,
    plant: Plant | str = "compass",
    behaviour: Behaviour | None = None,
) -> BaselineReport:
    """Walk a written controller of a plant from its start under the free clock, unclipped, in float64.

    **Arguments:** `controller_name`, as in `controller_of`; the others as in `make_task`.

    Raises `ParameterError` for an unknown controller or more than 100,000 s, and what `make_task` raises.
    """
    real_number(seconds, "seconds", ParameterError, least=0.01, most=100_000)
    with jax.enable_x64(True):
        setup = PAPER_SETUPS["sparse"]
        task = make_task(
            setup,
            semantics,
            parameters=parameters,
            behaviour=behaviour,
            seconds=seconds,
            plant=plant,
            box=NO_BOX,
        )
        controller = controller_of(task.plant, controller_name)
        episode, numbers = eqx.filter_jit(_walk)(task, controller)
        trajectory = Trajectory.of(task, episode)
        times, feet = touchdowns(task, trajectory)
    period, step_length = _mean_of_last(np.diff(times)), _mean_of_last(np.diff(feet))
    return BaselineReport(
        controller=controller_name,
        semantics=semantics,
        hip_x=float(numbers.hip_x),
        foot_x=float(numbers.foot_x),
        touchdowns=len(times),
        period=period,
        step_length=step_length,
        speed=step_length / period,
        share_in_cycle=float(numbers.share_in_cycle),
        rewards={name: float(np.dot(setup.weights, numbers.terms)) for name, setup in PAPER_SETUPS.items()},
        fell=bool(numbers.fell),
        trajectory=trajectory,
    )


def controller_of(plant: Plant, name: str) -> Controller:
    """The written controller of a plant that has this name, with settings behind it if they are given.

    **Arguments:** `name`, one of `plant.controllers()`, and behind it settings of the controller, each as
    `:name=number` with commas between several numbers: `"virtual-gravity:slope=-0.05"`.

    Raises `ParameterError` if there is no such controller, or it has no such setting.
    """
    controllers = plant.controllers()
    bare, *settings = name.split(":")
    if bare not in controllers:
        raise ParameterError(f"{plant.name} has no baseline {bare!r}; {suggestion(bare, controllers)}")
    return with_settings(controllers[bare], dict(_setting(each, name) for each in settings))


def _setting(text: str, name: str) -> tuple[str, list[float]]:
    key, _, numbers = text.partition("=")
    try:
        return key, [_finite(number) for number in numbers.split(",")]
    except ValueError:
        example = f"{key or 'name'}=-0.05"
        raise ParameterError(
            f"{name!r}: after each colon a setting and its number is needed, such as {example}"
        ) from None


def _finite(text: str) -> float:
    if not math.isfinite(number := float(text)):
        raise ValueError(text)
    return number


def touchdowns(task: WalkingTask, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return when the feet touched down [s] and where the new stance foot then stood [m].

    Arguments: trajectory, of this task under the free clock and in the dtype it was walked in. Its steps are
    integrated once more, side by side, to learn what happened inside them.
    """
    x = np.stack([column[:-1] for column in trajectory.states.values()], axis=-1)
    control = np.stack([column[:-1] for column in trajectory.controls.values()], axis=-1)

    @jax.jit
    @jax.vmap
    def again(x, control):
        return sampled_step(task.plant, task.sampling, SampledState.at(x), control)[1].moved

    steps = again(jnp.asarray(x), jnp.asarray(control))
    (changed,) = np.nonzero(steps.touchdowns)
    times = trajectory.time[changed] + np.asarray(steps.touchdown_time)[changed]
    return times, trajectory.foot_x[changed + 1]


def _walk(task: WalkingTask, controller: Callable[[Array], Array]) -> tuple[Episode, Summary]:
    episode = rollout(task, controller)
    return episode, summary(task, episode)


def _mean_of_last(values: np.ndarray) -> float:
    return float(np.mean(values[-SETTLED_STEPS:])) if len(values) else float("nan")
