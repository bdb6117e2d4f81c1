"""Run a study from a plan to a complete run folder; go on where it was left."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from itertools import accumulate, pairwise
from pathlib import Path

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache

from coachable.behaviours.behaviour import Behaviour
from coachable.experiments.compiled import Tasks, compile_programs
from coachable.experiments.lane_batch import SECONDS_BETWEEN_CHECKPOINTS, Group
from coachable.experiments.layout import group_widths, num_cores
from coachable.experiments.plan import Study, behaviour_of
from coachable.experiments.progress import Report, SetupStatus, Status, progress_display
from coachable.experiments.results import walk_baseline, write_logs, write_policies, write_trajectories
from coachable.experiments.run_folder.lock import locked
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.writer import RunFolder
from coachable.experiments.sb3_lane import require_sb3
from coachable.experiments.sb3_study import CompassLane, SB3Lane, train_with_sb3
from coachable.experiments.workers import take_turns

MOST_TIME_FOR_REFRESHING = 0.02
"""Share of the time that may go into keeping the tables of an unfinished run readable."""


def run_study(
    study: Study, out: str | Path, *, progress: bool = True, allow_different_layout: bool = False
) -> Run:
    """Train and test every lane of a study, or go on where an earlier call was stopped.

    However often it is stopped, and however (even with kill -9), the folder ends with the same bits in its
    tables and policies as without a stop, on one machine and with the same versions. A complete run is only
    checked. Lanes of stable-baselines3, too, go on from their last checkpoint, but begin an episode there, so
    that their bits differ; in `released-code` semantics shared evaluations are counted from there, too.

    **Arguments:** `out`, the run folder, made if need be; `progress`, whether to show how it goes on stderr;
    `allow_different_layout`, whether to go on under other versions or on another machine than the run was
    begun with.

    **Raises:** `RunFolderError` if the folder belongs to another plan, is damaged, or is being written by
    another process; `KeyboardInterrupt` after everything is saved.
    """
    out = Path(out)
    behaviour = behaviour_of(study)
    if study.trainer != "ppo":
        require_sb3(study.trainer, study.sb3)
    out.mkdir(parents=True, exist_ok=True)
    with locked(out), jax.enable_x64(False), _jax_as_it_was():
        folder = None
        if (out / "manifest.json").exists():
            folder = RunFolder.resume(Run.open(out), study, behaviour, allow_different_layout)
            if folder.manifest["status"] == "complete":
                folder.remove_checkpoints()
                return Run.open(out)
        set_up_jax()
        if folder is None:
            ours = study.trainer == "ppo"
            widths = group_widths(len(study.lanes), num_cores()) if ours else (1,) * len(study.lanes)
            reference, _ = walk_baseline(study, behaviour)
            folder = RunFolder.begin(out, study, behaviour, widths, baseline=reference)
        with progress_display(study.name) if progress else nullcontext(lambda status: None) as report:
            _train(study, behaviour, folder, report)
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
def _jax_as_it_was() -> Iterator[None]:
    """Whoever calls from a program of their own has their own settings of JAX again, and their own cache."""
    before = {name: jax.config.values[name] for name in _settings_of_jax()}
    try:
        yield
    finally:
        if before != {name: jax.config.values[name] for name in before}:
            for name, value in before.items():
                jax.config.update(name, value)
            compilation_cache.reset_cache()


Lanes = Sequence[Group] | Sequence[SB3Lane]
Train = Callable[[Callable[[], None]], None]
"""Trains and tests all lanes; calls what it is given every now and then."""


def _train(study: Study, behaviour: Behaviour, folder: RunFolder, report: Report) -> None:
    lanes: Lanes = []
    report(_status("compiling", study, lanes))
    lanes, train = (_ours if study.trainer == "ppo" else _of_sb3)(study, behaviour, folder)
    next_refresh = time.monotonic() + SECONDS_BETWEEN_CHECKPOINTS

    def watch() -> None:
        nonlocal next_refresh
        training = any(some.num_steps < study.total_steps for some in lanes)
        report(_status("training" if training else "testing", study, lanes))
        if (began := time.monotonic()) > next_refresh:
            write_logs(folder, lanes)
            folder.write_manifest()
            took = time.monotonic() - began
            next_refresh = time.monotonic() + max(
                SECONDS_BETWEEN_CHECKPOINTS, took / MOST_TIME_FOR_REFRESHING
            )

    try:
        report(_status("training", study, lanes))
        train(watch)
        report(_status("writing", study, lanes))
        write_logs(folder, lanes)
        write_policies(folder, lanes)
        write_trajectories(folder, walk_baseline(study, behaviour)[1], lanes)
        folder.complete()
    except BaseException:
        for some in lanes:
            some.save()
        folder.write_manifest("interrupted")
        write_logs(folder, lanes)
        raise


def _ours(study: Study, behaviour: Behaviour, folder: RunFolder) -> tuple[Sequence[Group], Train]:
    tasks = Tasks.of(study, behaviour)
    programs = compile_programs(study, tasks, folder.group_widths, num_cores())
    ends = accumulate(folder.group_widths, initial=0)
    groups = []
    for index, (start, end) in enumerate(pairwise(ends)):
        lanes = study.lanes[start:end]
        groups.append(Group(study, lanes, tasks, programs[len(lanes)], folder.checkpoint(index)))
    return groups, lambda watch: take_turns(groups, num_cores(), watch)


def _of_sb3(study: Study, behaviour: Behaviour, folder: RunFolder) -> tuple[Sequence[SB3Lane], Train]:
    lanes = [
        SB3Lane(CompassLane(study, behaviour, lane, folder.checkpoint(index)))
        for index, lane in enumerate(study.lanes)
    ]
    return lanes, lambda watch: train_with_sb3(lanes, watch)


def _status(doing: str, study: Study, groups: Lanes) -> Status:
    latest = [
        (lane.setup, group.latest, i)
        for group in groups
        if group.latest
        for i, lane in enumerate(group.lanes)
    ]
    setups = []
    for setup in study.setups:
        mine = [(columns, index) for name, columns, index in latest if name == setup.name]
        distances = [columns[study.distance][index] for columns, index in mine]
        setups.append(
            SetupStatus(
                name=setup.name,
                num_lanes=study.num_seeds,
                num_evaluated=len(mine),
                num_up=sum(not columns["fell"][index] for columns, index in mine),
                result=f"{np.mean(distances):.2f} m" if distances else "",
            )
        )
    return Status(
        doing=doing,
        steps=sum(group.num_steps * len(group.lanes) for group in groups),
        total_steps=study.total_steps * len(study.lanes),
        lanes_measured=sum(group.num_measured for group in groups),
        setups=tuple(setups),
    )
