"""Look for a fall in a Gymnasium environment: a push or a kick within stated bounds that ends an episode.

A search that finds nothing proves nothing. One that finds a fall shows it only after an environment that was
made anew has ended in the same step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from coachable.verification.falsification.fall_search import (
    Fall,
    SearchResult,
    Walks,
    at_random,
    cma_es,
    require_cma,
    search,
)
from coachable.verification.robustness.disturbed_episode import EpisodeDisturbance, EpisodeEnd, EpisodeLoop

_HALVINGS = 6
"""How often the share of a fall's disturbance that is still needed is halved in search of the least one."""


@dataclass(frozen=True)
class HeldPushes:
    """Pushes of the actions of at most `bound` halves of their range, from the start on, each held.

    How long they last and each is held is in seconds.
    """

    bound: float = 0.5
    seconds: float = 1.0
    hold: float = 0.2

    def size(self, loop: EpisodeLoop) -> int:
        """How many numbers a disturbance has."""
        return loop.num_actions * max(round(self.seconds / self.hold), 1)

    @property
    def sentence(self) -> str:
        """The perturbation in words."""
        return (
            f"pushes of at most {self.bound:g} of half the range of each action in the first "
            f"{self.seconds:g} s, each held for {self.hold:g} s"
        )

    def at(self, loop: EpisodeLoop, point: Float[np.ndarray, " size"]) -> EpisodeDisturbance:
        """The disturbance at a point of the cube."""
        rows = self.bound * point.reshape(-1, loop.num_actions)
        return EpisodeDisturbance(push=np.repeat(rows, loop.num_steps(self.hold), axis=0))


@dataclass(frozen=True)
class VelocityKick:
    """A change of every velocity at the start by at most `bound` [m/s, rad/s]; of MuJoCo's robots alone."""

    bound: float = 1.0

    def size(self, loop: EpisodeLoop) -> int:
        """How many numbers a disturbance has."""
        return loop.num_velocities

    @property
    def sentence(self) -> str:
        """The perturbation in words."""
        return f"a kick at the start that changes each velocity by at most {self.bound:g} m/s or rad/s"

    def at(self, loop: EpisodeLoop, point: Float[np.ndarray, " size"]) -> EpisodeDisturbance:
        """The disturbance at a point of the cube."""
        return EpisodeDisturbance(kick=self.bound * point)


EpisodePerturbation = HeldPushes | VelocityKick


@dataclass(frozen=True, eq=False)
class EpisodeCounterexample:
    """A fall that an environment made anew has seen, too, in the same step."""

    fall: Fall
    """Where the search found it, its disturbance then scaled down as far as it still fell."""
    disturbance: EpisodeDisturbance
    end: EpisodeEnd

    @property
    def size(self) -> float:
        """How much of the perturbation's bounds it takes: 1 is all."""
        return float(np.max(np.abs(self.fall.point)))


@dataclass(frozen=True, eq=False)
class EpisodeFalsification:
    """Two searches for a fall, at the same budget, and what was found."""

    perturbation: EpisodePerturbation
    episode: int
    """Which start of the evaluations."""
    seconds: float
    """How long each episode lasts, at most."""
    searches: tuple[SearchResult, SearchResult]
    """CMA-ES with restarts, and random search."""
    counterexamples: tuple[EpisodeCounterexample, ...]
    """The smallest first."""
    unconfirmed: tuple[Fall, ...]
    """What an environment made anew did not see fall, or not in the same step; they do not count."""


def search_for_falls_in_episodes(
    make_loop: Callable[[], EpisodeLoop],
    episode: int,
    *,
    seconds: float = 10.0,
    budget: int = 100,
    keep: int = 3,
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[EpisodeFalsification, ...]:
    """Search for a fall by CMA-ES with restarts, and beside it at random, with each perturbation there is.

    The margin that CMA-ES follows is −(1 − t / T) where the episode terminates at time t of T. Elsewhere it
    is 1 / (1 + exp((R₀ − R) / |R₀|)), R what the environment itself pays and R₀ that without a disturbance:
    a half where nothing was lost. An environment that pays the same for all that is up leaves the search in
    the dark.

    **Arguments:**

    - `make_loop`: makes the environment; called a second time for the confirmation.
    - `episode`: which start of the evaluations; undisturbed it should stay up.
    - `seconds`: of an episode, at most.
    - `budget`: how many episodes each search may take.
    - `keep`: how many counterexamples are wanted of each perturbation.
    - `seed`: the same one finds the same.
    - `progress`: called with the share of the work that was done since the last call.

    **Raises:** `MissingExtraError` without the [verify] extra.
    """
    require_cma()
    loop = make_loop()
    with closing(loop.env):
        perturbations: list[EpisodePerturbation] = [HeldPushes()]
        if loop.num_velocities:
            perturbations.append(VelocityKick())
        in_all = 2 * budget * len(perturbations)
        unperturbed = loop.run(episode, EpisodeDisturbance(), seconds)
        found = []
        for perturbation in perturbations:
            walks = _walks(loop, perturbation, episode, seconds, unperturbed.own_return, in_all, progress)
            size = perturbation.size(loop)
            directed = search("cma-es", cma_es(size, seed), walks, budget, lambda _: None)
            undirected = search("random", at_random(size, seed), walks, budget, lambda _: None)
            falls = sorted((*directed.falls, *undirected.falls), key=lambda fall: np.max(np.abs(fall.point)))
            shrunk = [_shrunk(loop, perturbation, episode, seconds, fall) for fall in falls[:keep]]
            counterexamples, unconfirmed = _confirmed(make_loop, perturbation, episode, seconds, shrunk)
            found.append(
                EpisodeFalsification(
                    perturbation, episode, seconds, (directed, undirected), counterexamples, unconfirmed
                )
            )
    return tuple(found)


def _walks(
    loop: EpisodeLoop,
    perturbation: EpisodePerturbation,
    episode: int,
    seconds: float,
    unperturbed: float,
    in_all: int,
    progress: Callable[[float], None],
) -> Walks:
    """From points of the cube to (margins, times, whether fallen), one after another."""
    longest = loop.num_steps(seconds) * loop.dt

    def margin(end: EpisodeEnd) -> float:
        if end.fell:
            return min(end.seconds / longest - 1, 0.0)
        lost = (unperturbed - end.own_return) / max(abs(unperturbed), 1e-9)
        return float(1 / (1 + np.exp(np.clip(lost, -50, 50))))

    def walks(points: Float[np.ndarray, "walks size"]):
        ends = []
        for point in points:
            ends.append(loop.run(episode, perturbation.at(loop, point), seconds))
            progress(1 / in_all)
        return (
            np.array([margin(end) for end in ends]),
            np.array([end.seconds for end in ends]),
            np.array([end.fell for end in ends]),
        )

    return walks


def _shrunk(
    loop: EpisodeLoop, perturbation: EpisodePerturbation, episode: int, seconds: float, fall: Fall
) -> Fall:
    """The fall with the least disturbance in the same direction that bisection finds to end in one."""
    least, low, high = fall, 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        point = middle * fall.point
        end = loop.run(episode, perturbation.at(loop, point), seconds)
        if end.fell:
            least, high = replace(fall, point=point, time=end.seconds), middle
        else:
            low = middle
    return least


def _confirmed(
    make_loop: Callable[[], EpisodeLoop],
    perturbation: EpisodePerturbation,
    episode: int,
    seconds: float,
    falls: Sequence[Fall],
) -> tuple[tuple[EpisodeCounterexample, ...], tuple[Fall, ...]]:
    """The falls that an environment made anew sees in the same step, the smallest first, and the others."""
    seen, unseen = [], []
    for fall in sorted(falls, key=lambda fall: np.max(np.abs(fall.point))):
        anew = make_loop()
        with closing(anew.env):
            disturbance = perturbation.at(anew, fall.point)
            end = anew.run(episode, disturbance, seconds)
        if end.fell and end.seconds == fall.time:
            seen.append(EpisodeCounterexample(fall, disturbance, end))
        else:
            unseen.append(fall)
    return tuple(seen), tuple(unseen)
