"""Any number of events: none, two that take turns, and which of two comes first, against sums by hand."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from coachable import plants
from coachable.plants import ChatterRule, Dynamics, Event, Outcome
from tests.plants.switching import Switching, random_starts, solved

advance = eqx.filter_jit(plants.advance)
pytestmark = pytest.mark.usefixtures("x64")


class Drifting(Dynamics):
    """ẍ = u, and nothing in the way."""

    def flow(self, x, control):
        return jnp.stack([x[1], control[0]])


class Between(Drifting):
    """The same between a floor at 0, whose bounces are touchdowns, and a ceiling at 1, whose are not."""

    softness: float = eqx.field(static=True, default=0.5)

    @property
    def events(self):
        def bounce(x):
            return jnp.stack([x[0], -self.softness * x[1]])

        return (
            Event("floor", guard=lambda x: x[0], reset=bounce, displacement=lambda x: jnp.ones_like(x[0])),
            Event("ceiling", guard=lambda x: 1 - x[0], reset=bounce, restarts_clock=False),
        )


def drift(x, duration, plant=None, **options):
    return advance(plant or Between(), jnp.array(x), jnp.zeros(()), jnp.zeros(1), duration, **options)


def test_without_events_it_flows_on():
    moved = drift([3.0, -2.0], 4.0, Drifting())
    np.testing.assert_allclose(moved.x, [-5.0, -2.0], atol=1e-14)
    assert (moved.touchdowns, moved.outcome, moved.elapsed) == (0, Outcome.WALKING, 4.0)


@pytest.mark.parametrize("num_substeps", [1, 3, 10])
def test_two_events_take_turns(num_substeps):
    """From 0.5 at speed 1: the ceiling at 0.5 s, the floor 2 s later, the ceiling 4 s after that."""
    moved = drift([0.5, 1.0], 8.0, num_substeps=num_substeps)
    np.testing.assert_allclose(moved.x, [1 - 1.5 / 8, -1 / 8], atol=1e-12)
    assert (moved.touchdowns, moved.foot_x) == (1, 1)
    np.testing.assert_allclose(moved.touchdown_time, 2.5, atol=1e-12)
    np.testing.assert_allclose(moved.segment_x, [0.0, 0.25], atol=1e-12)


def test_only_an_event_that_restarts_the_clock_ends_the_step():
    moved = drift([0.5, 1.0], 8.0, stop_at_touchdown=True)
    np.testing.assert_allclose(moved.elapsed, 2.5, atol=1e-12)
    np.testing.assert_allclose(moved.x, [0.0, 0.25], atol=1e-12)


def test_only_an_event_that_restarts_the_clock_is_chatter():
    elastic, rule = Between(softness=1.0), ChatterRule(max_touchdowns=2)
    assert drift([0.5, 1.0], 5.0, elastic, chatter=rule).outcome == Outcome.WALKING
    chattered = drift([0.5, 1.0], 7.0, elastic, chatter=rule)
    assert (chattered.outcome, chattered.touchdowns) == (Outcome.CHATTERED, 3)
    np.testing.assert_allclose(chattered.elapsed, 5.5, atol=1e-12)


def test_other_events_that_pile_up_are_chatter():
    pressed = advance(Between(), jnp.array([0.9, 0.0]), jnp.zeros(()), jnp.ones(1), 10.0)
    assert (pressed.outcome, pressed.touchdowns) == (Outcome.CHATTERED, 0)
    # Bounces at t₁, 2 t₁, 2.5 t₁, …: they pile up at 3 t₁ with t₁ = √0.2.
    np.testing.assert_allclose(pressed.elapsed, 3 * np.sqrt(0.2), atol=1e-6)


def test_the_earlier_of_two_events_in_one_substep_happens():
    class Crossing(Drifting):
        @property
        def events(self):
            def at(height, jump):
                return Event(
                    f"at {height}", guard=lambda x: height - x[0], reset=lambda x: jnp.stack([jump, x[1]])
                )

            return at(0.8, jnp.array(-10.0)), at(0.6, jnp.array(-20.0)), at(0.7, jnp.array(-30.0))

    moved = drift([0.0, 1.0], 1.0, Crossing())
    np.testing.assert_allclose(moved.x, [-20 + 0.4, 1.0], atol=1e-12)
    np.testing.assert_allclose(moved.touchdown_time, 0.6, atol=1e-12)


def test_random_systems_move_as_a_solver_with_dense_output_says():
    compared, touchdowns, still = 0, 0, (jnp.zeros(()), jnp.zeros(1))
    for start in random_starts(40):
        expected = solved(start, 1.0)
        if expected is not None:
            x, found = jnp.asarray(start), []
            for step in range(20):
                moved = advance(Switching(), x, *still, 0.05, num_substeps=20, chatter=ChatterRule(None))
                x = moved.x
                found += [0.05 * step + float(moved.touchdown_time)] * (int(moved.touchdowns) > 0)
            np.testing.assert_allclose(x, expected.state, atol=1e-5)
            # The last touchdown of a step is known, and not those before it.
            last = {int(time / 0.05): time for time in expected.touchdowns}
            np.testing.assert_allclose(found, [*last.values()], atol=1e-6)
            compared, touchdowns = compared + 1, touchdowns + len(found)
    assert compared >= 30
    assert touchdowns >= 30
