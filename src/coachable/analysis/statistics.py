"""The numbers that a study is reported in: estimates over the runs of a setup, and bands of its curves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float, Shaped

from coachable.analysis.claims import ALONE
from coachable.analysis.intervals import (
    Estimate,
    estimate,
    interval,
    iqm,
    mean,
    probability_of_improvement,
    std,
)
from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.measures import Measure

LATE_STEPS = 50_000
"""The training reward is averaged over the last 50,000 steps."""

_RESAMPLES_OF_A_BAND = 1_999


@dataclass(frozen=True)
class SetupStatistics:
    """One reward setup in numbers. Distances in metres; returns are normalised by the baseline's."""

    name: str
    num_runs: int
    highest: float
    """Greatest distance of any run. A bootstrap of a maximum is invalid, so it has no interval."""
    highest_mean: Estimate
    highest_iqm: Estimate
    highest_std: Estimate
    highest_mean_surviving: Estimate
    """Mean of Highest(run) over the evaluations that did not end in a fall."""
    final_mean: Estimate
    final_iqm: Estimate
    final_std: Estimate
    final_mean_surviving: Estimate
    """Mean final distance of the walkers that did not fall."""
    first_above_baseline: float
    """Training steps at which any run's greatest distance first passes the baseline's; ∞ if none does."""
    steps_to_baseline: Estimate
    """Restricted mean over runs of the steps until an evaluation passes the baseline's distance."""
    num_above_baseline: int
    late_return: Estimate
    """Mean return of the last 50,000 training steps."""
    highest_return_std: Estimate
    final_return_std: Estimate
    num_up_at_end: int
    """Final walkers that are up when the evaluation ends."""
    num_up_watched: int | None
    """Final walkers that are still up after 100 s; None if they were not watched."""
    perturbed_up: Estimate
    """Share of the perturbed starts from which the final walker stays up."""
    share_in_cycle: Estimate
    """Share of the final evaluation's samples that lie in the described cycle."""


def statistics_of(runs: Measurements, setup: SetupRuns) -> SetupStatistics:
    """The statistics of one setup's runs, with 95 % BCa intervals."""
    above = setup.highest_of_all_runs > runs.baseline_distance
    return SetupStatistics(
        name=setup.name,
        num_runs=setup.num_runs,
        highest=float(setup.highest.max()),
        highest_mean=estimate(mean, setup.highest),
        highest_iqm=estimate(iqm, setup.highest),
        highest_std=estimate(std, setup.highest),
        highest_mean_surviving=estimate(mean, setup.highest_surviving),
        final_mean=estimate(mean, setup.final_distance),
        final_iqm=estimate(iqm, setup.final_distance),
        final_std=estimate(std, setup.final_distance),
        final_mean_surviving=estimate(mean, setup.final_surviving),
        first_above_baseline=float(runs.checkpoints[above.argmax()]) if above.any() else math.inf,
        steps_to_baseline=estimate(mean, runs.steps_to_baseline(setup)),
        num_above_baseline=int(runs.passes_baseline(setup).sum()),
        late_return=estimate(mean, setup.late_returns(runs.grid, LATE_STEPS)),
        highest_return_std=estimate(std, setup.highest_return),
        final_return_std=estimate(std, setup.final_return),
        num_up_at_end=int((~setup.final_fell).sum()),
        num_up_watched=int(setup.up_to_the_end.sum()) if setup.watched_on else None,
        perturbed_up=estimate(mean, setup.perturbed_up),
        share_in_cycle=estimate(mean, setup.final_share_in_cycle),
    )


def at_the_end(setup: SetupRuns, measure: Measure) -> Estimate:
    """The mean over runs of a measure at the last evaluation of each, with its 95 % interval."""
    values = setup.last(measure)
    return estimate(mean, values[~np.isnan(values)])


@dataclass(frozen=True, eq=False)
class Band:
    """A mean over runs along the training steps, with its pointwise 95 % interval."""

    steps: Shaped[np.ndarray, " points"]
    value: Float[np.ndarray, " points"]
    low: Float[np.ndarray, " points"]
    high: Float[np.ndarray, " points"]


def mean_curve(runs: Measurements, setup: SetupRuns, measure: Measure) -> Band:
    """The mean over runs of a measure, at the steps at which every run has a value of it."""
    values = setup.values(measure).astype(float)
    known = ~np.isnan(values).any(axis=0)
    low, high = interval(mean, values[:, known], resamples=_RESAMPLES_OF_A_BAND)
    return Band(
        runs.steps_of(measure)[known], values[:, known].mean(axis=0), np.asarray(low), np.asarray(high)
    )


@dataclass(frozen=True)
class Improvement:
    """The chance that a run of one setup walks farther than a run of another one."""

    setup: str
    over: str
    highest: Estimate
    """In Highest(run)."""
    final: Estimate
    """In the distance after the last update."""


MOST_IN_PAIRS = 5
"""Of more setups pairs would fill pages."""


def improvements(runs: Measurements) -> tuple[Improvement, ...]:
    """The probability of improvement of each setup over each that stands before it in the plan.

    Of more than `MOST_IN_PAIRS` setups only those of the description alone over each other one, if it is
    there.
    """

    def chance(setup: SetupRuns, over: SetupRuns) -> Improvement:
        return Improvement(
            setup.name,
            over.name,
            estimate(probability_of_improvement, setup.highest, over.highest),
            estimate(probability_of_improvement, setup.final_distance, over.final_distance),
        )

    if len(runs.setups) > MOST_IN_PAIRS:
        alone = [setup for setup in runs.setups if setup.name == ALONE]
        return tuple(chance(setup, over) for setup in alone for over in runs.setups if over is not setup)
    return tuple(chance(setup, over) for over, setup in combinations(runs.setups, 2))
