"""Walks of a plant's lanes with what happened inside their steps: touchdowns, work, what was followed."""

from __future__ import annotations

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.automata.trace import Trace
from coachable.behaviours.predicates import Signal
from coachable.envs.problem import PlantProblem
from coachable.envs.rollout import Trajectory, rollout
from coachable.envs.start_distribution import Start
from coachable.envs.walking_task import NO_BOX, WalkingTask
from coachable.experiments.experiment import EVALUATION_SEED, Which
from coachable.experiments.recorded_walk import RecordedWalk
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.errors import ParameterError, PlanError
from coachable.learning.policy import Policy
from coachable.plants.integrate import Advance
from coachable.plants.metered import Metered, has_power
from coachable.plants.outcome import Outcome
from coachable.plants.plant import Plant
from coachable.plants.sampled import TIME_TOLERANCE, SampledState, sampled_step
from coachable.rewards.described_reward import RewardMemory
from coachable.rewards.setup import TERM_NAMES, RewardSetup


class _Steps(eqx.Module):
    """What happened inside control steps, along the leading axis."""

    touchdowns: Int[Array, " steps"]
    touchdown_time: Float[Array, " steps"]
    """Of each step's last touchdown, since its beginning [s]; NaN without one."""
    work: Float[Array, " steps"]
    """Of the actuators [J]."""
    outcome: Int[Array, " steps"]
    """An `Outcome`."""
    follows: Bool[Array, " steps"]
    """Whether the step belongs to the behaviour."""


def num_starts(plant: Plant, wanted: int) -> int:
    """How many episodes of different starts a plant has, `wanted` at most."""
    return wanted if plant.start_box else min(wanted, 1)


def recorded_plant_walk(
    run: Run, setup: str, seed: int, which: Which, episode: int, seconds: float
) -> RecordedWalk:
    """An episode of a plant's lane, as far as it goes.

    Episode 0 is the evaluation episode that the run folder holds. The others begin at starts drawn evenly
    from the plant's `start_box`, the same ones for every lane. What happened inside a step is found by
    integrating it once more from where it began.

    The trace holds the plant's state and controls by name (a control is held from its sample on), and

    | signal | is |
    |---|---|
    | `base_x`, `base_z` | where the base is [m] |
    | `stance_foot_x` | where the stance foot stands [m] |
    | `touchdown_time` | when the last touchdown before the sample was [s]; NaN before the first |
    | `leg_0_foot_contact`, … | 1 while the leg stands, else 0; legs as `Skeleton` numbers them at the start |
    | `power` | of the actuators since the sample before, on average, braking counted as driving [W] |
    | `weight` | the robot's [N] |

    of which those are left out that the plant does not define, with a sentence in `absent`.

    **Raises:** `RunFolderError` if the run has no such lane or nothing is stored of it, and `PlanError` for
    an episode beyond the first of a plant without a start box.
    """
    problem = run.experiment.require_plant("a walk with touchdowns")
    run.lane(setup, seed)
    weights = run.experiment.setup(setup)
    with jax.enable_x64(False):  # as it was trained
        task = problem.task(weights.of_policy, box=NO_BOX)
        columns = (
            run.trajectory(setup, seed, which)
            if episode == 0
            else _roll_out(_starting(task, episode), run.policy(setup, seed, which))
        )
        steps = _inside(task, columns)
    time = columns["t"].astype(float)
    fell = steps.outcome[-1] != Outcome.WALKING
    fell |= time[-1] < task.seconds - TIME_TOLERANCE * task.control_dt
    signals, absent = _signals(problem, columns, steps)
    # Where touchdowns restart the clock, two may be no time apart in float32: the later sample counts.
    kept = np.append(np.diff(time) > 0, True) & (time <= seconds + TIME_TOLERANCE * task.control_dt)
    trace = Trace(
        time[kept], tuple(signals), {signal.name: column[kept] for signal, column in signals.items()}
    )
    environment, behaviour = _returns(weights, columns)
    return RecordedWalk(
        f"{setup}, seed {seed}",
        trace,
        dt=float(trace.time[-1]) / max(1, len(trace.time) - 1),
        phase=columns["phase"].astype(int)[kept],
        follows=np.append(False, steps.follows)[kept],
        phases=run.behaviour.phases,
        environment_return=environment,
        behaviour_return=behaviour,
        fell=bool(fell),
        absent=absent,
    )


def _starting(task: WalkingTask, episode: int) -> WalkingTask:
    """The task with the start of an episode other than the first."""
    plant = task.plant
    if not plant.start_box:
        raise PlanError(
            f"{plant.name} gives no start_box, so all its episodes begin at the same start: take episode 0"
        )
    x0 = Start(plant, plant.start_box, "uniform").draw(np.random.default_rng(EVALUATION_SEED + episode))
    return eqx.tree_at(lambda task: task.x0, task, jnp.asarray(x0))


def _roll_out(task: WalkingTask, policy: Policy) -> dict[str, np.ndarray]:
    """An episode by column, as the run folder stores one."""
    return Trajectory.of(task, _compiled_rollout(task, policy)).columns()


_compiled_rollout = eqx.filter_jit(rollout)


def _inside(task: WalkingTask, columns: Mapping[str, np.ndarray]) -> _Steps:
    """What happened inside the steps of a trajectory."""
    x = np.stack([columns[name] for name in task.plant.state_names], axis=-1)
    control = np.stack([columns[name] for name in task.plant.control_names], axis=-1)
    num_steps, longest = len(x) - 1, max(len(x) - 1, task.longest_episode)
    # As many rows for every episode, so that one program serves all: those behind the end are its start.
    rows = np.append(np.arange(num_steps), np.zeros(longest - num_steps, int))
    after = np.append(np.arange(1, num_steps + 1), np.zeros(longest - num_steps, int))
    task = eqx.tree_at(lambda task: task.x0, task, jnp.asarray(x[0]))
    states, controls, later = (jnp.asarray(part) for part in (x[rows], control[rows], x[after]))
    found = jax.device_get(_integrate_again(task, states, controls, later, jnp.asarray(num_steps)))
    return jax.tree.map(lambda leaf: leaf[:num_steps], found)


@eqx.filter_jit
def _integrate_again(
    task: WalkingTask,
    x: Float[Array, "steps state"],
    control: Float[Array, "steps control"],
    x_after: Float[Array, "steps state"],
    num_steps: Int[Array, ""],
) -> _Steps:
    metered, reward = Metered(task.plant), task.behaviour_reward
    names = reward.behaviour.signal_names

    @jax.vmap
    def integrate(x: Array, control: Array) -> Advance:
        start = SampledState.at(jnp.append(x, jnp.zeros((), x.dtype)))
        return sampled_step(metered, task.sampling, start, control)[1].moved

    def follow(memory: RewardMemory, step: tuple) -> tuple[RewardMemory, Array]:
        x_after, elapsed, number = step
        signals = task.plant.signals(x_after, names)
        memory, _, info = reward.step(memory, signals, number == num_steps - 1, elapsed)
        return memory, info.follows

    moved = integrate(x, control)
    _, follows = lax.scan(follow, task.init().memory, (x_after, moved.elapsed, jnp.arange(len(x))))
    return _Steps(moved.touchdowns, moved.touchdown_time, moved.x[:, -1], moved.outcome, follows)


def _signals(
    problem: PlantProblem, columns: Mapping[str, np.ndarray], steps: _Steps
) -> tuple[dict[Signal, np.ndarray], tuple[str, ...]]:
    """What is recorded at each sample, and sentences about what is not."""
    plant, absent = problem.plant, []
    time = columns["t"].astype(float)
    named: dict[str, tuple[str, np.ndarray]] = {}
    for names, units in (
        (plant.state_names, plant.state_units),
        (plant.control_names, plant.control_units),
    ):
        for name, unit in zip(names, units or ("",) * len(names), strict=True):
            named[name] = unit, columns[name].astype(float)
    x = np.stack([columns[name] for name in plant.state_names], axis=-1)
    base = np.asarray(jax.vmap(plant.base)(jnp.asarray(x), jnp.asarray(columns["foot_x"])), float)
    found = {
        "base_x": ("m", base[:, 0]),
        "base_z": ("m", base[:, 1]),
        "stance_foot_x": ("m", columns["foot_x"].astype(float)),
        "touchdown_time": ("s", _last_touchdown(time, steps)),
    }
    try:
        num_legs = plant.skeleton.num_legs
    except ParameterError as error:
        num_legs = 0
        absent.append(f"{error}; which leg stands is not known, nor which gait it is")
    if num_legs == 1:
        absent.append(
            f"{plant.name} has one leg, and when it is in the air is not known, nor which gait it is"
        )
    if num_legs > 2:
        absent.append(f"{plant.name} has {num_legs} legs; alternation, lag and asymmetry are measured of two")
    standing = np.append(0, np.cumsum(steps.touchdowns))
    for leg in range(num_legs if num_legs > 1 else 0):
        found[f"leg_{leg}_foot_contact"] = "", (standing % num_legs == leg).astype(float)
    if has_power(plant):
        took, work = np.diff(time), steps.work.astype(float)
        power = np.divide(work, took, out=np.zeros_like(work), where=took > 0)
        found["power"] = "W", np.append(0.0, power)
        found["weight"] = "N", np.full(len(time), float(plant.weight))
    else:
        absent.append(f"{plant.name} does not define power and weight, so there is no cost of transport")
    own = {signal.name: signal for signal in problem.behaviour.signals}
    return {
        own.get(name, Signal(name, unit)): column for name, (unit, column) in ({**found, **named}).items()
    }, tuple(absent)


def _last_touchdown(time: Float[np.ndarray, " samples"], steps: _Steps) -> Float[np.ndarray, " samples"]:
    """When the last touchdown before each sample was [s]; NaN before the first."""
    times = np.append(np.nan, time[:-1] + steps.touchdown_time)
    numbers = np.arange(len(time))
    return times[np.maximum.accumulate(np.where(np.append(False, steps.touchdowns > 0), numbers, 0))]


def _returns(setup: RewardSetup, columns: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """What the weighted terms of the reward came to: all but the behaviour's, and the behaviour's."""
    paid = {
        name: weight * float(columns[name].sum(dtype=float))
        for name, weight in zip(TERM_NAMES, setup.weights, strict=True)
    }
    behaviour = paid.pop("orthant")
    return sum(paid.values()), behaviour
