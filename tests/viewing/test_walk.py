from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.plants.compass import CompassParameters, CompassWalker
from coachable.viewing.walk import Walk, runs_of

PARAMETERS = CompassParameters(a=0.3, b=0.9)


@pytest.mark.usefixtures("x64")
def test_hip_and_swing_foot_are_where_the_plant_has_them():
    rng = np.random.default_rng(0)
    theta_1, theta_2, foot_x = rng.uniform(-1.5, 1.5, size=(3, 20))
    walk = Walk.of(
        {
            "t": np.arange(20.0),
            "theta_1": theta_1,
            "theta_2": theta_2,
            "foot_x": foot_x,
            "phase": np.zeros(20),
        },
        PARAMETERS,
    )
    plant = CompassWalker(PARAMETERS)
    x = jnp.stack([theta_1, theta_2, jnp.zeros(20), jnp.zeros(20)], axis=-1)
    np.testing.assert_allclose(walk.hip, jax.vmap(plant.hip)(x, jnp.asarray(foot_x)), atol=1e-12)
    np.testing.assert_allclose(
        walk.swing_foot, jax.vmap(plant.swing_foot)(x, jnp.asarray(foot_x)), atol=1e-12
    )


def distance(first, second):
    return np.linalg.norm(first - second, axis=-1)


def test_masses_are_on_their_legs(columns):
    walk = Walk.of(columns, PARAMETERS)
    for foot, mass in ((walk.stance_foot, walk.stance_mass), (walk.swing_foot, walk.swing_mass)):
        np.testing.assert_allclose(distance(foot, mass), PARAMETERS.a)
        np.testing.assert_allclose(distance(mass, walk.hip), PARAMETERS.b)
        np.testing.assert_allclose(distance(foot, walk.hip), PARAMETERS.leg_length)


def test_a_leg_keeps_its_identity_across_touchdowns(columns):
    walk = Walk.of(columns)
    first_foot = np.where(walk.first_leg_stands[:, None], walk.stance_foot, walk.swing_foot)
    assert walk.touched_down.sum() == 13
    assert distance(walk.stance_foot[1:], walk.stance_foot[:-1]).max() > 0.5  # the role changes hands
    assert distance(first_foot[1:], first_foot[:-1]).max() < 0.06  # the foot does not jump


def test_a_rollout_and_its_stored_columns_are_one_walk(trajectory, columns):
    fresh, stored = Walk.of(trajectory), Walk.of(columns)
    for name, value in vars(fresh).items():
        np.testing.assert_array_equal(value, getattr(stored, name))


def test_samples_that_are_not_finite_are_left_out(columns):
    broken = {name: np.array(column) for name, column in columns.items()}
    broken["theta_2"][-3:] = np.nan
    walk = Walk.of(broken)
    assert len(walk.time) == len(columns["t"]) - 3
    assert np.isfinite(walk.swing_foot).all()


def test_at_is_the_last_sample_not_after(columns):
    walk = Walk.of(columns)
    assert walk.at(0.999) == 99
    assert walk.at(1.0) == 100
    assert walk.at(-1.0) == 0
    assert walk.at(1e9) == len(walk.time) - 1
    assert walk.progress(0) == 0
    assert walk.progress(walk.at(5.0)) == pytest.approx(0.5)
    assert walk.progress(len(walk.time)) == 1


def test_a_part_is_those_samples(columns):
    walk = Walk.of(columns).part(100, 200)
    assert walk.time[0] == pytest.approx(1.0)
    assert walk.seconds == pytest.approx(0.99)
    assert len(walk.hip) == 100


@given(st.lists(st.integers(0, 3), min_size=1, max_size=40))
def test_stretches_make_up_the_sequence(values):
    stretches = runs_of(np.array(values))
    assert [value for value, start, stop in stretches for _ in range(start, stop)] == values
    assert all(one[0] != other[0] for one, other in pairwise(stretches))
