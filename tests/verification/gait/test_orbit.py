"""Orbits are where they are known to be, of the period that they have, and there is none where it falls."""

import jax
import numpy as np
import pytest

from coachable.plants.compass import START
from coachable.verification.gait.closed_loop import stacked
from coachable.verification.gait.orbit import find_orbits, fixed_point, follow
from coachable.verification.gait.stability import stabilities
from coachable.verification.gait.walk import settle
from tests.verification.conftest import FALLS, TWO_STEPS, loop_of


@pytest.fixture(scope="module")
def slope_orbit(slope_walker):
    with jax.enable_x64(True):
        loops = stacked([slope_walker])
        walks = settle(loops, np.array([START]), "touchdown")
        (orbit,) = find_orbits(loops, walks, "touchdown")
        (found,) = stabilities(loops, [orbit])
        return orbit, found


def test_virtual_gravity_has_the_orbit_that_is_known_of_it(slope_orbit):
    orbit, _ = slope_orbit
    assert (orbit.kind, orbit.num_steps) == ("periodic", 1)
    np.testing.assert_allclose(orbit.points[0], (0.29917117, -1.14151641, -0.21486579), atol=2e-8)
    assert orbit.period == pytest.approx(0.7475839435, abs=1e-8)
    assert orbit.step_length == pytest.approx(0.5894565783, abs=2e-8)
    assert orbit.residual < 1e-12


def test_its_cost_of_transport_is_the_slope(slope_orbit):
    # Walking down a slope is paid by tan φ M g d; joints that now and then brake pay a little more.
    orbit, _ = slope_orbit
    assert np.tan(0.07) < orbit.cost_of_transport < 1.02 * np.tan(0.07)


def test_its_multipliers_are_those_known_of_it(slope_orbit):
    _, found = slope_orbit
    expected = (-0.52453475 + 0.19816069j, -0.52453475 - 0.19816069j, 0.1117131)
    np.testing.assert_allclose(found.multipliers, expected, atol=5e-8)
    assert np.max(np.abs(np.array(found.multipliers) - expected)) < found.error + 1e-8
    assert found.verdict == "stable"
    assert found.disagreement < 1e-6
    assert found.num_samples == 0


def test_a_sampled_walker_repeats_itself_only_if_touchdown_restarts_the_clock(x64, walker, settled):
    walk, orbit = settled["touchdown"]
    assert walk.up
    assert (orbit.kind, orbit.num_steps) == ("periodic", 1)
    assert np.max(np.abs(np.diff(walk.section[-30:], axis=0))) < 1e-12
    walk, free = settled["free"]
    assert walk.up
    assert 1e-7 < max(free.wander) < 0.1
    assert np.isnan(free.residual)
    np.testing.assert_allclose(walk.section[-30:], np.tile(orbit.points[0], (30, 1)), atol=0.1)
    assert free.speed == pytest.approx(orbit.speed, rel=0.03)


def test_times_and_lengths_add_up_to_the_walk(settled):
    walk, orbit = settled["touchdown"]
    assert walk.time[-1] == pytest.approx(100.0, abs=0.011)
    assert np.mean(np.diff(walk.touchdown_time)[-20:]) == pytest.approx(orbit.period, abs=1e-9)
    assert np.mean(np.diff(walk.touchdown_foot)[-20:]) == pytest.approx(orbit.step_length, abs=1e-9)


def test_newton_comes_back_from_nearby(x64, walker, settled):
    _, orbit = settled["touchdown"]
    found = fixed_point(walker, np.add(orbit.points[0], (1e-3, -2e-3, 5e-3)))
    assert found.found
    np.testing.assert_allclose(found.y, orbit.points[0], atol=1e-10)
    assert not fixed_point(walker, (0.3, 3.0, 0.0)).found


def test_a_gait_of_two_steps_is_told_from_one_of_one(x64):
    loops = stacked([loop_of(TWO_STEPS)])
    walks = settle(loops, np.array([START]), "touchdown")
    (orbit,) = find_orbits(loops, walks, "touchdown")
    assert (orbit.kind, orbit.num_steps) == ("periodic", 2)
    first, second = orbit.points
    assert np.max(np.abs(np.subtract(first, second))) > 1e-2
    after, _, _ = follow(loops, np.array([first]), np.array([1]))
    np.testing.assert_allclose(after[0], second, atol=1e-10)


def test_a_walker_that_falls_has_no_orbit(x64):
    loops = stacked([loop_of(FALLS)])
    for clock in ("free", "touchdown"):
        walks = settle(loops, np.array([START]), clock)
        assert not walks[0].up
        assert walks[0].seconds < 10
        (orbit,) = find_orbits(loops, walks, clock)
        assert (orbit.kind, orbit.num_steps, orbit.points) == ("none", 0, ())
    assert stabilities(loops, [orbit]) == [None]
