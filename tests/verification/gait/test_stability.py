"""Stable is said only where the error bounds leave no doubt, and kinks are told."""

import dataclasses

import numpy as np
import pytest

from coachable.verification.gait.closed_loop import stacked
from coachable.verification.gait.stability import multipliers_with_errors, stabilities


@pytest.fixture(scope="module")
def found(walker, settled):
    import jax

    with jax.enable_x64(True):
        return stabilities(stacked([walker]), [settled["touchdown"][1]])[0]


def test_a_deviation_shrinks_as_the_largest_multiplier_says(walker, settled, found):
    walk, orbit = settled["touchdown"]
    distance = np.linalg.norm(walk.section - orbit.points[0], axis=1)
    steps = np.flatnonzero((distance > 1e-9) & (distance < 1e-4))
    rate = (distance[steps[-1]] / distance[steps[0]]) ** (1 / (steps[-1] - steps[0]))
    assert found.largest == pytest.approx(rate, rel=0.15)
    assert found.verdict == "stable"


def test_clipped_samples_are_counted(walker, found):
    ankle, hip = found.num_clipped
    assert ankle == 0
    assert 0 < hip < found.num_samples
    assert 0 < found.clip_margin < 0.1
    assert 0 <= found.sample_margin <= 0.005
    assert found.kinks == ()


@pytest.mark.parametrize(
    ("size", "error", "verdict"),
    [
        (0.9, 1e-3, "stable"),
        (0.9995, 1e-3, "undecided"),
        (1.0005, 1e-3, "undecided"),
        (1.1, 1e-3, "unstable"),
    ],
)
def test_the_verdict_keeps_clear_of_its_error(found, size, error, verdict):
    other = dataclasses.replace(found, multipliers=(complex(size), 0.1 + 0j, 0.1 + 0j), errors=(error,) * 3)
    assert other.verdict == verdict


def test_an_orbit_on_a_kink_is_told(found):
    assert "bound" in dataclasses.replace(found, clip_margin=1e-9).kinks[0]
    assert "sample" in dataclasses.replace(found, sample_margin=0.0).kinks[0]


def test_no_multiplier_moves_farther_than_its_bound():
    rng = np.random.default_rng(0)
    for _ in range(200):
        matrix, change = rng.normal(size=(3, 3)), 1e-4 * rng.normal(size=(3, 3))
        values, errors = multipliers_with_errors(matrix, np.linalg.norm(change, 2))
        for moved in np.linalg.eigvals(matrix + change):
            assert min(abs(np.array(values) - moved)) <= errors[0]
        assert list(map(abs, values)) == sorted(map(abs, values), reverse=True)
