"""Claims about studies: the paper's C1 to C5 and our C6, and S1 to S6 about a description alone.

Does each hold, is it reversed, or is it undecided?
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np
from jaxtyping import Float

from coachable.analysis.intervals import Estimate, Statistic, estimate, mean, std
from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.significance import (
    TwoPs,
    difference,
    holm,
    one_sample,
    two_sample,
    two_sample_about_medians,
)

LEVEL = 0.05
"""Chance that any claim is decided although nothing is true, or in the wrong direction."""

SPARSE, FORWARD, ORTHANT, BOTH = SETUPS = ("sparse", "forward", "orthant", "forward+orthant")
"""The setups that the paper's claims are about."""

ALONE, WITH_DISTANCE = "description-alone", "schedule"
"""The description as the only reward but for falls and jerk, and beside the paper's terms; both unseen."""
OTHERS = (
    "sparse",
    "forward",
    "orthant",
    "sparse-truncates",
    "forward-truncates",
    "orthant-truncates",
    "clock-tuned",
    "forward-alone",
)
"""What the description is measured against in S1 to S6."""


class Verdict(StrEnum):
    """What a study says of a claim."""

    HOLDS = "holds"
    REVERSED = "reversed"
    UNDECIDED = "undecided"
    NOT_APPLICABLE = "not applicable"


@dataclass(frozen=True)
class Comparison:
    """One setup against another, or against the baseline, as a claim has it."""

    measure: str
    unit: str
    """`m`, `steps`, or `%`, in which shares are given."""
    relation: str
    """What the claim says, such as `sparse < forward`."""
    advantage: Estimate
    """How much the difference is in favour of the claim, in the measure's unit (shares as fractions)."""
    p_for: float
    """One-sided p-value for the claim."""
    p_against: float
    """One-sided p-value for its opposite."""


@dataclass(frozen=True)
class Claim:
    """A claim, what it rests on, and what became of it."""

    name: str
    statement: str
    comparisons: tuple[Comparison, ...]
    verdict: Verdict
    p: float = np.nan
    """Two-sided p-value of the whole claim."""
    p_holm: float = np.nan
    """The same, corrected for the number of claims."""
    reason: str = ""
    """Why it is not applicable."""


def decide(runs: Measurements) -> tuple[Claim, ...]:
    """Decide C1 to C6, or S1 to S6 of a study that can answer some of those and none of C1 to C6.

    **One claim, several comparisons.** "Sparse is below each other setup" holds if *every* comparison holds,
    so what has to be rejected is that at least one does not: an intersection–union test (Berger,
    Technometrics 1982), whose p-value is the largest of the comparisons'. No correction is due within a
    claim, since all must pass. It is *reversed* if every comparison is significantly the other way: again the
    largest p-value, of the other side. A claim for which some comparisons go one way and others the other is
    neither; its comparisons tell which.

    **Both directions.** A claim can be decided either way, so its p-value is twice the smaller of the two.

    **Several claims.** Holm's correction over all applicable claims keeps the chance of any wrong decision at
    5 %; the direction of a decided claim is that of the smaller p-value.

    A claim about setups that are not in the study, that have fewer than two runs, or whose walkers were not
    watched for it, is not applicable, and does not count in the correction.
    """
    claims = [_examine(runs, question) for question in _questions(runs)]
    decided = [claim for claim in claims if claim.verdict is not Verdict.NOT_APPLICABLE]
    corrected = dict(
        zip([claim.name for claim in decided], holm([claim.p for claim in decided]), strict=True)
    )
    return tuple(
        _with_verdict(claim, corrected[claim.name]) if claim.name in corrected else claim for claim in claims
    )


@dataclass(frozen=True)
class _Question:
    name: str
    statement: str
    compare: Callable[[Measurements], list[Comparison]]
    setups: tuple[str, ...] = SETUPS
    about_walking_on: bool = False

    def obstacle(self, runs: Measurements) -> str:
        """Why the study cannot answer it; empty if it can."""
        if missing := [setup for setup in self.setups if setup not in runs.setup_names]:
            return f"no setup {', '.join(missing)}"
        if few := [setup for setup in self.setups if runs[setup].num_runs < 2]:
            return f"only one run of {few[0]}"
        if self.about_walking_on and not all(runs[setup].watched_on for setup in self.setups):
            return "no walker was watched for 100 s"
        return ""


def _questions(runs: Measurements) -> Sequence[_Question]:
    """The claims that a study can say something of; the paper's if there are none."""
    answerable = (asked for asked in _ASKED if any(not question.obstacle(runs) for question in asked))
    return next(answerable, _ASKED[0])


def _examine(runs: Measurements, question: _Question) -> Claim:
    if reason := question.obstacle(runs):
        return Claim(question.name, question.statement, (), Verdict.NOT_APPLICABLE, reason=reason)
    comparisons = tuple(question.compare(runs))
    both = max(c.p_for for c in comparisons), max(c.p_against for c in comparisons)
    return Claim(question.name, question.statement, comparisons, Verdict.UNDECIDED, p=min(1.0, 2 * min(both)))


def _with_verdict(claim: Claim, p_holm: float) -> Claim:
    verdict = Verdict.UNDECIDED
    if p_holm <= LEVEL:
        holds = max(c.p_for for c in claim.comparisons) < max(c.p_against for c in claim.comparisons)
        verdict = Verdict.HOLDS if holds else Verdict.REVERSED
    return replace(claim, p_holm=p_holm, verdict=verdict)


def _against_others(
    runs: Measurements,
    subject: str,
    relation: str,
    measure: _Measure,
    others: Sequence[str] = SETUPS,
) -> list[Comparison]:
    """The subject's runs against those of each other setup that the claims are about."""

    def compare(other: str) -> Comparison:
        of_subject, of_other = measure.values(runs, runs[subject]), measure.values(runs, runs[other])
        above, below = (of_subject, of_other) if relation == ">" else (of_other, of_subject)
        return Comparison(
            measure.name,
            measure.unit,
            f"{subject} {relation} {other}",
            estimate(partial(difference, measure.statistic), above, below),
            *measure.test(measure.statistic, above, below),
        )

    return [compare(other) for other in others if other != subject]


def _above_baseline(runs: Measurements, names: Sequence[str]) -> list[Comparison]:
    """The mean of Highest(run) of each setup against the baseline's distance, which is one number."""

    def compare(name: str) -> Comparison:
        gain = runs[name].highest - runs.baseline_distance
        p_for, p_against = one_sample(gain, 0.0)
        claimed = f"{name} > baseline"
        return Comparison(_HIGHEST.name, _HIGHEST.unit, claimed, estimate(mean, gain), p_for, p_against)

    return [compare(name) for name in names]


@dataclass(frozen=True)
class _Measure:
    name: str
    unit: str
    values: Callable[[Measurements, SetupRuns], Float[np.ndarray, " runs"]]
    statistic: Statistic = mean
    test: Callable[[Statistic, np.ndarray, np.ndarray], TwoPs] = two_sample


_FINAL = _Measure("final distance", "m", lambda _, setup: setup.final_distance)
_HIGHEST = _Measure("highest distance", "m", lambda _, setup: setup.highest)
_SPREAD_OF_FINAL = _Measure(
    "std of final", "m", lambda _, setup: setup.final_distance, std, two_sample_about_medians
)
_SPREAD = _Measure("std of highest", "m", lambda _, setup: setup.highest, std, two_sample_about_medians)
_TO_BASELINE = _Measure("to baseline", "steps", lambda runs, setup: runs.steps_to_baseline(setup))
_UP = _Measure("up after 100 s", "%", lambda _, setup: setup.up_to_the_end.astype(float))
_PERTURBED = _Measure("perturbed starts", "%", lambda _, setup: setup.perturbed_up)

_BEATING = (FORWARD, ORTHANT, BOTH)
_OF_THE_PAPER = (
    _Question(
        "C1",
        "sparse walks less far at the end than each other setup",
        lambda runs: _against_others(runs, SPARSE, "<", _FINAL),
    ),
    _Question(
        "C2",
        "forward+orthant passes the baseline first and walks farthest",
        lambda runs: (
            _against_others(runs, BOTH, "<", _TO_BASELINE) + _against_others(runs, BOTH, ">", _HIGHEST)
        ),
    ),
    _Question(
        "C3",
        "orthant varies least between runs in the distance it reaches",
        lambda runs: _against_others(runs, ORTHANT, "<", _SPREAD),
    ),
    _Question(
        "C4",
        "forward, orthant and forward+orthant beat the baseline",
        lambda runs: _above_baseline(runs, _BEATING),
        setups=_BEATING,
    ),
    _Question(
        "C5",
        "sparse passes the baseline later than each other setup",
        lambda runs: _against_others(runs, SPARSE, ">", _TO_BASELINE),
    ),
    _Question(
        "C6",
        "orthant stays up most: for 100 s, and from perturbed starts",
        lambda runs: (
            _against_others(runs, ORTHANT, ">", _UP) + _against_others(runs, ORTHANT, ">", _PERTURBED)
        ),
        about_walking_on=True,
    ),
)


def _of_description(
    name: str, statement: str, *measured: tuple[str, _Measure], subject: str = ALONE
) -> _Question:
    """A claim that a described reward is ahead of each other one, in one measure or in several."""
    return _Question(
        name,
        statement,
        lambda runs: [
            comparison
            for relation, measure in measured
            for comparison in _against_others(runs, subject, relation, measure, OTHERS)
        ],
        setups=(subject, *OTHERS),
        about_walking_on=any(measure in (_UP, _PERTURBED) for _, measure in measured),
    )


_AHEAD = ((">", _FINAL), ("<", _SPREAD_OF_FINAL), (">", _UP), (">", _PERTURBED), ("<", _TO_BASELINE))
_OF_THE_DESCRIPTION = (
    _of_description("S1", "the description alone walks farther at the end than each other reward", _AHEAD[0]),
    _of_description("S2", "it varies least between runs in that distance", _AHEAD[1]),
    _of_description("S3", "more of its walkers are up after 100 s", _AHEAD[2]),
    _of_description("S4", "it survives more of the perturbed starts", _AHEAD[3]),
    _of_description("S5", "it passes the baseline earlier", _AHEAD[4]),
    _of_description(
        "S6", "with the distance term added it is ahead in all of this", *_AHEAD, subject=WITH_DISTANCE
    ),
)
_ASKED = (_OF_THE_PAPER, _OF_THE_DESCRIPTION)
