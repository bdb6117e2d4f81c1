"""Run an experiment from its plan to a complete run folder; go on where it was left."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from pathlib import Path

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache

from coachable.envs.problem import PlantProblem
from coachable.experiments.experiment import Experiment
from coachable.experiments.layout import num_cores
from coachable.experiments.log import Columns
from coachable.experiments.progress import Report, SetupStatus, Status, progress_display
from coachable.experiments.results import roll_out_baseline, write_logs, write_policies, write_trajectories
from coachable.experiments.run_folder.lock import locked
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import schemas
from coachable.experiments.run_folder.writer import RunFolder
from coachable.experiments.trainers.trainer import TrainedLanes, Work
from coachable.foundation.data import whole_number
from coachable.foundation.errors import MissingExtraError, PlanError
from coachable.foundation.stopping import Interruptible

SECONDS_BETWEEN_TABLES = 30.0
MOST_TIME_FOR_TABLES = 0.02
"""Share of the time that may go into keeping the tables of an unfinished run readable."""


def run_experiment(
    experiment: Experiment,
    out: str | Path,
    *,
    track: bool = False,
    progress: bool = True,
    workers: int | None = None,
    allow_different_layout: bool = False,
) -> Run:
    """Train and measure every lane of an experiment, or go on where an earlier call was stopped.

    However often it is stopped, and however (even with kill -9), a run of our PPO ends with the same bits in
    its tables and policies as without a stop, on one machine and with the same versions. Lanes of other
    trainers go on from their last checkpoint, but begin an episode there, so that their bits differ; in
    `released-code` semantics shared evaluations are counted from there, too. A complete run is only checked.

    **Arguments:** `out`, the run folder, made if need be; `track`, whether to write events for TensorBoard
    into it; `progress`, whether to show progress on stderr; `workers`, how many lanes, or batches of them,
    are trained at once, by default one a core; `allow_different_layout`, whether to go on under other
    versions or on another machine than the run was begun with.

    **Raises:** `PlanError` for an environment or settings that cannot be trained with, `MissingExtraError`,
    and `RunFolderError` if the folder belongs to another plan, is damaged, or is being written by another
    process; `KeyboardInterrupt` after everything is saved.
    """
    if workers is not None:
        workers = whole_number(workers, "workers", PlanError, 1, 1_000)
    if track and find_spec("tensorboardX") is None:
        raise MissingExtraError("--track tensorboard", "track")
    evaluations = len(experiment.lanes) * (experiment.steps // experiment.evaluate_every)
    whole_number(evaluations * experiment.evaluation_episodes, "episodes of evaluations", PlanError, 0, 10**8)
    trainer, workers = experiment.trainer, workers or num_cores()
    trainer.check(experiment)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    with locked(out), jax.enable_x64(False), _jax_restored():
        folder = None
        if (out / "manifest.json").exists():
            folder = RunFolder.resume(Run.open(out), experiment, allow_different_layout)
            if folder.manifest["status"] == "complete":
                folder.remove_checkpoints()
                return Run.open(out)
        set_up_jax()
        if folder is None:
            baseline = roll_out_baseline(experiment)
            sizes = trainer.batch_sizes(experiment, workers)
            folder = RunFolder.begin(out, experiment, sizes, None if baseline is None else baseline[0])
        work = Work(
            experiment=experiment,
            folder=folder,
            num_workers=workers,
            track=out / "tensorboard" if track else None,
        )
        with progress_display(experiment.name) if progress else nullcontext(lambda status: None) as report:
            _train(work, report)
    return Run.open(out)


def _settings_of_jax() -> dict[str, str | float | bool]:
    """Keep compiled programs between runs, and let each one run in the thread that calls it."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "coachable" / "jax"
    return {
        "jax_compilation_cache_dir": str(cache),
        "jax_persistent_cache_min_compile_time_secs": 0.2,
        "jax_cpu_enable_async_dispatch": False,
    }


def set_up_jax() -> None:
    """Set JAX, for the whole process, so that programs stay compiled and threads are kept apart."""
    for name, value in _settings_of_jax().items():
        jax.config.update(name, value)


@contextmanager
def _jax_restored() -> Iterator[None]:
    """A caller's own settings of JAX, and its own cache, are restored."""
    before = {name: jax.config.values[name] for name in _settings_of_jax()}
    try:
        yield
    finally:
        if before != {name: jax.config.values[name] for name in before}:
            for name, value in before.items():
                jax.config.update(name, value)
            compilation_cache.reset_cache()


def _train(work: Work, report: Report) -> None:
    experiment, folder = work.experiment, work.folder
    lanes: Sequence[TrainedLanes] = []
    report(_status("compiling" if experiment.problem.in_jax else "starting", experiment, lanes))
    lanes, train = experiment.trainer.start(work)
    next_tables = time.monotonic() + SECONDS_BETWEEN_TABLES

    def watch() -> None:
        nonlocal next_tables
        training = any(some.num_steps < experiment.total_steps for some in lanes)
        report(_status("training" if training else "testing", experiment, lanes))
        if (began := time.monotonic()) > next_tables:
            write_logs(folder, experiment, lanes)
            folder.write_manifest()
            took = time.monotonic() - began  # long where checkpoints hold replay buffers
            next_tables = began + took + max(SECONDS_BETWEEN_TABLES, took / MOST_TIME_FOR_TABLES)

    with Interruptible():
        try:
            report(_status("training", experiment, lanes))
            train(watch)
            report(_status("writing", experiment, lanes))
            write_logs(folder, experiment, lanes)
            write_policies(folder, lanes)
            write_trajectories(folder, experiment, lanes)
            folder.complete(schemas(experiment))
        except BaseException:
            for some in lanes:
                some.save()
            folder.write_manifest("interrupted")
            write_logs(folder, experiment, lanes)
            raise


def _status(doing: str, experiment: Experiment, lanes: Sequence[TrainedLanes]) -> Status:
    latest = {lane: columns for some in lanes for lane, columns in some.latest().items()}
    setups = []
    for name in experiment.setup_names:
        mine = [columns for lane, columns in latest.items() if lane.setup == name]
        setups.append(
            SetupStatus(
                name=name,
                num_lanes=experiment.num_seeds,
                num_evaluated=len(mine),
                num_up=sum(not columns["fell"].any() for columns in mine),
                result=_result(experiment, mine) if mine else "",
            )
        )
    return Status(
        doing=doing,
        steps=sum(some.num_steps * len(some.lanes) for some in lanes),
        total_steps=experiment.total_steps * len(experiment.lanes),
        lanes_measured=sum(some.num_measured for some in lanes),
        setups=tuple(setups),
    )


def _result(experiment: Experiment, evaluations: Sequence[Columns]) -> str:
    """What the lanes of a setup reached in the mean, with its unit."""
    means = {
        name: np.mean([np.mean(columns[name]) for columns in evaluations])
        for name in (_distance(experiment), "return", "share_in_cycle")
        if name
    }
    if name := _distance(experiment):
        return f"{means[name]:.2f} m"
    return f"return {means['return']:.0f}, {means['share_in_cycle']:.0%} in the cycle"


def _distance(experiment: Experiment) -> str:
    problem = experiment.problem
    return problem.distance if isinstance(problem, PlantProblem) else ""
