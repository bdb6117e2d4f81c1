import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.automata.tracker import Move
from coachable.behaviours import load_behaviour
from coachable.rewards.forms import form_of
from coachable.rewards.setup import PAPER_SETUPS, TERM_NAMES, Semantics
from coachable.rewards.terms import StepFacts, full_reward, r_dist, r_fall, r_for, r_jerk, reward_terms

BOTH: tuple[Semantics, ...] = ("paper", "released-code")
FORM_OF = {"paper": "stay", "released-code": "released"}
BEHAVIOUR_OF = {"paper": "compass-walking", "released-code": "compass-walking-released"}
TORQUES = st.tuples(st.floats(-2, 2, allow_subnormal=False), st.floats(-2, 2, allow_subnormal=False)).map(
    np.array
)


NONE_YET = 5


def facts(semantics, **changes):
    """O1 → O2, the hip 1 cm ahead, torques changed by (3, 4) N m, in the middle of an episode."""
    values = {
        "previous": 0,
        "location": 1,
        "hip_x": 0.51,
        "previous_hip_x": 0.5,
        "foot_x": 0.4,
        "control": [3.0, 4.0],
        "previous_control": [0.0, 0.0],
        "first": False,
        "fell": False,
        "time_is_up": False,
    }
    arrays = {name: jnp.asarray(value) for name, value in (values | changes).items()}
    move = Move(arrays.pop("previous"), arrays.pop("location"))
    r_or = form_of(FORM_OF[semantics]).bind(load_behaviour(BEHAVIOUR_OF[semantics]), None).r_or(move)
    return StepFacts(
        r_or=r_or.astype(arrays["hip_x"].dtype), unseen=jnp.asarray(move.previous == NONE_YET), **arrays
    )


def terms(semantics, **changes):
    values = reward_terms(facts(semantics, **changes), semantics)
    return dict(zip(TERM_NAMES, values.tolist(), strict=True))


@pytest.mark.parametrize(("moved", "paid"), [(1e-6, 1), (0.0, -1), (-0.0, -1), (-1e-6, -1), (np.nan, -1)])
def test_forward_pays_for_moving_and_standing_still_is_not_moving(moved, paid):
    assert r_for(jnp.asarray(moved), jnp.asarray(0.0)) == paid


@given(TORQUES, TORQUES)
def test_jerk_is_the_length_of_the_change_or_its_square(now, before):
    with jax.enable_x64(True):
        length = r_jerk(jnp.asarray(now), jnp.asarray(before), "paper")
        square = r_jerk(jnp.asarray(now), jnp.asarray(before), "released-code")
    np.testing.assert_allclose(length, np.hypot(*(now - before)), rtol=1e-14, atol=1e-150)
    np.testing.assert_allclose(square, np.sum(np.square(before - now)), rtol=1e-14, atol=1e-300)


@pytest.mark.parametrize(
    ("time_is_up", "fell", "paper", "released"), [(0, 0, 0, 0), (0, 1, 0, 7), (1, 0, 8, 7), (1, 1, 0, 7)]
)
def test_distance_is_paid_when_the_episode_ends(time_is_up, fell, paper, released):
    for semantics, paid in zip(BOTH, (paper, released), strict=True):
        ends = jnp.asarray(bool(time_is_up)), jnp.asarray(bool(fell))
        assert r_dist(jnp.asarray(8.0), jnp.asarray(7.0), *ends, semantics) == paid


def test_falling_pays_one():
    assert r_fall(jnp.asarray(True)) == 1
    assert r_fall(jnp.asarray(False)) == 0


def test_the_terms_come_in_their_order():
    assert terms("paper") == {"jerk": 5, "distance": 0, "fall": 0, "forward": 1, "orthant": 1}
    assert terms("released-code") == {"jerk": 25, "distance": 0, "fall": 0, "forward": 1, "orthant": 1}
    end = {"time_is_up": True, "hip_x": 8.0, "foot_x": 7.0}
    assert terms("paper", **end) == {"jerk": 5, "distance": 8, "fall": 0, "forward": 1, "orthant": 1}
    assert terms("released-code", fell=True, **end) == {
        "jerk": 25,
        "distance": 7,
        "fall": 1,
        "forward": 1,
        "orthant": 1,
    }


def test_first_step_of_an_episode_in_the_paper():
    # x₀ is outside, so O1 is entered from outside; the hip's start counts; there was no torque before.
    first = terms("paper", first=True, location=0, previous=4)
    assert first == {"jerk": 0, "distance": 0, "fall": 0, "forward": 1, "orthant": 1}


def test_first_step_of_a_run_of_the_released_code():
    assert terms("released-code", first=True, previous=NONE_YET) == dict.fromkeys(TERM_NAMES, 0)


def test_first_step_of_a_later_episode_of_the_released_code():
    # The last torque and the last orthant are those of the episode before; the last hip is forgotten.
    later = terms("released-code", first=True, location=3, previous=0)
    assert later == {"jerk": 25, "distance": 0, "fall": 0, "forward": 0, "orthant": -1}


@pytest.mark.parametrize("semantics", BOTH)
@pytest.mark.parametrize("x64", [False, True])
def test_terms_have_the_dtype_of_the_state_also_under_jit_and_vmap(semantics, x64):
    with jax.enable_x64(x64), jax.numpy_dtype_promotion("strict"):
        batch = jax.tree.map(lambda leaf: jnp.stack([leaf] * 3), facts(semantics))
        values = jax.jit(jax.vmap(lambda fact: reward_terms(fact, semantics)))(batch)
        assert values.shape == (3, 5)
        assert values.dtype == (jnp.float64 if x64 else jnp.float32)


def test_the_full_reward_is_the_weighted_sum():
    values = jnp.array([5.0, 8.0, 0.0, 1.0, -1.0])
    for setup in PAPER_SETUPS.values():
        expected = sum(weight * value for weight, value in zip(setup.weights, values.tolist(), strict=True))
        np.testing.assert_allclose(full_reward(jnp.array(setup.weights), values), expected, rtol=1e-6)
