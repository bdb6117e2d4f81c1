"""One episode of a task under a controller: as JAX arrays, in numbers, and as NumPy arrays by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from coachable.envs.walking_task import Timestep, WalkingState, WalkingTask
from coachable.foundation.suggestion import suggestion
from coachable.plants.sampled import walk_recorded
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

    def step(state: WalkingState, _: None) -> tuple[WalkingState, Timestep, Array]:
        state, timestep = task.step(state, controller(task.observation(state)))
        return state, timestep, timestep.terminated | timestep.truncated

    _, timesteps, alive = walk_recorded(step, start, num_steps)
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

    Controls and terms in a row belong to the step that starts there; the last row, where none starts, has
    zeros. A coordinate of the state and a control can also be read as an attribute: `trajectory.theta_1` is
    `trajectory.states["theta_1"]`.
    """

    time: np.ndarray
    """[s]"""
    states: Mapping[str, np.ndarray]
    """The plant's state by the names of its coordinates."""
    controls: Mapping[str, np.ndarray]
    """The controls by name, as applied."""
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
        start = episode.start
        num_states = len(task.plant.state_names)
        x0, foot_x, hip_x = jax.device_get((start.walk.x, start.walk.foot_x, start.hip_x))
        steps, alive = jax.device_get((episode.timesteps, episode.alive))
        steps = jax.tree.map(lambda leaf: leaf[alive], steps)

        def with_start(first: np.ndarray, later: np.ndarray) -> np.ndarray:
            return np.concatenate([np.asarray(first)[None], later])

        def with_end(rows: np.ndarray) -> np.ndarray:
            return np.concatenate([rows, np.zeros_like(rows[:1])])

        x = with_start(x0, steps.observation[:, :num_states])  # the state comes first in an observation
        states: dict[str, np.ndarray] = dict(zip(task.plant.state_names, x.T, strict=True))
        tracker = task.behaviour_reward.tracker
        return cls(
            time=with_start(np.zeros_like(foot_x), steps.time),
            states=states,
            controls=dict(zip(task.plant.control_names, with_end(steps.control).T, strict=True)),
            foot_x=with_start(foot_x, steps.foot_x),
            hip_x=with_start(hip_x, steps.hip_x),
            phase=tracker.along(states, tracker.none_yet),
            terms=dict(zip(TERM_NAMES, with_end(steps.terms).T, strict=True)),
        )

    def columns(self) -> dict[str, np.ndarray]:
        """Return the trajectory as the run folder keeps it: column by column, the hip left out."""
        return {
            "t": self.time,
            **self.states,
            **self.controls,
            "foot_x": self.foot_x,
            "phase": self.phase,
            **self.terms,
        }

    def __getattr__(self, name: str) -> np.ndarray:
        columns = {**vars(self).get("states", {}), **vars(self).get("controls", {})}
        if name not in columns:
            raise AttributeError(f"a trajectory has no {name!r}; {suggestion(name, columns)}")
        return columns[name]
