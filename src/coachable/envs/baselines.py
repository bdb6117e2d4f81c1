"""The controllers that learning is measured against, each walked once in float64."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from coachable.envs.rollout import Episode, Summary, Trajectory, rollout, summary
from coachable.envs.walking_task import NO_BOX, WalkingTask, make_task
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.compass import PAPER_PARAMETERS, STATE_NAMES, CompassParameters, VirtualGravity
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.plants.integrate import advance
from coachable.rewards.setup import PAPER_SETUPS, Semantics

ControllerName = Literal["virtual-gravity", "constant-torque", "none"]

CONTROLLER_NAMES: tuple[ControllerName, ...] = ("virtual-gravity", "constant-torque", "none")

WALKING_TORQUE = (-1.35, -0.18)
"""A constant torque (ankle, hip) with which the paper's walker walks [N m]; whoever learns has to beat it."""

SETTLED_STEPS = 4
"""Period, step length and speed are means over the last so many whole steps, when the gait has settled."""


@dataclass(frozen=True, eq=False)
class BaselineReport:
    """How far, how fast and for what reward a baseline walks."""

    controller: ControllerName
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
    """Share of the samples after the first one that lie in a phase of the paper's behaviour."""
    rewards: Mapping[str, float]
    """Return of the episode under each of the paper's reward setups, by name."""
    fell: bool
    trajectory: Trajectory


def baseline(
    controller_name: ControllerName,
    semantics: Semantics = "paper",
    parameters: CompassParameters = PAPER_PARAMETERS,
    seconds: float = 10.0,
) -> BaselineReport:
    """Walk a baseline from the paper's start under the free clock, unclipped, in float64.

    In `released-code` semantics virtual gravity is the released code's, wrong index included.

    Raises `ParameterError` for an unknown controller or semantics.
    """
    if controller_name not in CONTROLLER_NAMES:
        raise ParameterError(
            f"unknown controller {controller_name!r}; {suggestion(controller_name, CONTROLLER_NAMES)}"
        )
    with jax.enable_x64(True):
        setup = PAPER_SETUPS["sparse"]
        task = make_task(setup, semantics, parameters=parameters, seconds=seconds, box=NO_BOX)
        controller = _controller(controller_name, task)
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


def touchdowns(task: WalkingTask, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return when the feet touched down [s] and where the new stance foot then stood [m].

    Arguments: trajectory, of this task under the free clock and in the dtype it was walked in. Its steps are
    integrated once more, side by side, to learn what happened inside them.
    """
    x = np.stack([getattr(trajectory, name)[:-1] for name in STATE_NAMES], axis=-1)
    control = np.stack([trajectory.u1[:-1], trajectory.u2[:-1]], axis=-1)

    @jax.jit
    @jax.vmap
    def again(x, foot_x, control):
        return advance(task.plant, x, foot_x, control, task.control_dt)

    steps = again(jnp.asarray(x), jnp.asarray(trajectory.foot_x[:-1]), jnp.asarray(control))
    (changed,) = np.nonzero(steps.touchdowns)
    times = trajectory.time[changed] + np.asarray(steps.touchdown_time)[changed]
    return times, trajectory.foot_x[changed + 1]


def _walk(task: WalkingTask, controller: Callable[[Array], Array]) -> tuple[Episode, Summary]:
    episode = rollout(task, controller)
    return episode, summary(task, episode)


def _mean_of_last(values: np.ndarray) -> float:
    return float(np.mean(values[-SETTLED_STEPS:])) if len(values) else float("nan")


def _controller(name: ControllerName, task: WalkingTask) -> VirtualGravity | ConstantTorque | NoTorque:
    if name == "virtual-gravity":
        return VirtualGravity(task.plant, released=task.semantics == "released-code")
    return ConstantTorque(WALKING_TORQUE) if name == "constant-torque" else NoTorque(2)
