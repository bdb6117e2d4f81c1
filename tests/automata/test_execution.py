import dataclasses
import math
import re

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.automata.execution import Termination, execute
from coachable.automata.hybrid import HybridAutomaton
from coachable.behaviours import All, Behaviour, Comparison, Edge, Phase, Signal, load_behaviour
from coachable.plants import START, CompassWalker, ConstantTorque, Event, NoTorque, Plant, VirtualGravity

WALKER = CompassWalker()
GRAVITY = VirtualGravity(WALKER)
WALKING = load_behaviour("compass-walking")
IN_O1 = (0.25, -0.29, -1.0, 0.5)


def is_in(behaviour, location, state):
    values = dict(zip(behaviour.signal_names, state, strict=True))
    return behaviour.phase_at(values) == location


def test_the_papers_start_is_in_no_location():
    execution = execute(HybridAutomaton.of(WALKING, WALKER), START, GRAVITY, 10.0)
    assert execution.termination is Termination.START_OUTSIDE
    assert "x0 is in no location" in execution.sentence
    assert execution.times.shape == (0,)
    assert execution.states.shape == (0, 4)
    np.testing.assert_array_equal(execution.final_state, START)


@pytest.fixture(scope="module")
def deadlocked():
    return execute(HybridAutomaton.of(WALKING, WALKER), IN_O1, GRAVITY, 10.0)


def test_ideal_walking_is_stuck_at_the_first_touchdown(deadlocked):
    assert deadlocked.termination is Termination.DEADLOCK
    assert [str(transition.edge) for transition in deadlocked.transitions] == [
        "O1 → O2",
        "O2 → O3",
        "O3 → O4",
    ]
    theta_1, theta_2, dtheta_1, dtheta_2 = deadlocked.final_state
    assert theta_1 > 0
    assert theta_2 <= 0
    assert dtheta_1 <= 0
    assert dtheta_2 < 0
    assert "On touchdown in O4" in deadlocked.sentence
    assert "O4 → O1 on touchdown needs swing leg swings forward (dtheta_2 > 0)" in deadlocked.sentence
    assert f"t = {deadlocked.final_time:.4f} s" in deadlocked.sentence


def test_the_deadlock_is_at_the_touchdown_where_the_foot_is_on_the_ground(deadlocked, x64):
    before = deadlocked.states[-1]
    assert math.cos(before[0]) - math.cos(before[1]) == pytest.approx(0, abs=1e-14)
    np.testing.assert_array_equal(WALKER.impact(jnp.asarray(before)), deadlocked.final_state)


def test_every_row_is_in_its_location_until_the_moment_it_is_left(deadlocked):
    times, locations = deadlocked.times, deadlocked.locations
    assert np.all(np.diff(times) >= 0)
    leaving = [row for row in range(len(times) - 1) if times[row] == times[row + 1]]
    assert [locations[row] for row in leaving] == ["O1", "O2", "O3"]
    for row, state in enumerate(deadlocked.states):
        assert is_in(WALKING, locations[row], state) != (row in leaving)


def walking_with_a_fifth_phase():
    """Ideal walking as the gait really goes: right after touchdown the swing leg still moves backward."""
    signs = {"theta_1": ">", "theta_2": "<=", "dtheta_1": "<=", "dtheta_2": "<="}
    fifth = Phase("O5", "", All(*(Comparison(name, relation, 0) for name, relation in signs.items())))
    edges = (*WALKING.edges[:3], Edge("O4", "O5", "touchdown"), Edge("O5", "O1"))
    return dataclasses.replace(WALKING, phases=(*WALKING.phases, fifth), edges=edges, cycles=())


def test_with_the_fifth_orthant_the_gait_walks_through_the_whole_cycle():
    execution = execute(HybridAutomaton.of(walking_with_a_fifth_phase(), WALKER), IN_O1, GRAVITY, 2.0)
    assert execution.termination is Termination.COMPLETED, execution.sentence
    assert execution.final_time == 2.0
    taken = [(transition.edge.source, transition.edge.target) for transition in execution.transitions]
    cycle = [("O1", "O2"), ("O2", "O3"), ("O3", "O4"), ("O4", "O5"), ("O5", "O1")]
    assert taken == [cycle[index % 5] for index in range(len(taken))]
    assert len(taken) >= 10


class Ball(Plant):
    """A ball that bounces; it flies along parabolas, and those Runge–Kutta integrates exactly."""

    parameters: None = None
    restitution: float = 0.8
    lift: float = 0.0

    name = "the ball"
    state_names = ("height", "speed")
    control_names = ("push",)
    start = (1.0, 0.0)
    action_box = ((-1.0,), (1.0,))

    def flow(self, x, control):
        return jnp.stack([x[1], control[0] - 9.81])

    @property
    def events(self):
        return (
            Event(
                name="touchdown",
                guard=lambda x: x[0],
                admissible=lambda x: x[1] < 0,
                reset=lambda x: jnp.stack([x[0] * 0 + self.lift, -self.restitution * x[1]]),
            ),
        )

    def fall_margin(self, x):
        return 5.0 - x[0]

    def base(self, x, foot_x):
        return jnp.stack([foot_x, x[0]])


class Push(eqx.Module):
    force: float = 0.0

    def __call__(self, x):
        return jnp.full((1,), self.force)


RISES, FALLS = Comparison("speed", ">=", 0), Comparison("speed", "<", 0)


DOWN, UP = Phase("down", "", FALLS), Phase("up", "", RISES)


def bouncing(*edges, phases=(DOWN, UP)):
    signals = (Signal("height", "m"), Signal("speed", "m/s"))
    return Behaviour("bouncing", "", signals, phases, edges)


DOWN_UP, UP_DOWN = Edge("down", "up", "touchdown"), Edge("up", "down")


def test_a_ball_bounces_when_the_formula_says():
    execution = execute(HybridAutomaton.of(bouncing(DOWN_UP, UP_DOWN), Ball()), (1.0, -1.0), Push(), 1.7)
    assert execution.termination is Termination.COMPLETED
    speed = math.sqrt(1 + 2 * 9.81)
    bounces, tops, time = [], [], (speed - 1) / 9.81
    while time < 1.7:
        bounces.append(time)
        speed *= 0.8
        tops.append(time + speed / 9.81)
        time += 2 * speed / 9.81
    found = {edge: [t.time for t in execution.transitions if t.edge == edge] for edge in (DOWN_UP, UP_DOWN)}
    np.testing.assert_allclose(found[DOWN_UP], bounces, rtol=1e-12)
    np.testing.assert_allclose(found[UP_DOWN], [top for top in tops if top < 1.7], rtol=1e-12)


def test_the_control_is_held_from_sample_to_sample():
    behaviour = bouncing(Edge("down", "up"))

    class Brake(eqx.Module):
        def __call__(self, x):
            return jnp.where(x[1] < -1.0, 9.81, 19.81)[None]

    # Constant speed while braked weakly: −1 − 0.2 m/s stays until the end.
    execution = execute(HybridAutomaton.of(behaviour, Ball()), (4.0, -1.2), Brake(), 0.5, control_dt=0.1)
    np.testing.assert_allclose(execution.final_state, [4.0 - 0.6, -1.2], rtol=1e-12)
    # Braked with 10 m/s² from −1 m/s it stops after exactly one sample of 0.1 s, and goes on as `up`.
    execution = execute(HybridAutomaton.of(behaviour, Ball()), (4.0, -1.0), Brake(), 0.2, control_dt=0.1)
    assert [str(transition.edge) for transition in execution.transitions] == ["down → up"]
    assert execution.transitions[0].time == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("edges", "termination", "words"),
    [
        ([UP_DOWN], Termination.DEADLOCK, "On touchdown in down .*there is no edge for that"),
        ([DOWN_UP], Termination.DEADLOCK, "Leaving up .*there is no edge for that"),
        (
            [Edge("down", "down", "touchdown")],
            Termination.DEADLOCK,
            "down → down on touchdown needs speed < 0",
        ),
    ],
)
def test_a_deadlock_says_what_is_missing(edges, termination, words):
    execution = execute(HybridAutomaton.of(bouncing(*edges), Ball()), (1.0, -1.0), Push(), 2.0)
    assert execution.termination is termination
    assert np.all(execution.times <= execution.final_time)
    assert not np.isnan(execution.final_state).any()
    assert re.search(words, execution.sentence)


def test_two_ways_to_go_on_are_nondeterminism():
    fast = Phase("fast", "", Comparison("speed", ">", 1))
    behaviour = bouncing(DOWN_UP, Edge("down", "fast", "touchdown"), phases=(DOWN, UP, fast))
    automaton = HybridAutomaton.of(behaviour, Ball())
    execution = execute(automaton, (1.0, -1.0), Push(), 2.0)
    assert execution.termination is Termination.NONDETERMINISM
    assert "down → up on touchdown and down → fast on touchdown" in execution.sentence
    assert "On touchdown in down at (height = " in execution.sentence
    at_start = execute(automaton, (1.0, 2.0), Push(), 2.0)
    assert at_start.termination is Termination.NONDETERMINISM
    assert "is in up and in fast" in at_start.sentence


def test_bounces_without_end_are_named():
    # The impact puts the ball 1e-9 m above the ground and lets it fall on at full speed.
    ball = Ball(restitution=-1.0, lift=1e-9)
    behaviour = bouncing(Edge("down", "down", "touchdown"))
    execution = execute(HybridAutomaton.of(behaviour, ball), (0.5, -1.0), Push(), 2.0)
    assert execution.termination is Termination.ZENO
    assert execution.final_time == pytest.approx((math.sqrt(1 + 9.81) - 1) / 9.81, rel=1e-5)


def test_a_fall_ends_the_execution():
    behaviour = bouncing(DOWN_UP)
    execution = execute(HybridAutomaton.of(behaviour, Ball()), (4.0, 1.0), Push(force=9.81), 2.0)
    assert execution.termination is Termination.FELL
    assert execution.final_time == pytest.approx(1.0)


def test_a_state_that_leaves_the_numbers_ends_the_execution():
    class Bad(eqx.Module):
        def __call__(self, x):
            return jnp.where(x[0] < 0.9, jnp.nan, 0.0)[None]

    execution = execute(HybridAutomaton.of(bouncing(DOWN_UP), Ball()), (1.0, -1.0), Bad(), 2.0)
    assert execution.termination is Termination.NOT_FINITE
    assert np.isfinite(execution.final_state).all()
    assert np.isfinite(execution.states).all()


class Feedback(eqx.Module):
    gains: np.ndarray

    def __call__(self, x):
        return self.gains @ x


@pytest.mark.parametrize(
    "controller", [NoTorque(2), ConstantTorque((-1.35, -0.18)), Feedback(np.zeros((2, 4)))]
)
def test_every_controller_can_be_executed(controller):
    execution = execute(HybridAutomaton.of(WALKING, WALKER), np.array(IN_O1), controller, 0.05)
    assert execution.termination is Termination.COMPLETED


def test_every_status_has_a_sentence():
    for termination in Termination:
        assert termination.sentence[0].isalpha()
        assert termination.sentence.endswith(".")
