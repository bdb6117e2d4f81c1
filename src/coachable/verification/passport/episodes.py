"""The passport of a policy in a Gymnasium environment: all that can be measured without its physics."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from coachable.experiments.recorded_episodes import recorded_walk
from coachable.verification.gait.adherence import adherence_in_episodes
from coachable.verification.gait.walk import SETTLING_SECONDS
from coachable.verification.passport.attempts import falls_in_episodes, not_certified
from coachable.verification.passport.closed_loop import EpisodeSubject
from coachable.verification.passport.passport import FallSearch, Level, Passport
from coachable.verification.robustness.episode_pushes import episode_pushes
from coachable.verification.robustness.pushes import Pushes

NUM_EPISODES = 10
"""Episodes in which adherence is measured, each from another start of the evaluations."""

_WATCHING, _PUSHING = 0.05, 0.35
"""Shares of the work at level full that are adherence and pushes; the rest is the search for falls."""


def episode_passport(
    subject: EpisodeSubject,
    level: Level,
    folder: Path | None,
    progress: Callable[[float], None],
    *,
    certify: bool,
) -> Passport:
    """Measure adherence and, at level full, pushes and the search for falls.

    The search begins at the first start from which the undisturbed robot stays up; where it always falls,
    there is nothing to disturb.

    **Arguments:** as in `verify`, but `progress` takes the share of the work alone.

    **Raises:** `MissingExtraError` if the environment needs an extra that is missing, `ParameterError` if
    neither the plan nor the environment says how long a step lasts.
    """
    share = _WATCHING if level == "full" else 1.0
    walks = []
    for episode in range(NUM_EPISODES):
        walks.append(
            recorded_walk(
                subject.run, subject.lane.setup, subject.lane.seed, subject.which, episode, SETTLING_SECONDS
            )
        )
        progress(share / NUM_EPISODES)
    up = [episode for episode, walk in enumerate(walks) if not walk.fell]
    pushes: Pushes | None = None
    falls: tuple[FallSearch, ...] = ()
    if level == "full" and up:
        loop = subject.loop()
        with closing(loop.env):
            pushes = episode_pushes(loop, lambda done: progress(_PUSHING * done))
        searching = 1 - _WATCHING - _PUSHING
        falls = falls_in_episodes(subject, up[0], folder, lambda done: progress(searching * done))
    elif level == "full":
        progress(1 - _WATCHING)
    return Passport(
        walker=subject.walker,
        level=level,
        adherence=adherence_in_episodes(subject.behaviour, walks),
        orbits=None,
        stability=None,
        basins=(),
        pushes=pushes,
        baseline=None,
        baseline_pushes=None,
        falls=falls,
        certificate=not_certified(f"not tried: {subject.walker.no_section}") if certify else None,
    )
