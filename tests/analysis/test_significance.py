import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.analysis import significance
from coachable.analysis.intervals import mean, std
from coachable.analysis.significance import holm, one_sample, two_sample, two_sample_about_medians


def test_holm_against_a_hand_worked_example():
    # sorted: 0.005·4, 0.01·3, 0.03·2, 0.04·1, and never below the one before
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx((0.03, 0.06, 0.06, 0.02))
    assert holm([0.4, 0.9]) == pytest.approx((0.8, 0.9))
    assert holm([0.6, 0.9]) == pytest.approx((1.0, 1.0))
    assert holm([]) == ()


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8), st.randoms())
def test_holm_raises_keeps_the_order_and_does_not_care_for_it(p_values, random):
    adjusted = holm(p_values)
    assert all(p <= q <= 1 for p, q in zip(p_values, adjusted, strict=True))
    assert min(adjusted) == min(1.0, len(p_values) * min(p_values))
    shuffled = list(range(len(p_values)))
    random.shuffle(shuffled)
    assert holm([p_values[i] for i in shuffled]) == tuple(adjusted[i] for i in shuffled)
    for p, q in zip(p_values, adjusted, strict=True):
        assert all(q <= other for r, other in zip(p_values, adjusted, strict=True) if r > p)


def test_few_runs_are_dealt_in_every_way():
    low, high = np.array([1.0, 2.0]), np.array([3.0, 4.0])
    assert two_sample(mean, low, high) == pytest.approx((1.0, 1 / 6))
    assert two_sample(mean, high, low) == pytest.approx((1 / 6, 1.0))
    three = np.arange(3.0)
    assert two_sample(mean, three + 10, three) == pytest.approx((1 / 20, 1.0))


def test_the_order_of_the_seeds_does_not_matter():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=20), rng.normal(0.5, size=20)
    for test in (two_sample, two_sample_about_medians):
        assert test(std, a, b) == test(std, a[::-1].copy(), rng.permutation(b))
    assert one_sample(a, 0.2) == one_sample(rng.permutation(a), 0.2)


def test_a_spread_is_compared_wherever_the_runs_lie():
    rng = np.random.default_rng(1)
    narrow, wide = rng.normal(0, 1, size=30), rng.normal(0, 3, size=30)
    assert two_sample_about_medians(std, narrow, wide) == pytest.approx(
        two_sample_about_medians(std, narrow + 64.0, wide), abs=1e-3
    )
    assert two_sample_about_medians(std, narrow, wide)[1] < 0.001


@pytest.fixture
def fewer_resamples(monkeypatch):
    monkeypatch.setattr(significance, "RESAMPLES", 299)


def bimodal(rng, size):
    """Like distances: most walk well, a few do not."""
    return np.where(rng.random(size) < 0.15, rng.normal(2, 0.5, size), rng.normal(8.4, 0.3, size))


@pytest.mark.parametrize("runs", [15, 100])
def test_nothing_is_found_in_noise_more_often_than_it_should(fewer_resamples, runs):
    rng = np.random.default_rng(2)
    trials = [(bimodal(rng, runs), bimodal(rng, runs)) for _ in range(200)]
    means = np.array([two_sample(mean, a, b) for a, b in trials])
    spreads = np.array([two_sample_about_medians(std, a, b + 3) for a, b in trials])
    for p in (*means.T, *spreads.T):
        # Nominally 0.025; three standard errors above it, and a little for small samples.
        assert np.mean(p <= 0.025) <= 0.07
    for p in means.T:
        assert 0.35 < np.mean(p <= 0.5) < 0.65


def test_a_long_tail_does_not_pass_for_a_difference_from_a_fixed_number(fewer_resamples):
    rng = np.random.default_rng(3)
    truth = 0.15 * 2 + 0.85 * 8.4
    p = np.array([one_sample(bimodal(rng, 100), truth) for _ in range(600)])
    assert np.all(np.mean(p <= 0.025, axis=0) <= 0.05)
    assert np.all(np.mean(p <= 0.25, axis=0) > 0.18)


def test_a_clear_difference_is_found():
    rng = np.random.default_rng(4)
    a, b = rng.normal(1.5, 1, size=15), rng.normal(0, 1, size=15)
    for greater, less in (two_sample(mean, a, b), one_sample(a, 0.0)):
        assert greater < 0.01
        assert less > 0.99


def test_a_sample_without_spread_proves_nothing():
    assert one_sample(np.full(15, 8.0), 7.0) == (1.0, 1.0)
    assert one_sample(np.array([8.0]), 7.0) == (1.0, 1.0)
