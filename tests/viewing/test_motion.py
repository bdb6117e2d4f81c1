from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.drawing.motion import runs_of
from coachable.foundation.errors import ParameterError
from coachable.plants.compass import CompassParameters, CompassWalker
from coachable.plants.skeleton import PointMass, Segment, Skeleton

PARAMETERS = CompassParameters(a=0.3, b=0.9)


@pytest.mark.usefixtures("x64")
def test_hip_and_swing_foot_are_where_the_plant_has_them():
    rng = np.random.default_rng(0)
    plant, states, foot_x = CompassWalker(PARAMETERS), rng.uniform(-1.5, 1.5, (20, 4)), rng.uniform(size=20)
    points, place = plant.kinematics(states, foot_x), plant.skeleton.place
    x = jnp.asarray(states)
    np.testing.assert_allclose(
        points[:, place("hip")], jax.vmap(plant.base)(x, jnp.asarray(foot_x)), atol=1e-12
    )
    np.testing.assert_allclose(
        points[:, place("swing_foot")], jax.vmap(plant.swing_foot)(x, jnp.asarray(foot_x)), atol=1e-12
    )
    np.testing.assert_array_equal(points[:, place("stance_foot")], np.stack([foot_x, 0 * foot_x], axis=-1))


def distance(first, second):
    return np.linalg.norm(first - second, axis=-1)


def test_masses_are_on_their_legs(columns, motion_of):
    motion = motion_of(columns, PARAMETERS)
    for role in ("stance", "swing"):
        foot, mass = motion.point(f"{role}_foot"), motion.point(f"{role}_mass")
        np.testing.assert_allclose(distance(foot, mass), PARAMETERS.a)
        np.testing.assert_allclose(distance(mass, motion.base), PARAMETERS.b)
        np.testing.assert_allclose(distance(foot, motion.base), PARAMETERS.leg_length)


def test_a_leg_keeps_its_identity_across_touchdowns(motion):
    stance_foot, swing_foot = motion.point("stance_foot"), motion.point("swing_foot")
    first_stands = np.array([motion.skeleton.stands_first(0, int(count)) for count in motion.touchdowns])
    first_foot = np.where(first_stands[:, None], stance_foot, swing_foot)
    assert motion.touched_down.sum() == 13
    assert distance(stance_foot[1:], stance_foot[:-1]).max() > 0.5  # the role changes hands
    assert distance(first_foot[1:], first_foot[:-1]).max() < 0.06  # the foot does not jump


def test_samples_that_are_not_finite_are_left_out(columns, motion_of):
    for name, value in (("theta_2", np.nan), ("theta_1", np.inf), ("foot_x", np.nan), ("t", np.nan)):
        broken = {name: np.array(column) for name, column in columns.items()}
        broken[name][-3:] = value
        motion = motion_of(broken)
        assert len(motion.time) == len(columns["t"]) - 3
        assert np.isfinite(motion.points).all()


@given(st.integers(1, 9), st.integers(0, 40))
def test_legs_take_turns(num_legs, touchdowns):
    """Exactly one leg is the one that stood first, and the next touchdown moves every leg one number down."""
    spokes = tuple(Segment(("rim", "hub"), leg) for leg in range(num_legs))
    skeleton = Skeleton(("hub", "rim"), "hub", spokes, height=1.0)
    (now,) = (leg for leg in range(num_legs) if skeleton.stands_first(leg, touchdowns))
    (then,) = (leg for leg in range(num_legs) if skeleton.stands_first(leg, touchdowns + 1))
    assert then == (now - 1) % num_legs
    assert skeleton.stands_first(0, 0)
    assert skeleton.stands_first(None, touchdowns)


def test_parts_are_listed_from_the_back_to_the_front():
    body, stance, swing = Segment(("hip", "head")), Segment(("foot", "hip"), 0), Segment(("toe", "hip"), 1)
    head, toe = PointMass("head", 2.0), PointMass("toe", 1.0, 1)
    skeleton = Skeleton(("hip", "head", "foot", "toe"), "hip", (body, stance, swing), 1.0, (head, toe))
    assert skeleton.parts == (swing, toe, stance, body, head)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"base": "hib"}, "no point 'hib'; did you mean 'hip'"),
        ({"segments": (Segment(("foot", "knee"), 0),)}, "no point 'knee'"),
        ({"segments": (Segment(("foot", "hip"), 1),)}, r"numbered 0, 1, …, but .* \[1\]"),
        ({"masses": (PointMass("hip", 0.0),)}, "the mass must be positive"),
        ({"height": float("inf")}, "the height must be positive and finite"),
    ],
)
def test_a_skeleton_that_does_not_fit_together_is_refused(change, message):
    fields = {
        "points": ("hip", "foot"),
        "base": "hip",
        "segments": (Segment(("foot", "hip"), 0),),
        "height": 1.0,
    }
    with pytest.raises(ParameterError, match=message):
        Skeleton(**(fields | change))


def test_at_is_the_last_sample_not_after(motion):
    assert motion.at(0.999) == 99
    assert motion.at(1.0) == 100
    assert motion.at(-1.0) == 0
    assert motion.at(1e9) == len(motion.time) - 1
    assert motion.progress(0) == 0
    assert motion.progress(motion.at(5.0)) == pytest.approx(0.5)
    assert motion.progress(len(motion.time)) == 1


def test_a_part_is_those_samples(motion):
    part = motion.part(100, 200)
    assert part.time[0] == pytest.approx(1.0)
    assert part.seconds == pytest.approx(0.99)
    assert len(part.points) == 100
    assert part.skeleton == motion.skeleton


@given(st.lists(st.integers(0, 3), min_size=1, max_size=40))
def test_stretches_make_up_the_sequence(values):
    stretches = runs_of(np.array(values))
    assert [value for value, start, stop in stretches for _ in range(start, stop)] == values
    assert all(one[0] != other[0] for one, other in pairwise(stretches))
