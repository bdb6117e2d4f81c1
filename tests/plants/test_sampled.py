"""The one sampled walk is its control steps taken by hand, whatever is remembered, disturbed or recorded."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.plants import START, CompassWalker, Outcome
from coachable.plants.sampled import SampledState, Sampling, sampled_step, sampled_walk, undisturbed

PLANT = CompassWalker()
CONTROLLER = PLANT.controllers()["constant-torque"]
FALLING = (0.2, 0.1, 1.0, 0.0)

pytestmark = pytest.mark.usefixtures("x64")
step = eqx.filter_jit(sampled_step)


def by_hand(sampling, x0, num_steps, control=lambda x, index: CONTROLLER(x)):
    state, taken = SampledState.at(jnp.asarray(x0)), []
    for index in range(num_steps):
        state, one = step(PLANT, sampling, state, control(state.x, index))
        taken.append(one)
        if one.fell:
            break
    return state, jax.tree.map(lambda *leaves: np.stack(leaves), *taken)


def everything(taken, memory):
    return memory, taken, taken.fell


@pytest.mark.parametrize("clock", ["free", "touchdown"])
@pytest.mark.parametrize("x0", [START, FALLING])
def test_a_walk_is_its_steps(clock, x0):
    sampling = Sampling(clock)
    _, expected = by_hand(sampling, x0, 250)
    length = len(expected.time)
    walk = jax.jit(lambda x0: sampled_walk(PLANT, sampling, undisturbed(CONTROLLER), x0, everything, 250))
    _, records, alive = walk(jnp.asarray(x0))
    assert alive.tolist() == [True] * length + [False] * (250 - length)
    assert (length < 250) == (x0 == FALLING)
    jax.tree.map(
        lambda ours, theirs: np.testing.assert_allclose(ours[:length], theirs, rtol=1e-9, atol=1e-9),
        records,
        expected,
    )
    for leaf in jax.tree.leaves(records):
        np.testing.assert_array_equal(leaf[length:], np.broadcast_to(leaf[length - 1], leaf[length:].shape))
    if clock == "touchdown" and x0 == START:
        assert expected.touched.sum() >= 2
        touched = expected.touched
        within = expected.time_before + expected.moved.touchdown_time
        np.testing.assert_allclose(expected.time[touched], within[touched])


def test_without_records_a_walk_ends_where_one_with_records_does():
    """Side by side, one that falls and one whose time is up; each as it is alone."""
    sampling = Sampling("touchdown")

    def observe(taken, count):
        return count + 1, taken, taken.fell | taken.time_is_up(1.5, sampling)

    def walk(num_steps):
        def one(x0):
            control = undisturbed(CONTROLLER)
            return sampled_walk(PLANT, sampling, control, x0, observe, num_steps, memory=jnp.zeros((), int))

        return jax.jit(jax.vmap(one))(jnp.array([START, FALLING]))

    count, last, alive = walk(None)
    assert alive is None
    count_too, records, alive = walk(sampling.num_steps(2.0))
    np.testing.assert_array_equal(count, count_too)
    np.testing.assert_array_equal(count, alive.sum(axis=1))
    assert last.moved.outcome.tolist() == [Outcome.WALKING, Outcome.FELL]
    assert last.time[0] == pytest.approx(1.5, abs=0.01)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b[:, -1], rtol=1e-9, atol=1e-9), last, records)


def test_a_control_may_be_late_and_pushed():
    """The torque of the step before, and one more given a step."""
    pushes = 0.2 * jnp.asarray(np.random.default_rng(0).normal(size=(60, 2)))
    gravity = PLANT.controllers()["virtual-gravity"]

    def late(x, before, push):
        return before + push, gravity(x)

    def held(taken, memory):
        return memory, (taken.control, taken.moved.x), taken.fell

    x0 = jnp.asarray(START)
    _, (controls, states), alive = jax.jit(
        lambda: sampled_walk(PLANT, Sampling(), late, x0, held, 60, memory=gravity(x0), inputs=pushes)
    )()
    assert alive.all()
    seen = [x0, x0, *states]
    _, expected = by_hand(Sampling(), START, 60, lambda x, index: gravity(seen[index]) + pushes[index])
    np.testing.assert_allclose(controls, expected.control, rtol=1e-9)
    np.testing.assert_allclose(states, expected.moved.x, rtol=1e-9, atol=1e-9)


def test_chatter_is_counted_across_short_steps_only_where_they_are_short():
    about_to_touch_down = replace(
        SampledState.at(jnp.array([-0.298, 0.302, -1.46, -0.90])),
        touchdowns_in_a_row=jnp.asarray(2, jnp.int32),
    )
    for clock, outcome in (("touchdown", Outcome.CHATTERED), ("free", Outcome.WALKING)):
        after, taken = step(PLANT, Sampling(clock), about_to_touch_down, jnp.zeros(2))
        assert taken.touched
        assert taken.moved.outcome == outcome
    assert (after.full_steps, after.touchdowns_in_a_row) == (1, 0)
