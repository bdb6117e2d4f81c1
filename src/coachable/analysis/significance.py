"""Tests between setups by permutation, against a fixed number by bootstrap, and Holm's correction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from jaxtyping import Float
from scipy.stats import permutation_test

from coachable.analysis.intervals import Reduced, Statistic

RESAMPLES = 9_999
_SEED = 20_231_214
_TIE = 1e-12
"""Statistics as close as this, relatively, are equal but for rounding."""

TwoPs = tuple[float, float]
"""p of "greater" and p of "less"."""


def difference(statistic: Statistic, first: np.ndarray, second: np.ndarray, axis: int = 0) -> Reduced:
    """How much greater a statistic is in the first sample than in the second."""
    return statistic(first, axis=axis) - statistic(second, axis=axis)


def two_sample(
    statistic: Statistic, first: Float[np.ndarray, " first"], second: Float[np.ndarray, " second"]
) -> TwoPs:
    """Whether a statistic is greater, or less, in the first sample than in the second.

    Under the null hypothesis both samples come from one distribution, so that runs may be dealt anew to the
    two groups: the test is exact for it. Where the null is only that the statistics are equal, it is right
    for large samples of equal size (Romano, JASA 1990), and a study has as many seeds in every setup.

    **Returns:** the two one-sided p-values, (1 + #{D* ≥ D}) / (1 + resamples) and the same for ≤; exact over
    all deals where there are fewer than 9,999.
    """
    deals = permutation_test(
        (np.sort(first), np.sort(second)),
        partial(difference, statistic),
        vectorized=True,
        n_resamples=RESAMPLES,
        alternative="greater",
        rng=np.random.default_rng(_SEED),
    )
    every_deal = math.comb(len(first) + len(second), len(first)) <= RESAMPLES
    as_low = np.sum(deals.null_distribution <= deals.statistic + _TIE * abs(deals.statistic))
    itself = 0 if every_deal else 1
    less = (itself + as_low) / (itself + len(deals.null_distribution))
    return float(deals.pvalue), float(less)


def two_sample_about_medians(
    statistic: Statistic, first: Float[np.ndarray, " first"], second: Float[np.ndarray, " second"]
) -> TwoPs:
    """`two_sample` for a statistic of spread: each sample is first centred at its own median.

    Setups differ in where their runs lie, and a difference of places would be taken for spread if runs were
    dealt anew as they are. Residuals may be dealt, but for a correlation of order 1/n. Medians and not means
    (Brown and Forsythe, JASA 1974): for 15 runs a distribution with a long tail is then rejected in 3 % of
    all cases instead of in 7 % at a nominal 2.5 %.
    """
    return two_sample(statistic, first - np.median(first), second - np.median(second))


def one_sample(sample: Float[np.ndarray, " runs"], reference: float) -> TwoPs:
    """Whether the mean of a sample is greater, or less, than a fixed number: the bootstrap-t test.

    t = (x̄ − reference) / (s/√n) against t* = (x̄* − x̄) / (s*/√n) of resamples (Hall, Annals of Statistics
    1988). There is no second group to deal runs to, and flipping signs about the reference asks for a
    symmetric distribution: distances with a long lower tail would pass for "greater" twice too often even
    with 100 runs.

    **Returns:** the two one-sided p-values. Both are 1 for a sample without spread, which says nothing of its
    error.
    """
    sample = np.sort(sample)
    if len(sample) < 2 or sample[0] == sample[-1]:
        return 1.0, 1.0
    indices = np.random.default_rng(_SEED).integers(len(sample), size=(RESAMPLES, len(sample)))
    resampled = sample[indices]
    observed = (sample.mean() - reference) / sample.std()
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (resampled.mean(axis=1) - sample.mean()) / resampled.std(axis=1)
    greater, less = (
        (1 + np.sum(t >= observed)) / (1 + RESAMPLES),
        (1 + np.sum(t <= observed)) / (1 + RESAMPLES),
    )
    return float(greater), float(less)


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """p-values adjusted for their number by Holm's step-down method (Scand. J. Statist. 1979).

    With p₍₁₎ ≤ … ≤ p₍ₘ₎, p̃₍ᵢ₎ = max over j ≤ i of min(1, (m − j + 1) p₍ⱼ₎): whichever hypotheses are true,
    the chance to reject one of them with p̃ ≤ α is at most α.
    """
    order = np.argsort(p_values, kind="stable")
    scaled = np.minimum(1.0, np.asarray(p_values)[order] * np.arange(len(p_values), 0, -1))
    adjusted = np.empty(len(p_values))
    adjusted[order] = np.maximum.accumulate(scaled)
    return tuple(adjusted.tolist())
