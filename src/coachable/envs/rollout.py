"""One episode of a task under a controller: as JAX arrays, in numbers, and as NumPy arrays by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.envs.walking_task import Timestep, WalkingState, WalkingTask
from coachable.plants.compass import STATE_NAMES
from coachable.rewards.setup import TERM_NAMES


class Episode(eqx.Module):
    """A rollout of fixed length: where it started, and its steps, of which only some were taken."""

    start: WalkingState
    """The task's state before the first step."""
    timesteps: Timestep
    """One entry a step along the leading axis; those behind the end repeat the last step taken."""
    alive: Bool[Array, " steps"]
    """Whether the step was taken, that is, whether the episode had not ended before it."""


class Summary(eqx.Module):
    """An episode in numbers."""

    episode_return: Float[Array, ""]
    """Sum of the rewards, undiscounted."""
    terms: Float[Array, "5"]
    """Sums of the reward's terms without their weights, in the order of `TERM_NAMES`."""
    hip_x: Float[Array, ""]
    """Where the hip was at the end [m], falls included."""
    foot_x: Float[Array, ""]
    """Where the stance foot was at the end [m], falls included."""
    time: Float[Array, ""]
    """How long the episode lasted [s]."""
    length: Int[Array, ""]
    """How many control steps."""
    fell: Bool[Array, ""]
    """Whether it ended with a fall."""
    share_in_cycle: Float[Array, ""]
    """Share of its steps that led into a phase of the behaviour."""


def rollout(
    task: WalkingTask,
    controller: Callable[[Array], Array],
    state: WalkingState | None = None,
    num_steps: int | None = None,
) -> Episode:
    """Run a controller on the task until the episode ends.

    Arguments: controller, from observation to action; state, where to start (by default where a run starts);
    num_steps, how many steps at most (by default as many as the longest episode has).
    """
    start = task.init() if state is None else state
    num_steps = task.longest_episode if num_steps is None else num_steps
    nothing = jax.tree.map(
        lambda leaf: jnp.zeros(leaf.shape, leaf.dtype),
        jax.eval_shape(lambda: task.step(start, controller(task.observation(start)))[1]),
    )

    def step(carry, _):
        state, last, alive = carry
        # Behind its end an episode is walked again from the start, unseen: where the walker fell, every
        # step would search for events anew, and all that is vmapped beside it would wait.
        walking = jax.tree.map(partial(jnp.where, alive), state, start)
        taken = task.step(walking, controller(task.observation(walking)))
        state, timestep = jax.tree.map(lambda new, old: jnp.where(alive, new, old), taken, (state, last))
        return (state, timestep, alive & ~(timestep.terminated | timestep.truncated)), (timestep, alive)

    _, (timesteps, alive) = lax.scan(step, (start, nothing, jnp.array(True)), length=num_steps)
    return Episode(start, timesteps, alive)


def summary(task: WalkingTask, episode: Episode) -> Summary:
    """Return what an episode comes to."""
    steps, alive = episode.timesteps, episode.alive
    length = jnp.sum(alive, dtype=jnp.int32)
    inside = (steps.phase != task.behaviour_reward.tracker.classifier.outside) & alive
    return Summary(
        episode_return=jnp.sum(jnp.where(alive, steps.reward, 0)),
        terms=jnp.sum(jnp.where(alive[:, None], steps.terms, 0), axis=0),
        hip_x=steps.hip_x[-1],
        foot_x=steps.foot_x[-1],
        time=steps.time[-1],
        length=length,
        fell=steps.fell[-1],
        share_in_cycle=jnp.sum(inside).astype(steps.time.dtype) / length.astype(steps.time.dtype),
    )


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An episode as NumPy arrays by name, one row a sample, the initial one included.

    Torques and terms in a row belong to the step that starts there; the last row, where none starts, has
    zeros.
    """

    time: np.ndarray
    """[s]"""
    theta_1: np.ndarray
    """Stance leg's angle from upright [rad]."""
    theta_2: np.ndarray
    """Swing leg's angle from upright [rad]."""
    dtheta_1: np.ndarray
    """[rad/s]"""
    dtheta_2: np.ndarray
    """[rad/s]"""
    u1: np.ndarray
    """Ankle torque, as applied [N m]."""
    u2: np.ndarray
    """Hip torque, as applied [N m]."""
    foot_x: np.ndarray
    """Where the stance foot is [m]."""
    hip_x: np.ndarray
    """Where the hip is [m]."""
    phase: np.ndarray
    """Location in the behaviour: 0 … K−1, or K outside all K phases."""
    terms: Mapping[str, np.ndarray]
    """The reward's terms without their weights, by the names of `TERM_NAMES`."""

    @classmethod
    def of(cls, task: WalkingTask, episode: Episode) -> "Trajectory":
        """Return the steps of an episode that were taken, as NumPy arrays."""
        start, steps, alive = jax.device_get((episode.start, episode.timesteps, episode.alive))
        steps = jax.tree.map(lambda leaf: leaf[alive], steps)

        def with_start(first: np.ndarray, later: np.ndarray) -> np.ndarray:
            return np.concatenate([np.asarray(first)[None], later])

        def with_end(rows: np.ndarray) -> np.ndarray:
            return np.concatenate([rows, np.zeros_like(rows[:1])])

        x = with_start(start.x, steps.observation)
        states: dict[str, np.ndarray] = dict(zip(STATE_NAMES, x.T, strict=True))
        tracker = task.behaviour_reward.tracker
        u1, u2 = with_end(steps.control).T
        return cls(
            time=with_start(np.zeros_like(start.foot_x), steps.time),
            u1=u1,
            u2=u2,
            foot_x=with_start(start.foot_x, steps.foot_x),
            hip_x=with_start(start.hip_x, steps.hip_x),
            phase=tracker.along(states, tracker.none_yet),
            terms=dict(zip(TERM_NAMES, with_end(steps.terms).T, strict=True)),
            **states,
        )

    def columns(self) -> dict[str, np.ndarray]:
        """Return the trajectory as the run folder keeps it: column by column, the hip left out."""
        states = {name: getattr(self, name) for name in STATE_NAMES}
        rest = {"u1": self.u1, "u2": self.u2, "foot_x": self.foot_x, "phase": self.phase}
        return {"t": self.time, **states, **rest, **self.terms}
