import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import bootstrap, mannwhitneyu, trim_mean

from coachable.analysis.intervals import (
    Estimate,
    estimate,
    interval,
    iqm,
    mean,
    probability_of_improvement,
    std,
)

SAMPLES = arrays(float, st.integers(2, 40), elements=st.floats(-1e3, 1e3))


@given(SAMPLES)
def test_iqm_is_the_quarter_trimmed_mean(sample):
    assert iqm(sample) == trim_mean(sample, 0.25)


def test_closed_forms():
    sample = np.arange(1.0, 9.0)
    assert mean(sample) == 4.5
    assert iqm(np.array([-1e9, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 1e9])) == 4.5
    assert std(sample) == pytest.approx(np.sqrt(6.0))
    assert np.isnan(std(np.array([1.0])))


@pytest.mark.parametrize("statistic", [mean, iqm, std])
def test_the_order_of_the_seeds_does_not_matter(statistic):
    sample = np.random.default_rng(0).gamma(2, size=30)
    assert estimate(statistic, sample) == estimate(statistic, sample[::-1].copy())


def test_an_estimate_moves_and_stretches_with_its_sample():
    sample = np.random.default_rng(1).gamma(2, size=20)
    plain, moved = estimate(mean, sample), estimate(mean, 10 + 3 * sample)
    for name in ("value", "low", "high"):
        assert getattr(moved, name) == pytest.approx(10 + 3 * getattr(plain, name))


def test_the_interval_agrees_with_scipy_s_own():
    sample = np.random.default_rng(2).exponential(size=40)
    ours = estimate(mean, sample)
    theirs = bootstrap((sample,), np.mean, method="BCa", n_resamples=50_000, rng=3).confidence_interval
    assert ours.low == pytest.approx(theirs.low, abs=0.01)
    assert ours.high == pytest.approx(theirs.high, abs=0.02)
    assert ours.value - ours.low < ours.high - ours.value  # it leans to the long tail: not a symmetric one


@pytest.mark.parametrize(
    ("draw", "truth"), [("normal", 0.0), ("exponential", 1.0)], ids=["symmetric", "with a long tail"]
)
def test_nineteen_of_twenty_intervals_cover_the_truth(draw, truth):
    samples = getattr(np.random.default_rng(4), draw)(size=(50, 400))
    low, high = interval(mean, samples, resamples=1_999)
    assert 0.90 <= np.mean((low <= truth) & (truth <= high)) <= 0.98


def test_a_difference_is_resampled_within_each_setup():
    rng = np.random.default_rng(5)
    few, many = rng.normal(1, 1, size=30), rng.normal(0, 1, size=300)
    result = estimate(lambda a, b, axis: mean(a, axis) - mean(b, axis), few, many)
    error = np.sqrt(few.var(ddof=1) / 30 + many.var(ddof=1) / 300)
    assert result.high - result.low == pytest.approx(2 * 1.96 * error, rel=0.1)


@pytest.mark.parametrize(
    "sample", [[3.0], [3.0] * 15, [1.0] + [3.0] * 14], ids=["one", "all equal", "one off"]
)
def test_no_interval_where_the_resamples_say_nothing(sample):
    result = estimate(iqm, np.array(sample))
    assert result.value == 3.0
    assert not result.has_interval


def test_no_runs_no_number():
    result = estimate(mean, np.array([]))
    assert np.isnan(result.value)
    assert not result.has_interval


def test_an_undefined_acceleration_leaves_the_percentile_interval():
    sample = np.array([1.0] * 3 + [3.0] * 12)
    assert [iqm(np.delete(sample, i)) for i in range(15)] == [3.0] * 15
    result = estimate(iqm, sample)
    assert 1.0 <= result.low < 3.0
    assert result.high == 3.0


def test_an_estimate_without_ends_has_no_interval():
    assert not Estimate(1.0).has_interval
    assert Estimate(1.0, 0.5, 1.5).has_interval


def test_the_probability_of_improvement_is_that_of_all_pairs():
    rng = np.random.default_rng(3)
    first, second = rng.integers(0, 6, 9).astype(float), rng.integers(0, 6, 7).astype(float)
    wins = [(x > y) + 0.5 * (x == y) for x in first for y in second]
    assert probability_of_improvement(first, second) == pytest.approx(np.mean(wins))
    u = mannwhitneyu(first, second).statistic
    assert probability_of_improvement(first, second) == pytest.approx(u / (9 * 7))


@given(
    st.lists(st.integers(-5, 5), min_size=1, max_size=8), st.lists(st.integers(-5, 5), min_size=1, max_size=8)
)
def test_one_improves_as_often_as_the_other_does_not(first, second):
    first, second = np.array(first, float), np.array(second, float)
    there = probability_of_improvement(first, second)
    assert there + probability_of_improvement(second, first) == pytest.approx(1)
    assert probability_of_improvement(first + 100, second) == 1
    stacked = probability_of_improvement(np.stack([first, first]), np.stack([second, second]), axis=-1)
    assert stacked.tolist() == [there, there]
