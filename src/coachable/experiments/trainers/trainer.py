"""What a trainer is: a value that knows which problems it can train, and trains their lanes."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import gymnasium
import numpy as np

from coachable.envs.problem import Problem
from coachable.envs.squashing import Squashing
from coachable.experiments.log import Columns
from coachable.learning.policy import Policy

if TYPE_CHECKING:
    from coachable.envs.rollout import Trajectory
    from coachable.experiments.experiment import Experiment, Lane, Which
    from coachable.experiments.run_folder.writer import RunFolder

Watch = Callable[[], None]
"""Called every now and then while lanes are trained."""


@runtime_checkable
class TrainedLanes(Protocol):
    """Some lanes of an experiment while they are trained, and afterwards."""

    @property
    def lanes(self) -> Sequence[Lane]:
        """Which they are."""
        ...

    @property
    def num_steps(self) -> int:
        """Training steps of each lane so far."""
        ...

    @property
    def num_measured(self) -> int:
        """How many of the lanes are trained and measured to the end."""
        ...

    def latest(self) -> Mapping[Lane, Columns]:
        """The latest evaluation of each lane that has been evaluated, a row an episode."""
        ...

    def table(self, name: str) -> Columns:
        """What was logged for a table of the run folder, lane by lane in order of training."""
        ...

    def policies(self) -> Mapping[tuple[Lane, Which], Policy]:
        """The last policy of every lane, and the best by evaluation return."""
        ...

    def trajectories(self) -> Mapping[tuple[Lane, Which], Trajectory]:
        """The evaluation episode of each of them, for a plant; empty for a Gymnasium environment."""
        ...

    def save(self) -> None:
        """Write the checkpoint."""
        ...


@dataclass(frozen=True, kw_only=True)
class Work:
    """What a trainer is given."""

    experiment: Experiment
    folder: RunFolder
    num_workers: int
    """Lanes, or batches of them, trained at once."""
    track: Path | None
    """The folder of TensorBoard events, if they are wanted."""


class Trainer(abc.ABC):
    """A learning algorithm with its settings. Concrete trainers are frozen dataclasses."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """What a plan calls it."""

    @property
    @abc.abstractmethod
    def steps_an_update(self) -> int:
        """Training steps between two moments at which a lane's weights change."""

    @property
    def squashing(self) -> Squashing:
        """How a plant's task keeps the actions of this trainer's policies in its box."""
        return "clip"

    @property
    def compiled(self) -> bool:
        """Whether lanes are trained and evaluated by compiled programs, and not in Gymnasium environments."""
        return False

    @property
    def mirrors_samples(self) -> bool:
        """Whether it also learns from mirror images of samples, where a setup says `mirror = "samples"`."""
        return False

    @abc.abstractmethod
    def cannot_train(self, problem: Problem) -> str:
        """Why it cannot train a problem, in a sentence; empty if it can."""

    @abc.abstractmethod
    def to_data(self) -> dict[str, Any]:
        """Its settings as a table of a plan's TOML form, under the table's name."""

    def check(self, experiment: Experiment) -> None:
        """Try what can be tried before work begins.

        **Raises:** `PlanError` for settings or an environment that cannot be trained with,
        `MissingExtraError` for a package that is missing.
        """
        return None

    @abc.abstractmethod
    def batch_sizes(self, experiment: Experiment, num_workers: int) -> tuple[int, ...]:
        """How many lanes each batch has; a resumed run keeps it, for results depend on it in their bits."""

    @abc.abstractmethod
    def start(self, work: Work) -> tuple[Sequence[TrainedLanes], Callable[[Watch], None]]:
        """The lanes, from their checkpoints if there are any, and what trains and measures them all."""


@runtime_checkable
class Learner(Protocol):
    """One lane of an algorithm that is written in Python, with its environment."""

    @property
    def num_steps(self) -> int:
        """Steps of the environment so far."""
        ...

    @property
    def steps_an_update(self) -> int:
        """Steps between two moments at which the weights change."""
        ...

    def learn(self, num_steps: int, between: Callable[[], None]) -> None:
        """Go on until there were this many steps, rounded up to whole updates.

        `between` is called whenever an update is over and the next rollout has not begun, and at the end.
        """
        ...

    def diagnostics(self) -> Mapping[str, float]:
        """The latest update in those numbers of `schemas.DIAGNOSTICS` that the algorithm reports, by name.

        Empty before the first update, and after `restore` until the next one.
        """
        ...

    def policy(self) -> Policy:
        """What it does when it does not explore."""
        ...

    def arrays(self) -> dict[str, np.ndarray]:
        """All that a checkpoint has to hold; consistent inside `between`."""
        ...

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Be what it was when `arrays` gave this.

        **Raises:** `KeyError` if something is not there.
        """
        ...

    def close(self) -> None:
        """Close its environments."""
        ...


MakeEnv = Callable[[], gymnasium.Env]
