"""Run a training from a plan to a complete run folder; go on where it was left."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from coachable.behaviours.library import load_behaviour
from coachable.experiments.lane_processes import News, run_lanes
from coachable.experiments.layout import num_cores
from coachable.experiments.progress import Report, SetupStatus, Status, progress_display
from coachable.experiments.results import write_policy
from coachable.experiments.run_folder.lock import locked
from coachable.experiments.run_folder.reader import TrainingRun
from coachable.experiments.run_folder.schemas import TRAINING_SCHEMAS
from coachable.experiments.run_folder.writer import RunFolder
from coachable.experiments.sb3_lane import MOST_TIME_FOR_SAVING, load_lane, require_sb3
from coachable.experiments.training import Training
from coachable.experiments.training_lane import TrainingLane, require_trainable, with_share
from coachable.foundation.errors import MissingExtraError, PlanError
from coachable.foundation.tables import table_of

SECONDS_BETWEEN_TABLES = 60.0


def run_training(
    training: Training,
    out: str | Path,
    *,
    track: bool = False,
    progress: bool = True,
    workers: int | None = None,
    allow_different_layout: bool = False,
) -> TrainingRun:
    """Train every lane of a training, or go on where an earlier call was stopped.

    Lanes are trained side by side, one a core. Each goes on from its last checkpoint, where it begins an
    episode; so a lane that was stopped does not end with the bits of one that was not.

    **Arguments:** `out`, the run folder, made if need be; `track`, whether to write events for TensorBoard
    into it; `progress`, whether to show how it goes on stderr; `workers`, how many lanes at once.

    **Raises:** `PlanError` for an environment or settings that cannot be trained with, `MissingExtraError`,
    and `RunFolderError` if the folder belongs to another plan, is damaged, or is being written by another
    process; `KeyboardInterrupt` after everything is saved.
    """
    if workers is not None and workers < 1:
        raise PlanError(f"workers must be at least 1, got {workers}")
    require_sb3(training.trainer, training.sb3)
    if track and find_spec("tensorboardX") is None:
        raise MissingExtraError("--track tensorboard", "track")
    behaviour = load_behaviour(training.behaviour)
    require_trainable(training, behaviour)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    with locked(out):
        if (out / "manifest.json").exists():
            folder = RunFolder.resume(TrainingRun.open(out), training, behaviour, allow_different_layout)
            if folder.manifest["status"] == "complete":
                folder.remove_checkpoints()
                return TrainingRun.open(out)
        else:
            widths = (1,) * len(training.lanes)
            folder = RunFolder.begin(out, training, behaviour, widths, env=training.env)
        works = [
            TrainingLane(
                training,
                behaviour,
                lane,
                folder.checkpoint(index),
                out / "tensorboard" / lane.name if track else None,
            )
            for index, lane in enumerate(training.lanes)
        ]
        with progress_display(training.name) if progress else nullcontext(lambda status: None) as report:
            _train(training, folder, works, report, workers or num_cores())
    return TrainingRun.open(out)


def _train(
    training: Training, folder: RunFolder, works: Sequence[TrainingLane], report: Report, workers: int
) -> None:
    news: dict[int, News] = {}
    next_tables = time.monotonic() + SECONDS_BETWEEN_TABLES

    def watch() -> None:
        nonlocal next_tables
        report(_status("training", training, news))
        if (began := time.monotonic()) > next_tables:
            _write_tables(folder, works)
            folder.write_manifest()
            took = time.monotonic() - began  # long where checkpoints hold replay buffers
            next_tables = began + took + max(SECONDS_BETWEEN_TABLES, took / MOST_TIME_FOR_SAVING)

    try:
        run_lanes(works, workers, news.__setitem__, watch)
        report(_status("writing", training, news))
        _write_tables(folder, works)
        for work in works:
            for which, policy in load_lane(work.path)[1].items():
                write_policy(folder, work.lane, which, policy)
        folder.complete(TRAINING_SCHEMAS)
    except BaseException:
        folder.write_manifest("interrupted")
        _write_tables(folder, works)
        raise


def _write_tables(folder: RunFolder, works: Sequence[TrainingLane]) -> None:
    there = [(work.name, load_lane(work.path)[0]) for work in works if work.path.exists()]
    for name, schema in TRAINING_SCHEMAS.items():
        parts = []
        for lane, tables in there:
            if columns := tables[name]:
                columns = with_share(columns) if "in_cycle" in columns else columns
                parts.append(columns | {"lane": np.full(len(columns["return"]), lane)})
        columns = {c: np.concatenate([part[c] for part in parts]) if parts else [] for c in schema.names}
        folder.write_table(name, table_of(schema, columns))


def _status(doing: str, training: Training, news: dict[int, News]) -> Status:
    setups = []
    for setup in training.setups:
        mine = [
            told.latest
            for index, told in news.items()
            if training.lanes[index].setup == setup.name and told.latest
        ]
        results = [np.mean(latest["return"]) for latest in mine]
        shares = [np.mean(latest["share_in_cycle"]) for latest in mine]
        setups.append(
            SetupStatus(
                name=setup.name,
                num_lanes=training.num_seeds,
                num_evaluated=len(mine),
                num_up=sum(not latest["fell"].any() for latest in mine),
                result=f"return {np.mean(results):.0f}, {np.mean(shares):.0%} in the cycle" if mine else "",
            )
        )
    return Status(
        doing=doing,
        steps=sum(told.steps for told in news.values()),
        total_steps=training.total_steps * len(training.lanes),
        lanes_measured=sum(told.done for told in news.values()),
        setups=tuple(setups),
    )
