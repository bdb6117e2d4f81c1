"""What stands behind a passport in files of its own: counterexamples and certificates."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from coachable.foundation.errors import MissingExtraError, ParameterError
from coachable.foundation.files import make_folder
from coachable.verification.falsification.counterexample_file import write_counterexamples
from coachable.verification.falsification.episode_counterexample import write_episode_counterexamples
from coachable.verification.falsification.episode_falls import (
    EpisodeFalsification,
    search_for_falls_in_episodes,
)
from coachable.verification.falsification.falsify import Falsification, search_for_falls
from coachable.verification.passport.closed_loop import EpisodeSubject, Subject
from coachable.verification.passport.passport import Certified, FallSearch, Passport, Walker

FALL_BUDGET = 1_000
"""Walks of each search for a fall."""

EPISODE_BUDGET = 100
"""Episodes of each search for a fall in a Gymnasium environment, which are walked one after another."""

SECONDS_OF_A_PROOF = 300.0
"""After which no larger box is tried for a certificate."""


def falls(subject: Subject, gait: np.ndarray, folder: Path | None) -> tuple[FallSearch, ...]:
    """Search for falls around a point of the section; counterexamples are written beside the passports."""
    plant = subject.plant
    found = search_for_falls(
        plant,
        subject.controller,
        gait.tolist(),
        clock=subject.walker.clock,
        budget=FALL_BUDGET,
    )
    if folder is not None:
        write_counterexamples(run_of(folder), subject.walker.name, found, plant, subject.behaviour)
    return tuple(_fall_search(one.perturbation.sentence(plant), one) for one in found)


def falls_in_episodes(
    subject: EpisodeSubject, episode: int, folder: Path | None, progress: Callable[[float], None]
) -> tuple[FallSearch, ...]:
    """Search for falls from a start of the evaluations; counterexamples are written beside the passports."""
    found = search_for_falls_in_episodes(subject.loop, episode, budget=EPISODE_BUDGET, progress=progress)
    if folder is not None:
        write_episode_counterexamples(
            run_of(folder), subject.walker.name, subject.run, subject.lane, subject.which, found
        )
    return tuple(_fall_search(one.perturbation.sentence, one) for one in found)


def _fall_search(within: str, found: Falsification | EpisodeFalsification) -> FallSearch:
    return FallSearch(
        within=within,
        seconds=found.seconds,
        walks=found.searches[0].walks,
        first_fall=found.searches[0].first_fall,
        first_fall_at_random=found.searches[1].first_fall,
        least_margin=min(float(search.least_margin) for search in found.searches),
        confirmed=len(found.counterexamples),
        unconfirmed=len(found.unconfirmed),
    )


def certificate(
    passport: Passport, subject: Subject, folder: Path | None, progress: Callable[[float], None]
) -> Certified:
    """Try to prove that a box around the gait returns into itself; a certificate is written.

    `progress` is called, time and again, with the share of the time that was used since.
    """
    # Interval arithmetic is an extra, and passports do without it.
    from coachable.verification.certificate.file import write_certificate
    from coachable.verification.certificate.proposal import propose

    walker, reported = passport.walker, 0.0

    def used(share: float) -> None:
        nonlocal reported
        progress(share - reported)
        reported = share

    about = {
        "walker": walker.name,
        "run": None if walker.setup is None or folder is None else run_of(folder.resolve()).name,
        "policy_sha256": walker.policy_sha256,
    }
    assert passport.orbits is not None, "only a gait can be certified"
    orbit = passport.orbits.touchdown
    try:
        proposal = propose(subject.loop, orbit, about, seconds=SECONDS_OF_A_PROOF, progress=used)
    except ParameterError as error:
        used(1.0)
        return not_certified(f"not tried: {error}")
    used(1.0)
    path = None
    if proposal.certificate is not None and folder is not None:
        make_folder(run_of(folder), "certificates")
        path = certificate_path(folder, walker.name)
        write_certificate(path, proposal.certificate)
    verdict = proposal.verdict
    return Certified(
        proven=proposal.certificate is not None,
        radius=proposal.radius,
        reach=float("nan") if verdict is None else float(max(verdict.reach)),
        strides=orbit.num_steps if proposal.certificate is None else int(proposal.certificate["strides"]),
        reason=verdict.reason if verdict is not None and verdict.proven else proposal.obstacle,
        file=None if path is None else path.name,
    )


def certificate_path(folder: Path, name: str) -> Path:
    """Where the certificate of a walker lies whose passport is in a folder."""
    return run_of(folder) / "certificates" / f"{name}.json"


def no_certificate(walker: Walker, obstacle: str) -> Certified:
    """That no proof was tried, and why: what keeps the walker from a stable gait, if anything does."""
    if obstacle:
        return not_certified(f"not tried: with the clock that restarts at touchdown {obstacle}")
    if walker.memory:
        return not_certified("not tried: the controller has a memory, and certificates are of state feedback")
    return not_certified("not tried: certificates are for the semantics `paper`")


def not_certified(reason: str) -> Certified:
    """That there is no proof, and why."""
    return Certified(False, 0.0, float("nan"), 0, reason, None)


def run_of(folder: Path) -> Path:
    """Where what lies beside the passports goes: the run's folder, if they are in it."""
    return folder.parent if folder.name == "passports" else folder


def require_crival() -> None:
    """**Raises:** `MissingExtraError` without the interval arithmetic of the [verify] extra."""
    if find_spec("ival") is None:
        raise MissingExtraError("a certificate", "verify")
