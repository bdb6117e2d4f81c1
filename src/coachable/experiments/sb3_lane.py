"""One lane that stable-baselines3 trains: what it logs, when it is evaluated, and its checkpoint."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from coachable.experiments.lane_processes import News, Tell
from coachable.experiments.log import Columns, Log
from coachable.experiments.run_folder.checkpoint import load_arrays, save_arrays
from coachable.experiments.run_folder.reader import Which
from coachable.experiments.run_folder.schemas import DIAGNOSTICS
from coachable.foundation.errors import PlanError, RunFolderError
from coachable.learning.policy import Policy

if TYPE_CHECKING:
    from coachable.learning.sb3 import Learner

SECONDS_BETWEEN_CHECKPOINTS = 60.0
MOST_TIME_FOR_SAVING = 0.02
"""Share of the time that may go into checkpoints: a replay buffer is large."""


def require_sb3(trainer: str, settings: Mapping[str, Any]) -> None:
    """**Raises:** `PlanError` if stable-baselines3 is not there, or its algorithm has no such setting."""
    if any(find_spec(package) is None for package in ("stable_baselines3", "torch")):
        raise PlanError(f"{trainer} needs stable-baselines3: pip install 'coachable[sb3]'")
    from coachable.learning.sb3 import check_settings

    check_settings(trainer, settings)


Note = Callable[[int, str, Mapping[str, float]], None]


@dataclass
class Episodes:
    """The training episodes of a lane, from all of its environments."""

    log: Log = field(default_factory=Log)
    ended: list[dict[str, Any]] = field(default_factory=list)
    """Those that ended since the last update; they are logged with the diagnostics of the next one."""
    num_steps: int = 0
    """Steps of all environments together."""

    def log_ended(self, diagnostics: Mapping[str, float]) -> None:
        """Log the episodes that ended in the rollout before an update, with that update's diagnostics."""
        about = {name: diagnostics.get(name, np.nan) for name in DIAGNOSTICS}
        for row in self.ended:
            self.log.add({name: np.array([value]) for name, value in (row | about).items()})
        self.ended.clear()


class EpisodeLog(gymnasium.Wrapper):
    """Keeps the return, the length and the end of every episode, and sums of what its infos tell.

    Infos go no further: stable-baselines3 reads none of ours, but copies each of them deeply.

    **Arguments:** `episodes`, where they are kept; `sums_of`: from an info to numbers by name, which are
    added up over an episode; `fell_key`, where an info tells whether an episode that terminated was a fall,
    if not all are.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        episodes: Episodes,
        sums_of: Callable[[Mapping[str, Any]], Mapping[str, float]],
        fell_key: str | None = None,
    ):
        super().__init__(env)
        self._fell_key = fell_key
        self._episodes = episodes
        self._sums_of = sums_of
        self._begin()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode; one that has not ended is forgotten."""
        self._begin()
        observation, _ = self.env.reset(seed=seed, options=options)
        return observation, {}

    def step(self, action: Any) -> Any:
        """One step, counted."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._episodes.num_steps += 1
        self._length += 1
        self._return += float(reward)
        for name, number in self._sums_of(info).items():
            self._sums[name] = self._sums.get(name, 0.0) + number
        if terminated or truncated:
            fell = terminated if self._fell_key is None else info[self._fell_key]
            episode = {"end_step": self._episodes.num_steps, "return": self._return, "length": self._length}
            self._episodes.ended.append({**episode, "fell": bool(fell), **self._sums})
        return observation, reward, terminated, truncated, {}

    def _begin(self) -> None:
        self._return, self._length = 0.0, 0
        self._sums: dict[str, float] = {}


def train_lane(
    learner: Learner,
    episodes: Episodes,
    evaluate: Callable[[Policy], Columns],
    evaluation_steps: Mapping[int, Iterable[int]],
    num_steps: int,
    path: Path,
    tell: Tell,
    finish: Callable[[Policy], Mapping[str, Columns]] = lambda policy: {},
    note: Note = lambda step, what, numbers: None,
) -> None:
    """Train a lane from its checkpoint, or from the start, to its end; at `path` is then all that came of it.

    - `evaluate` gives rows for `evaluations` with a column `return`, whose mean decides which policy is best.
      `evaluation_steps` says after which updates, and as which steps; see `layout.evaluation_steps`.
    - `finish` gives further tables of the last policy.
    - `note` takes every evaluation, the episodes since, and the diagnostics of the latest update: the step;
      `evaluation`, `training` or `update`; and numbers, means where there are several, by name.

    When `tell` raises `KeyboardInterrupt` it saves and lets that pass.
    """
    due = [step for steps in evaluation_steps.values() for step in steps]
    lane = _Lane(learner, episodes, evaluate, due, path, tell, note)
    if path.exists():
        lane.restore()
    learner.learn(num_steps, lane.between)
    lane.finish(finish(learner.policy()))


def finished(path: Path) -> News | None:
    """What a lane told last, if it was trained to its end; `None` if not.

    **Raises:** `RunFolderError` naming a file that is damaged.
    """
    if not path.exists():
        return None
    arrays, about = load_arrays(path)
    if not about["done"]:
        return None
    evaluations = Log.of(arrays, "evaluations.").columns()
    steps = evaluations.pop("step")
    return News(
        int(steps[-1]), {name: column[steps == steps[-1]] for name, column in evaluations.items()}, True
    )


class _Lane:
    def __init__(
        self,
        learner: Learner,
        episodes: Episodes,
        evaluate: Callable[[Policy], Columns],
        due: list[int],
        path: Path,
        tell: Tell,
        note: Note,
    ):
        self._learner, self._episodes, self._evaluate = learner, episodes, evaluate
        self._due, self._path, self._tell, self._note = due, path, tell, note
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
        """Between two updates: evaluate what is due, save what is old, tell how far it is."""
        step = self._learner.num_steps
        if self._episodes.ended:
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
            self._tell(News(step, self._latest, False))
        except KeyboardInterrupt:
            self._save()
            raise

    def finish(self, tables: Mapping[str, Columns]) -> None:
        self._tables |= tables
        self._done = True
        self._save()
        self._tell(News(self._learner.num_steps, self._latest, True))

    def restore(self) -> None:
        arrays, about = load_arrays(self._path)
        try:
            self._learner.restore(_under("learner.", arrays))
            self._best = Policy.of(_under("best.", arrays), about["best"]) if about["best"] else None
        except (KeyError, RuntimeError) as error:
            raise RunFolderError(
                f"{self._path} is of another version of coachable or stable-baselines3: {error}; remove it"
            ) from None
        self._best_return = about["best_return"]
        self._due = self._due[about["num_evaluations"] :]
        self._episodes.log = Log.of(arrays, "episodes.")
        self._num_noted = self._episodes.log.num_rows
        self._episodes.num_steps = self._learner.num_steps
        self._evaluations = Log.of(arrays, "evaluations.")
        self._num_evaluations = about["num_evaluations"]

    def _evaluate_at(self, steps: list[int]) -> None:
        policy = self._learner.policy()
        self._latest = self._evaluate(policy)
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

    def _save(self) -> None:
        began = time.monotonic()
        last = self._learner.policy()
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
