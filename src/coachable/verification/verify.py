"""From walkers to passports: many at once, each program compiled once for all of them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import jax
import numpy as np

from coachable.envs.walking_task import Clock
from coachable.errors import MissingExtraError, RunFolderError
from coachable.plants.compass import START
from coachable.studies.files import write_atomic
from coachable.studies.layout import num_cores
from coachable.verification.adherence import adherence
from coachable.verification.basin import CHUNK, SET_NAMES, basin, draw_starts, label_starts
from coachable.verification.basin_picture import draw_slices, slices
from coachable.verification.counterexample_file import write_counterexamples
from coachable.verification.fall_search import require_cma
from coachable.verification.falsify import search_for_falls
from coachable.verification.followed import followed_svg
from coachable.verification.orbit import find_orbits
from coachable.verification.passport import (
    LEVELS,
    Certified,
    FallSearch,
    Level,
    Orbits,
    Passport,
    passport_path,
    read_passport,
    write_passport,
)
from coachable.verification.pushes import Pushes, pushes
from coachable.verification.section import in_double
from coachable.verification.stability import stabilities
from coachable.verification.subject import Subject
from coachable.verification.walk import Walk, settle, stacked

NUM_STARTS: dict[Level, int] = {"quick": 500, "full": 50_000}
"""Starts drawn from each of the two boxes."""

FALL_BUDGET = 1_000
"""Walks of each search for a fall."""

SECONDS_OF_A_PROOF = 300.0
"""After which no larger box is tried for a certificate."""

MEASURING = 0.3
"""Share of the work on a walker, as it is told, that comes before the attempt at a certificate."""

GROUP = 10
"""Walkers whose orbits are looked for side by side."""

_CLOCKS: tuple[Clock, ...] = ("free", "touchdown")
_GAIT_POINTS = 64
"""How many of the last touchdowns stand for a gait that starts are to reach."""


Tell = Callable[[str, float], None]
"""Told the name of a walker and how much of the work on it is done since the last time, in walkers."""


def verify(
    subjects: Sequence[Subject],
    level: Level,
    folder: Path | None,
    baseline: Subject | None = None,
    tell: Tell = lambda name, share: None,
    *,
    certify: bool = False,
) -> list[Passport]:
    """The passports of walkers, in their order; written into a folder as soon as each is made.

    Arguments: subjects, whose controllers are of one kind; level, how much is looked at; folder, where
    passports and their pictures go, if anywhere; baseline, who stands beside them in the table of pushes;
    certify, whether to try to prove that a box around the gait returns into itself, for five minutes at most.
    """
    if not subjects:
        return []
    if level == "full":
        require_cma()
    if certify:
        require_crival()
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    beside = _pushes_of(baseline) if baseline is not None and level == "full" else None
    width = min(GROUP, len(subjects))
    groups = [subjects[first : first + width] for first in range(0, len(subjects), width)]

    stopped = threading.Event()

    def tell_unless_stopped(name: str, share: float) -> None:
        if stopped.is_set():
            raise InterruptedError("the verification was stopped")
        tell(name, share)

    def work(group: Sequence[Subject]) -> list[Passport]:
        return _verify_group(group, width, level, folder, baseline, beside, tell_unless_stopped, certify)

    done = {0: work(groups[0])}  # alone, so that each program is compiled once
    with ThreadPoolExecutor(num_cores()) as pool:
        futures = {pool.submit(work, group): index for index, group in enumerate(groups[1:], start=1)}
        try:
            for future in as_completed(futures):
                done[futures[future]] = future.result()
        except BaseException:
            stopped.set()  # what is under way ends at its next chunk of starts
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [passport for index in range(len(groups)) for passport in done[index]]


def _verify_group(
    group: Sequence[Subject],
    width: int,
    level: Level,
    folder: Path | None,
    baseline: Subject | None,
    beside: Pushes | None,
    tell: Tell,
    certify: bool,
) -> list[Passport]:
    padded = [*group, *[group[-1]] * (width - len(group))]
    with jax.enable_x64(True):
        loops = stacked([in_double(subject.loop) for subject in padded])
        starts = np.tile(np.array(START), (width, 1))
        walks = {clock: settle(loops, starts, clock) for clock in _CLOCKS}
        found = {clock: find_orbits(loops, walks[clock], clock) for clock in _CLOCKS}
        stable = stabilities(loops, found["touchdown"])
    passports = []
    for lane, subject in enumerate(group):
        walk = walks[subject.walker.clock][lane]
        passport = Passport(
            walker=subject.walker,
            level=level,
            adherence=adherence(subject.behaviour, walk),
            orbits=Orbits(found["free"][lane], found["touchdown"][lane]),
            stability=stable[lane],
            basins=(),
            pushes=None,
            baseline=None if beside is None or baseline is None else baseline.walker.name,
            baseline_pushes=beside,
        )
        measuring = MEASURING if certify and passport.certifiable else 1.0
        passport = _with_disturbances(
            passport, subject, walk, folder, lambda name, share, part=measuring: tell(name, part * share)
        )
        if certify and passport.certifiable:
            passport = replace(passport, certificate=_certificate(passport, subject, folder, tell))
        if folder is not None:
            path = write_passport(folder, passport)
            picture = path.with_name(f"{path.stem}-automaton.svg")
            write_atomic(picture, followed_svg(subject.behaviour, passport.adherence))
        passports.append(passport)
    return passports


def _with_disturbances(
    passport: Passport, subject: Subject, walk: Walk, folder: Path | None, tell: Tell
) -> Passport:
    """The passport with what needs a gait to start from: basins and, at level full, slices and pushes."""
    name, level = subject.walker.name, passport.level
    if not passport.walks:
        tell(name, 1.0)
        return passport
    gait = walk.section[-_GAIT_POINTS:]
    loop, clock = subject.loop, subject.walker.clock
    planes = slices(gait[-1]) if level == "full" and folder is not None else ()
    chunks = sum(-(-len(plane.starts) // CHUNK) for plane in planes)
    chunks += len(SET_NAMES) * -(-NUM_STARTS[level] // CHUNK)

    def each() -> None:
        tell(name, 1 / chunks)

    found = tuple(
        basin(starts, label_starts(loop, clock, gait, draw_starts(starts, NUM_STARTS[level]), each))
        for starts in SET_NAMES
    )
    if folder is not None and planes:
        labelled = [(plane, label_starts(loop, clock, gait, plane.starts, each)) for plane in planes]
        draw_slices(folder / f"{name}-basin.png", name, gait, labelled)
    if level == "quick":
        return replace(passport, basins=found)
    falls = _falls(subject, gait[-1], folder) if subject.walker.semantics == "paper" else ()
    return replace(passport, basins=found, pushes=pushes(loop, clock, gait[-1]), falls=falls)


def _certificate(passport: Passport, subject: Subject, folder: Path | None, tell: Tell) -> Certified:
    """Try to prove that a box around the gait returns into itself; a certificate is written."""
    from coachable.verification.certificate.file import write_certificate
    from coachable.verification.certificate.proposal import propose

    walker, told = passport.walker, 0.0

    def progress(gone: float) -> None:
        nonlocal told
        tell(walker.name, (1 - MEASURING) * (gone - told))
        told = gone

    about = {
        "walker": walker.name,
        "run": None if walker.setup is None or folder is None else folder.resolve().parent.name,
        "policy_sha256": walker.policy_sha256,
    }
    proposal = propose(
        subject.loop, passport.orbits.touchdown, about, seconds=SECONDS_OF_A_PROOF, progress=progress
    )
    progress(1.0)
    path = None
    if proposal.certificate is not None and folder is not None:
        path = _run_of(folder) / "certificates" / f"{walker.name}.json"
        path.parent.mkdir(exist_ok=True)
        write_certificate(path, proposal.certificate)
    verdict = proposal.verdict
    return Certified(
        proven=proposal.certificate is not None,
        radius=proposal.radius,
        reach=float("nan") if verdict is None else float(max(verdict.reach)),
        strides=passport.orbits.touchdown.num_steps,
        reason=verdict.reason if verdict is not None and verdict.proven else proposal.obstacle,
        file=None if path is None else path.name,
    )


def _run_of(folder: Path) -> Path:
    """Where what lies beside the passports goes: the run's folder, if they are in it."""
    return folder.parent if folder.name == "passports" else folder


def require_crival() -> None:
    """**Raises:** `MissingExtraError` without the interval arithmetic of the [verify] extra."""
    if find_spec("ival") is None:
        raise MissingExtraError("a certificate", "verify")


def _falls(subject: Subject, gait: np.ndarray, folder: Path | None) -> tuple[FallSearch, ...]:
    """The searches for falls; counterexamples are written beside the folder of the passports."""
    parameters = subject.plant.parameters
    found = search_for_falls(
        subject.controller,
        gait.tolist(),
        parameters=parameters,
        clock=subject.walker.clock,
        budget=FALL_BUDGET,
    )
    if folder is not None:
        name, behaviour = subject.walker.name, subject.behaviour
        write_counterexamples(_run_of(folder), name, found, parameters, behaviour)
    return tuple(
        FallSearch(
            within=one.perturbation.sentence,
            seconds=one.seconds,
            walks=FALL_BUDGET,
            first_fall=one.searches[0].first_fall,
            first_fall_at_random=one.searches[1].first_fall,
            least_margin=min(float(search.least_margin) for search in one.searches),
            confirmed=len(one.counterexamples),
            unconfirmed=len(one.unconfirmed),
        )
        for one in found
    )


def _pushes_of(subject: Subject) -> Pushes | None:
    """What the baseline takes, if it walks."""
    with jax.enable_x64(True):
        clock = subject.walker.clock
        walk = settle(stacked([in_double(subject.loop)]), np.array([START]), clock)[0]
    if not walk.up or not len(walk.section):
        return None
    return pushes(subject.loop, clock, walk.section[-1])


def kept_passport(folder: Path, subject: Subject, level: Level, certify: bool = False) -> Passport | None:
    """The walker's passport if it is in the folder, readable, and of the same policy, and tells no less."""
    path = passport_path(folder, subject.walker.name)
    if not path.exists():
        return None
    try:
        passport = read_passport(path)
    except RunFolderError:
        return None  # it is made anew
    enough = LEVELS.index(passport.level) >= LEVELS.index(level)
    enough &= not certify or passport.certificate is not None or not passport.certifiable
    return passport if enough and passport.walker == subject.walker else None
