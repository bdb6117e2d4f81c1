"""A lane in a process of its own: its log, its evaluations, its checkpoint, and its parent's view of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from coachable.envs.episode_log import EndedEpisodes, EpisodeLog
from coachable.envs.problem import PlantProblem
from coachable.envs.rollout import Trajectory, rollout
from coachable.envs.squashing import Deterministic
from coachable.experiments.assessment import Assessment, assessment, with_share
from coachable.experiments.experiment import Experiment, Lane, Which
from coachable.experiments.layout import evaluation_steps
from coachable.experiments.log import Columns, Log
from coachable.experiments.run_folder.checkpoint import load_arrays, save_arrays
from coachable.experiments.run_folder.schemas import DIAGNOSTICS
from coachable.experiments.trainers.compiled import Tasks
from coachable.experiments.trainers.lane_processes import Progress, Report
from coachable.experiments.trainers.trainer import Learner
from coachable.foundation.errors import RunFolderError
from coachable.learning.policy import Policy

SECONDS_BETWEEN_CHECKPOINTS = 60.0
MOST_TIME_FOR_SAVING = 0.02
"""Share of the time that may go into checkpoints: a replay buffer is large."""

Note = Callable[[int, str, Mapping[str, float]], None]
"""Takes the step, `evaluation` or `training`, and means by name."""


@dataclass(frozen=True, eq=False)
class LaneWork:
    """One lane of an experiment, to be trained in a process of its own: a value that can be sent to it."""

    experiment: Experiment
    make_learner: Callable[..., Learner]
    """From what makes the lane's environment, and its seed; and `mirror`, where samples are mirrored."""
    lane: Lane
    path: Path
    """Its checkpoint, and in the end all that came of it."""
    track: Path | None = None
    """The folder of its TensorBoard events."""

    @property
    def name(self) -> str:
        """`setup-seed`."""
        return self.lane.name

    def finished(self) -> Progress | None:
        """The last progress, if the lane was trained to its end.

        **Raises:** `RunFolderError` naming a checkpoint that is damaged.
        """
        return finished(self.path)

    def run(self, report: Report) -> None:
        """Train and measure the lane, from its checkpoint if there is one."""
        jax.config.update("jax_cpu_enable_async_dispatch", False)
        experiment, episodes = self.experiment, Episodes()
        setup = experiment.setup(self.lane.setup)
        make = partial(experiment.problem.training_environment, setup, experiment.evaluate_every)
        measure = assessment(experiment, self.lane)
        mirror = experiment.problem.sample_mirror(setup)
        learner = self.make_learner(
            lambda: EpisodeLog(make(), episodes.ended, measure.sums_of, measure.fell_key),
            self.lane.seed,
            **({} if mirror is None else {"mirror": mirror}),
        )
        due = [step for steps in evaluation_steps(experiment).values() for step in steps]
        with _tracked(self.track) as note:
            rule = experiment.deterministic[0]
            about = experiment.problem.policy_description(setup)
            training = _Training(learner, episodes, measure, rule, about, due, self.path, report, note)
            if self.path.exists():
                training.restore()
            learner.learn(experiment.total_steps, training.between)
            training.finish()


@dataclass
class Episodes:
    """The training episodes of a lane, from all of its environments."""

    log: Log = field(default_factory=Log)
    ended: EndedEpisodes = field(default_factory=EndedEpisodes)
    """Those that ended since the last update; they are logged with the diagnostics of the next one."""

    def log_ended(self, diagnostics: Mapping[str, float]) -> None:
        """Log the episodes that ended in the rollout before an update, with that update's diagnostics."""
        about = {name: diagnostics.get(name, np.nan) for name in DIAGNOSTICS}
        for row in self.ended.rows:
            self.log.add({name: np.array([value]) for name, value in (row | about).items()})
        self.ended.rows.clear()


class _Training:
    """A lane between two updates: evaluated when that is due, and saved from time to time."""

    def __init__(
        self,
        learner: Learner,
        episodes: Episodes,
        measure: Assessment,
        rule: Deterministic,
        about: Mapping[str, Any],
        due: list[int],
        path: Path,
        report: Report,
        note: Note,
    ):
        self._learner, self._episodes, self._measure = learner, episodes, measure
        self._rule: Deterministic = rule
        self._about = about
        self._due, self._path, self._report, self._note = due, path, report, note
        self._evaluations = Log()
        self._tables: dict[str, Columns] = {}
        self._best: Policy | None = None
        self._best_return = -np.inf
        self._latest: Columns = {}
        self._saved_at = time.monotonic()
        self._saving_took = 0.0
        self._num_evaluations = 0
        self._num_noted = 0
        self._done = False

    def between(self) -> None:
        """Between two updates: evaluate what is due, save what is old, report progress."""
        step = self._learner.num_steps
        if self._episodes.ended.rows:
            self._episodes.log_ended(self._learner.diagnostics())
        due = [s for s in self._due if s < step + self._learner.steps_an_update]
        self._due = self._due[len(due) :]
        if due:
            self._evaluate_at(due)
        now = time.monotonic()
        pause = max(SECONDS_BETWEEN_CHECKPOINTS, self._saving_took / MOST_TIME_FOR_SAVING)
        if now > self._saved_at + pause:
            self._save()
        try:
            self._report(Progress(step, self._latest, False))
        except KeyboardInterrupt:
            self._save()
            raise

    def finish(self) -> None:
        self._tables |= self._measure.finish(self._policy())
        self._done = True
        self._save()
        self._report(Progress(self._learner.num_steps, self._latest, True))

    def restore(self) -> None:
        arrays, about = load_arrays(self._path)
        try:
            self._learner.restore(_under("learner.", arrays))
            self._best = Policy.of(_under("best.", arrays), about["best"]) if about["best"] else None
        except (KeyError, RuntimeError) as error:
            raise RunFolderError(
                f"{self._path} is of another version of coachable or of the trainer: {error}; remove it"
            ) from None
        self._best_return = about["best_return"]
        self._due = self._due[about["num_evaluations"] :]
        self._episodes.log = Log.of(arrays, "episodes.")
        self._num_noted = self._episodes.log.num_rows
        self._episodes.ended.num_steps = self._learner.num_steps
        self._evaluations = Log.of(arrays, "evaluations.")
        self._num_evaluations = about["num_evaluations"]

    def _evaluate_at(self, steps: list[int]) -> None:
        policy = self._policy()
        self._latest = self._measure.evaluate(policy)
        for step in steps:
            rows = len(self._latest["return"])
            self._evaluations.add(self._latest | {"step": np.full(rows, step)})
        self._num_evaluations += len(steps)
        self._note(steps[-1], "evaluation", _means(self._latest))
        if self._episodes.log.num_rows > self._num_noted:
            recent = self._episodes.log.last(self._episodes.log.num_rows - self._num_noted)
            self._note(steps[-1], "training", _means(recent))
            self._num_noted = self._episodes.log.num_rows
        if diagnostics := self._learner.diagnostics():
            self._note(steps[-1], "update", diagnostics)
        if (score := float(np.mean(self._latest["return"]))) > self._best_return:
            self._best, self._best_return = policy, score

    def _policy(self) -> Policy:
        policy = self._learner.policy().acting(self._rule)
        return Policy.of(policy.tensors(), {**policy.description(), **self._about})

    def _save(self) -> None:
        began = time.monotonic()
        last = self._policy()
        best = self._best or last
        arrays = self._episodes.log.arrays("episodes.") | self._evaluations.arrays("evaluations.")
        if not self._done:
            arrays |= {f"learner.{name}": array for name, array in self._learner.arrays().items()}
        for which, policy in (("last", last), ("best", best)):
            arrays |= {f"{which}.{name}": array for name, array in policy.tensors().items()}
        for name, columns in self._tables.items():
            arrays |= Log(columns).arrays(f"{name}.")
        about = {
            "last": last.description(),
            "best": best.description(),
            "best_return": self._best_return,
            "num_evaluations": self._num_evaluations,
            "tables": [*self._tables],
            "done": self._done,
        }
        save_arrays(self._path, arrays, about)
        self._saved_at = time.monotonic()
        self._saving_took = self._saved_at - began


class ProcessLane:
    """A lane as the process sees it that waits for it: how far it is, and what came of it so far."""

    def __init__(self, work: LaneWork):
        self.work = work
        self.lanes = (work.lane,)
        self._progress = Progress(0, {}, False)
        self._loaded: tuple[float, dict[str, Columns], dict[Which, Policy]] | None = None

    @property
    def num_steps(self) -> int:
        """Training steps so far."""
        return self._progress.steps

    @property
    def num_measured(self) -> int:
        """1 if it is trained and measured, else 0."""
        return int(self._progress.done)

    def receive(self, progress: Progress) -> None:
        """Take note of how far the lane is."""
        self._progress = progress

    def latest(self) -> dict[Lane, Columns]:
        """Its latest evaluation, a row an episode; empty before the first."""
        return {self.work.lane: self._progress.latest} if self._progress.latest else {}

    def save(self) -> None:
        """Nothing is left to be done: the lane's own process has saved."""

    def table(self, name: str) -> Columns:
        """What was logged for a table of the run folder, as of the last checkpoint."""
        columns = self._load()[0].get(name, {}) if self.work.path.exists() else {}
        if not columns:
            return {}
        columns = with_share(columns)
        return columns | {"lane": np.full(len(next(iter(columns.values()))), self.work.name)}

    def policies(self) -> Mapping[tuple[Lane, Which], Policy]:
        """The last policy and the best."""
        return {(self.work.lane, which): policy for which, policy in self._load()[1].items()}

    def trajectories(self) -> Mapping[tuple[Lane, Which], Trajectory]:
        """The evaluation episode of each of them, for a plant; empty for a Gymnasium environment."""
        if not isinstance(self.work.experiment.problem, PlantProblem):
            return {}
        tasks = Tasks.of(self.work.experiment, self.work.lane.setup)
        task = tasks.weighted(tasks.evaluation, self.work.lane)
        walk = eqx.filter_jit(lambda policy: rollout(task, policy))
        return {key: Trajectory.of(task, walk(policy)) for key, policy in self.policies().items()}

    def _load(self) -> tuple[dict[str, Columns], dict[Which, Policy]]:
        # Once for each checkpoint, for a replay buffer is long to read.
        written = self.work.path.stat().st_mtime
        if self._loaded is None or self._loaded[0] != written:
            self._loaded = (written, *load_lane(self.work.path))
        return self._loaded[1:]


def finished(path: Path) -> Progress | None:
    """The last progress of a lane that was trained to its end; `None` for another.

    **Raises:** `RunFolderError` naming a file that is damaged.
    """
    if not path.exists():
        return None
    arrays, about = load_arrays(path)
    if not about["done"]:
        return None
    evaluations = Log.of(arrays, "evaluations.").columns()
    steps = evaluations.pop("step")
    return Progress(
        int(steps[-1]), {name: column[steps == steps[-1]] for name, column in evaluations.items()}, True
    )


def load_lane(path: Path) -> tuple[dict[str, Columns], dict[Which, Policy]]:
    """What a lane has logged so far, by table, and its `last` and `best` policy.

    **Raises:** `RunFolderError` naming a file that is damaged.
    """
    arrays, about = load_arrays(path)
    names = ("episodes", "evaluations", *about["tables"])
    tables = {name: Log.of(arrays, f"{name}.").columns() for name in names}
    kinds: tuple[Which, ...] = ("last", "best")
    return tables, {which: Policy.of(_under(f"{which}.", arrays), about[which]) for which in kinds}


def _means(columns: Columns) -> dict[str, float]:
    names = [name for name in columns if name not in ("end_step", "episode", *DIAGNOSTICS)]
    return {name: float(np.mean(columns[name])) for name in names}


def _under(prefix: str, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


@contextmanager
def _tracked(folder: Path | None) -> Iterator[Note]:
    """Writes notes as events for TensorBoard, or nowhere."""
    if folder is None:
        yield lambda step, what, numbers: None
        return
    from tensorboardX import SummaryWriter

    with SummaryWriter(str(folder), flush_secs=10) as writer:

        def note(step: int, what: str, numbers: Mapping[str, float]) -> None:
            for name, number in numbers.items():
                if not math.isfinite(number):
                    continue  # such as the distance of an environment without positions: no point of a curve
                writer.add_scalar(f"{what}/{name}", number, step)

        yield note
