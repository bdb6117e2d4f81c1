"""Interquartile mean and probability of improvement against rliable, whose authors proposed them.

Its metrics are compared and not its bootstrap: that needs arch, which does not import beside pandas 3. The
intervals are compared with a percentile bootstrap of its metrics, which is what its own are.
"""

import warnings

import numpy as np
import pytest

from coachable.analysis.intervals import estimate, iqm, probability_of_improvement

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of what it imports
    metrics = pytest.importorskip("rliable.metrics", reason="the comparison needs rliable")


@pytest.fixture
def runs():
    rng = np.random.default_rng(7)
    return {"ours": rng.normal(8.4, 1, 24), "theirs": rng.normal(8.0, 1.5, 24)}


def test_values_agree(runs):
    ours, theirs = runs["ours"], runs["theirs"]
    assert iqm(ours) == pytest.approx(metrics.aggregate_iqm(ours[:, None]))
    assert probability_of_improvement(ours, theirs) == pytest.approx(
        metrics.probability_of_improvement(ours[:, None], theirs[:, None])
    )


@pytest.mark.parametrize(
    ("statistic", "metric", "names"),
    [
        (iqm, metrics.aggregate_iqm, ["ours"]),
        (probability_of_improvement, metrics.probability_of_improvement, ["ours", "theirs"]),
    ],
)
def test_intervals_agree_loosely(runs, statistic, metric, names):
    """Percentile intervals there, BCa here: on samples like these they differ little."""
    rng, samples = np.random.default_rng(0), [runs[name] for name in names]
    resampled = [
        metric(*(rng.choice(sample, len(sample))[:, None] for sample in samples)) for _ in range(2000)
    ]
    low, high = np.quantile(resampled, [0.025, 0.975])
    found = estimate(statistic, *samples)
    width = found.high - found.low
    assert found.low == pytest.approx(low, abs=0.2 * width)
    assert found.high == pytest.approx(high, abs=0.2 * width)
