"""From closed loops to passports: many at once, each program compiled once for all of them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import jax
import numpy as np

from coachable.behaviours.behaviour import Behaviour
from coachable.experiments.layout import num_cores
from coachable.foundation.errors import ParameterError, RunFolderError
from coachable.foundation.files import make_folder, write_atomic
from coachable.plants.plant import Plant
from coachable.plants.sampled import Clock
from coachable.verification.falsification.fall_search import require_cma
from coachable.verification.gait.adherence import adherence
from coachable.verification.gait.closed_loop import in_double, stacked
from coachable.verification.gait.followed_automaton import followed_svg
from coachable.verification.gait.orbit import find_orbits
from coachable.verification.gait.stability import stabilities
from coachable.verification.gait.walk import SampledWalk, settle
from coachable.verification.passport.attempts import (
    certificate,
    certificate_path,
    falls,
    no_certificate,
    not_certified,
    require_crival,
)
from coachable.verification.passport.closed_loop import EpisodeSubject, Subject
from coachable.verification.passport.episodes import episode_passport
from coachable.verification.passport.passport import (
    LEVELS,
    Level,
    Orbits,
    Passport,
    passport_path,
    read_passport,
    write_passport,
)
from coachable.verification.passport.why_no_certificate import obstacles
from coachable.verification.robustness.basin import CHUNK, basin, draw_starts, label_starts, set_names
from coachable.verification.robustness.basin_picture import draw_slices, slices
from coachable.verification.robustness.pushes import Pushes, pushes

NUM_STARTS: dict[Level, int] = {"quick": 500, "full": 50_000}
"""Starts drawn from each of the two boxes."""

MEASURING = 0.3
"""Share of the work on a walker, as it is reported, that comes before the attempt at a certificate."""

GROUP = 10
"""Walkers whose orbits are looked for side by side."""

_CLOCKS: tuple[Clock, ...] = ("free", "touchdown")
_GAIT_POINTS = 64
"""How many of the last touchdowns stand for a gait that starts are to reach."""

ProgressCallback = Callable[[str, float], None]
"""Called with the name of a walker and the share of the work on it that was done since the last call."""


def verify(
    subjects: Sequence[Subject | EpisodeSubject],
    level: Level,
    folder: Path | None,
    baseline: Subject | None = None,
    progress: ProgressCallback = lambda name, share: None,
    *,
    certify: bool = False,
) -> list[Passport]:
    """The passports of walkers, in their order; written into a folder as soon as each is made.

    Arguments: subjects, of one plant class, or of one run in a Gymnasium environment; level, how much is
    measured; folder, where passports and their pictures go, if anywhere; baseline, what stands beside them in
    the table of pushes; certify, whether to try to prove that a box around the gait returns into itself, for
    five minutes at most.

    **Raises:** `MissingExtraError` for what needs the [verify] extra without it; `ParameterError` for a plant
    without coordinates on its touchdown section.
    """
    if not subjects:
        return []
    plants = [subject for subject in subjects if isinstance(subject, Subject)]
    for subject in plants:
        _check_section(subject.plant)
    if level == "full":
        require_cma()
    if certify and plants:
        require_crival()
    if folder is not None:
        folder.parent.mkdir(parents=True, exist_ok=True)
        make_folder(folder.parent, folder.name)
    made = _verify_plants(plants, level, folder, baseline, progress, certify=certify)
    for subject in subjects:
        if isinstance(subject, EpisodeSubject):
            advance = partial(progress, subject.walker.name)
            passport = episode_passport(subject, level, folder, advance, certify=certify)
            made.append(_written(passport, folder, subject.behaviour))
    return made


def _verify_plants(
    subjects: Sequence[Subject],
    level: Level,
    folder: Path | None,
    baseline: Subject | None,
    progress: ProgressCallback,
    *,
    certify: bool,
) -> list[Passport]:
    if not subjects:
        return []
    beside = _pushes_of(baseline) if baseline is not None and level == "full" else None
    kinds = _by_kind(subjects)
    width = min(GROUP, max(map(len, kinds)))
    groups = [kind[first : first + width] for kind in kinds for first in range(0, len(kind), width)]
    stopped = threading.Event()

    def unless_stopped(name: str, share: float) -> None:
        if stopped.is_set():
            raise InterruptedError("the verification was stopped")
        progress(name, share)

    job = _Job(
        width=width,
        level=level,
        folder=folder,
        baseline=None if beside is None or baseline is None else baseline.walker.name,
        beside=beside,
        progress=unless_stopped,
        drawing=threading.Lock(),
        certify=certify,
    )
    done = {0: _verify_group(groups[0], job)}  # alone, so that each program is compiled once
    with ThreadPoolExecutor(num_cores()) as pool:
        futures = {
            pool.submit(_verify_group, group, job): index for index, group in enumerate(groups[1:], start=1)
        }
        try:
            for future in as_completed(futures):
                done[futures[future]] = future.result()
        except BaseException:
            stopped.set()  # what is under way ends at its next chunk of starts
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    made = {
        subject: passport
        for index, group in enumerate(groups)
        for subject, passport in zip(group, done[index], strict=True)
    }
    return [made[subject] for subject in subjects]


def _by_kind(subjects: Sequence[Subject]) -> list[list[Subject]]:
    """The subjects whose closed loops can be stacked, together: controllers of one shape and one memory."""
    kinds: dict[object, list[Subject]] = {}
    for subject in subjects:
        leaves, structure = jax.tree.flatten(subject.loop)
        kinds.setdefault((structure, tuple(map(np.shape, leaves))), []).append(subject)
    return list(kinds.values())


def _check_section(plant: Plant) -> None:
    if not plant.section_names:
        raise ParameterError(
            f"{plant.name} gives no coordinates on its touchdown section, so no orbit of it can be "
            "looked for; give it section_names, to_section and from_section"
        )


@dataclass(frozen=True, eq=False)
class _Job:
    """What all groups of one verification have in common."""

    width: int
    """How many walkers the programs are compiled for."""
    level: Level
    folder: Path | None
    baseline: str | None
    beside: Pushes | None
    """What the baseline withstands."""
    progress: ProgressCallback
    drawing: threading.Lock
    """Matplotlib's settings are one for all threads."""
    certify: bool


def _verify_group(group: Sequence[Subject], job: _Job) -> list[Passport]:
    padded = [*group, *[group[-1]] * (job.width - len(group))]
    with jax.enable_x64(True):
        loops = stacked([in_double(subject.loop) for subject in padded])
        starts = np.array([subject.plant.start for subject in padded])
        walks = {clock: settle(loops, starts, clock) for clock in _CLOCKS}
        found = {clock: find_orbits(loops, walks[clock], clock) for clock in _CLOCKS}
        stable = stabilities(loops, found["touchdown"])
        why_not = [""] * job.width
        if job.certify:
            why_not = obstacles(loops, walks["touchdown"], found["touchdown"], stable)
    passports = []
    for lane, subject in enumerate(group):
        walk = walks[subject.walker.clock][lane]
        passport = Passport(
            walker=subject.walker,
            level=job.level,
            adherence=adherence(subject.behaviour, subject.plant, walk),
            orbits=Orbits(found["free"][lane], found["touchdown"][lane]),
            stability=stable[lane],
            basins=(),
            pushes=None,
            baseline=job.baseline,
            baseline_pushes=job.beside,
        )
        measuring = MEASURING if job.certify and passport.certifiable else 1.0
        passport = _with_disturbances(passport, subject, walk, job, measuring)
        if job.certify and passport.certifiable:
            passport = _with_certificate(passport, subject, job)
        elif job.certify:
            passport = replace(passport, certificate=no_certificate(subject.walker, why_not[lane]))
        passports.append(_written(passport, job.folder, subject.behaviour))
    return passports


def _written(passport: Passport, folder: Path | None, behaviour: Behaviour) -> Passport:
    """The passport, once it and the picture of its automaton are in the folder."""
    if folder is not None:
        path = write_passport(folder, passport)
        picture = path.with_name(f"{path.stem}-automaton.svg")
        write_atomic(picture, followed_svg(behaviour, passport.adherence))
    return passport


def _with_certificate(passport: Passport, subject: Subject, job: _Job) -> Passport:
    def progress(share: float) -> None:
        job.progress(subject.walker.name, (1 - MEASURING) * share)

    return replace(passport, certificate=certificate(passport, subject, job.folder, progress))


def _with_disturbances(
    passport: Passport, subject: Subject, walk: SampledWalk, job: _Job, share: float
) -> Passport:
    """The passport with what needs a gait to start from: basins and, at level full, slices, pushes, falls.

    It is reported as this share of the work on the walker.
    """
    name, level, folder = subject.walker.name, job.level, job.folder
    if not passport.walks:
        job.progress(name, share)
        return passport
    gait = walk.section[-_GAIT_POINTS:]
    loop, clock, plant = subject.loop, subject.walker.clock, subject.plant
    planes = slices(plant, gait[-1]) if level == "full" and folder is not None else ()
    sets = set_names(plant)
    chunks = sum(-(-len(plane.starts) // CHUNK) for plane in planes)
    chunks += len(sets) * -(-NUM_STARTS[level] // CHUNK)

    def each() -> None:
        job.progress(name, share / max(chunks, 1))

    found = tuple(
        basin(starts, label_starts(loop, clock, gait, draw_starts(plant, starts, NUM_STARTS[level]), each))
        for starts in sets
    )
    if folder is not None and planes:
        labelled = [(plane, label_starts(loop, clock, gait, plane.starts, each)) for plane in planes]
        with job.drawing:
            draw_slices(folder / f"{name}-basin.png", name, plant, gait, labelled)
    if level == "quick":
        return replace(passport, basins=found)
    searchable = subject.walker.semantics == "paper" and plant.restated() is not None
    fallen = falls(subject, gait[-1], folder) if searchable else ()
    return replace(passport, basins=found, pushes=pushes(loop, clock, gait[-1]), falls=fallen)


def _pushes_of(subject: Subject) -> Pushes | None:
    """What the baseline withstands, if it walks."""
    with jax.enable_x64(True):
        clock = subject.walker.clock
        walk = settle(stacked([in_double(subject.loop)]), np.array([subject.plant.start]), clock)[0]
    if not walk.up or not len(walk.section):
        return None
    return pushes(subject.loop, clock, walk.section[-1])


def kept_passport(
    folder: Path, subject: Subject | EpisodeSubject, level: Level, certify: bool = False
) -> Passport | None:
    """The walker's passport if it is in the folder, readable, of the same policy and as complete.

    A proof that it claims is proven anew by the checker. Without the interval arithmetic for that, the
    passport is returned without the proof; where there is none, it is not returned.
    """
    path = passport_path(folder, subject.walker.name)
    if not path.exists():
        return None
    try:
        passport = read_passport(path)
    except RunFolderError:
        return None  # it is made anew
    enough = LEVELS.index(passport.level) >= LEVELS.index(level)
    enough &= not certify or passport.certificate is not None
    if not enough or passport.walker != subject.walker:
        return None
    claimed = passport.certificate is not None and passport.certificate.proven
    if not claimed:
        return passport
    if find_spec("ival") is None:
        reason = "its file claims a proof, which was not re-checked: that needs the [verify] extra"
        return replace(passport, certificate=not_certified(reason))
    return passport if isinstance(subject, Subject) and _proven_anew(folder, subject) else None


def _proven_anew(folder: Path, subject: Subject) -> bool:
    from coachable.verification.certificate.file import recheck

    try:
        return recheck(certificate_path(folder, subject.walker.name), subject.loop).proven
    except (RunFolderError, ParameterError):
        return False
