"""The baselines give the figures that are known of them."""

import functools
import inspect
import math

import numpy as np
import pytest

from coachable.envs.baselines import baseline
from coachable.foundation.errors import ParameterError
from coachable.plants import CompassParameters
from coachable.rewards.setup import TERM_NAMES, paper_setup

report_of = functools.cache(baseline)


@pytest.mark.parametrize(
    ("semantics", "hip_x", "foot_x", "touchdowns", "period", "step_length", "speed", "rewards"),
    [
        ("paper", 7.8334, 7.6517, 13, 0.7477, 0.5895, 0.788, (7.832, 17.832, 17.332, 17.582)),
        ("released-code", 8.2157, 8.2496, 14, 0.7162, 0.5916, 0.826, (8.249, 18.239, 17.679, 17.959)),
    ],
)
def test_virtual_gravity(semantics, hip_x, foot_x, touchdowns, period, step_length, speed, rewards):
    report = report_of("virtual-gravity", semantics)
    assert not report.fell
    assert report.touchdowns == touchdowns
    assert round(report.hip_x, 4) == hip_x
    assert round(report.foot_x, 4) == foot_x
    assert report.period == pytest.approx(period, abs=1.5e-4)
    assert report.step_length == pytest.approx(step_length, abs=1e-4)
    assert report.speed == pytest.approx(speed, abs=5e-4)
    assert list(report.rewards) == ["sparse", "forward", "orthant", "forward+orthant"]
    assert tuple(round(reward, 3) for reward in report.rewards.values()) == rewards


def test_share_of_samples_in_the_cycle():
    assert report_of("virtual-gravity", "paper").share_in_cycle == 0.975


def test_constant_torque_walks_further():
    report = report_of("constant-torque", "paper")
    assert round(report.hip_x, 2) == 8.73
    assert not report.fell


def test_without_torque_the_walker_falls():
    report = report_of("none", "paper")
    assert report.fell
    assert report.trajectory.time[-1] < 10
    assert report.rewards["sparse"] == pytest.approx(-10)
    assert np.isnan(report.period)


def test_trajectory_has_a_row_a_sample_and_explains_the_reward():
    report = report_of("virtual-gravity", "paper")
    trajectory = report.trajectory
    columns = trajectory.columns()
    assert {len(column) for column in columns.values()} == {1001}
    np.testing.assert_allclose(trajectory.time, 0.01 * np.arange(1001), atol=1e-12)
    start = [trajectory.theta_1[0], trajectory.theta_2[0], trajectory.dtheta_1[0], trajectory.dtheta_2[0]]
    assert start == [0.0, 0.0, -0.4, 2.0]
    assert (trajectory.foot_x[0], trajectory.hip_x[0], trajectory.phase[0]) == (0, 0, 4)
    assert trajectory.hip_x[-1] == report.hip_x
    np.testing.assert_allclose(trajectory.hip_x, trajectory.foot_x - np.sin(trajectory.theta_1), atol=1e-12)
    for name, reward in report.rewards.items():
        paid = sum(
            weight * trajectory.terms[term].sum()
            for term, weight in zip(TERM_NAMES, paper_setup(name).weights, strict=True)
        )
        np.testing.assert_allclose(paid, reward, rtol=1e-12)


def test_torques_stand_in_the_row_where_they_begin():
    trajectory = report_of("virtual-gravity", "paper").trajectory
    pull = 9.807 * np.tan(-0.07)
    np.testing.assert_allclose(trajectory.u2[:-1], 0.25 * pull * np.cos(trajectory.theta_2[:-1]), rtol=1e-12)
    assert (trajectory.u1[-1], trajectory.u2[-1]) == (0, 0)
    assert all(values[-1] == 0 for values in trajectory.terms.values())


def test_one_stride_passes_the_phases_when_it_should():
    """Outside right after touchdown, O1 from 18 ms, O2 from 0.254 s, O3 from 0.475 s, O4 from 0.572 s."""
    trajectory = report_of("virtual-gravity", "paper").trajectory
    touchdowns = np.flatnonzero(np.diff(trajectory.foot_x)) + 1
    for first, last in zip(touchdowns[-4:-1], touchdowns[-3:], strict=True):
        phases = trajectory.phase[first:last]
        changes = np.flatnonzero(np.diff(phases)) + 1
        assert phases[np.r_[0, changes]].tolist() == [4, 0, 1, 2, 3]
        np.testing.assert_allclose(changes * 0.01, [0.018, 0.254, 0.475, 0.572], atol=0.0101)


def test_another_walker_has_another_baseline():
    assert report_of("virtual-gravity", "paper", CompassParameters(gravity=3.7), 1.0).hip_x < 0.6


def test_unknown_names_are_refused():
    unchecked = inspect.unwrap(baseline)  # as users have it, without the tests' type checks
    with pytest.raises(ParameterError, match=r"'virtual-gravty'.*virtual-gravity"):
        unchecked("virtual-gravty")


@pytest.mark.parametrize("seconds", [0.0, -1.0, math.nan, math.inf, 1e308])
def test_a_walk_without_an_end_is_refused_before_it_begins(seconds):
    with pytest.raises(ParameterError, match="seconds must be"):
        baseline("virtual-gravity", seconds=seconds)
