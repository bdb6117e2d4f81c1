"""Numbers with their uncertainty: bootstrap intervals over the runs of a setup."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import bootstrap, trim_mean

CONFIDENCE = 0.95
RESAMPLES = 9_999
_SEED = 20_231_213
_BATCH = 64

Reduced = np.ndarray | np.floating
"""What is left when an axis is reduced."""

Statistic = Callable[..., Reduced]
"""Takes one or two samples and the `axis` to reduce, as `mean` does."""


@dataclass(frozen=True)
class Estimate:
    """A value and its 95 % interval. `low` and `high` are NaN where the sample supports no interval."""

    value: float
    low: float = math.nan
    high: float = math.nan

    @property
    def has_interval(self) -> bool:
        """Whether there is an interval."""
        return not math.isnan(self.low)


def mean(sample: np.ndarray, axis: int = 0) -> Reduced:
    """The mean."""
    return np.mean(sample, axis=axis)


def iqm(sample: np.ndarray, axis: int = 0) -> Reduced:
    """The interquartile mean: without the lowest and highest ⌊n/4⌋ values (Agarwal et al., NeurIPS 2021)."""
    return trim_mean(sample, 0.25, axis=axis)


def std(sample: np.ndarray, axis: int = 0) -> Reduced:
    """The sample standard deviation, s² = Σ (xᵢ − x̄)² / (n − 1); NaN for a single value."""
    if sample.shape[axis] < 2:
        return np.full_like(np.mean(sample, axis=axis), np.nan)
    return np.std(sample, axis=axis, ddof=1)


def probability_of_improvement(first: np.ndarray, second: np.ndarray, axis: int = 0) -> Reduced:
    """The chance that a run of the first sample beats one of the second, a tie being half a win.

    P(X > Y) + P(X = Y) / 2 over all pairs, the Mann–Whitney U over n·m (Agarwal et al., NeurIPS 2021).
    """
    x = np.moveaxis(first, axis, -1)[..., :, None]
    y = np.moveaxis(second, axis, -1)[..., None, :]
    return ((x > y).mean(axis=(-2, -1)) + (x >= y).mean(axis=(-2, -1))) / 2


def estimate(statistic: Statistic, *samples: Float[np.ndarray, "_"]) -> Estimate:
    """A statistic of one or two samples with its interval; see `interval`. Of no runs it is NaN."""
    if any(sample.size == 0 for sample in samples):
        return Estimate(math.nan)
    # Sums depend on their order in the last digit, and the order of the seeds means nothing.
    samples = tuple(np.sort(sample) for sample in samples)
    low, high = interval(statistic, *samples, resamples=RESAMPLES)
    return Estimate(float(statistic(*samples, axis=0)), float(low), float(high))


def interval(
    statistic: Statistic, *samples: Float[np.ndarray, "_ *points"], resamples: int
) -> tuple[Reduced, Reduced]:
    """The bias-corrected and accelerated bootstrap interval (BCa; Efron, JASA 1987) at 95 %.

    Runs are resampled with replacement within each sample, which is what stratifying by setup means. The
    random numbers are fixed and the runs are sorted first, so that neither the call nor the order of the
    seeds matters.

    **Arguments:** `statistic` of the samples; `samples`, runs along the first axis, an interval for every
    point of the others.

    **Returns:** the lower and the upper ends. Both are NaN where the bootstrap has nothing to say: for a
    single run, or where no resample differs from another. Where only the acceleration is undefined (every
    leave-one-out value is the same) the interval is the percentile one.
    """
    if any(len(sample) < 2 for sample in samples):
        nothing = np.full(samples[0].shape[1:], np.nan)
        return nothing, nothing
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # SciPy warns of the undefined acceleration that is dealt with below
        result = bootstrap(
            [np.sort(sample, axis=0) for sample in samples],
            statistic,
            axis=0,
            vectorized=True,
            n_resamples=resamples,
            batch=_BATCH,
            confidence_level=CONFIDENCE,
            method="BCa",
            rng=_SEED,
        )
    tail = (1 - CONFIDENCE) / 2
    percentile = np.quantile(result.bootstrap_distribution, [tail, 1 - tail], axis=-1)
    bca = np.stack([result.confidence_interval.low, result.confidence_interval.high])
    ends = np.where(np.isnan(bca), percentile, bca)
    low, high = np.where(ends[0] < ends[1], ends, np.nan)
    return low, high
