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
from coachable.foundation.errors import ParameterError
from coachable.plants import (
    START,
    CompassWalker,
    ConstantTorque,
    Event,
    NoTorque,
    Plant,
    VirtualGravity,
    advance,
)
from tests.plants.switching import Switching, random_starts, solved

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


AIR = bouncing(Edge("air", "air", "touchdown"), phases=(Phase("air", "", Comparison("height", ">", -100)),))


class BallOver(Ball):
    """The same ball over a floor at another height, and with a ceiling where one is given."""

    floor: float = 0.0
    speed_that_counts: float = math.inf

    @property
    def events(self):
        return (
            Event(
                name="touchdown",
                guard=lambda x: x[0] - self.floor,
                admissible=lambda x: (x[1] < 0) & (x[1] > -self.speed_that_counts),
                reset=lambda x: jnp.stack([x[0], -self.restitution * x[1]]),
            ),
        )


@pytest.mark.parametrize(("restitution", "floor"), [(0.5, 0.0), (0.5, 0.7), (0.0, 0.7)])
def test_a_ball_that_comes_to_rest_ends_the_execution_and_is_never_below_the_floor(restitution, floor):
    ball = BallOver(restitution=restitution, floor=floor)
    execution = execute(HybridAutomaton.of(AIR, ball), (floor + 0.1, 0.0), Push(), 2.0)
    assert execution.termination is Termination.ZENO
    assert execution.states[:, 0].min() >= floor - 1e-12
    flight = math.sqrt(0.2 / 9.81)
    assert execution.final_time == pytest.approx(flight * (1 + 2 * restitution / (1 - restitution)), rel=1e-5)


def test_a_guard_that_fell_through_zero_where_that_was_no_event_must_rise_first():
    """Too fast at the floor it falls on, though, braked, it would be slow enough a moment later."""
    ball = BallOver(floor=1.0, speed_that_counts=1.0)
    execution = execute(HybridAutomaton.of(AIR, ball), (1.0001, -1.005), Push(29.81), 0.06)
    assert execution.transitions == ()
    # Slow enough it bounces.
    execution = execute(HybridAutomaton.of(AIR, ball), (1.0001, -0.9), Push(29.81), 0.06)
    assert len(execution.transitions) == 1


@pytest.mark.parametrize(("dt", "depth"), [(0.05, 1e-3), (0.01, 1e-6), (0.05, 1e-9)])
def test_two_crossings_within_a_substep_are_not_missed(dt, depth):
    """Braked by 20 m/s² from above the floor the ball turns that far below it."""
    ball, time = BallOver(restitution=0.0, floor=0.0), 0.0312
    start = (10 * time**2 - depth, -20 * time)
    execution = execute(HybridAutomaton.of(AIR, ball), start, Push(29.81), 0.05, control_dt=dt)
    assert len(execution.transitions) == 1
    assert execution.transitions[0].time == pytest.approx(time - math.sqrt(depth / 10), abs=1e-9)


@pytest.mark.parametrize("seconds", [0.025, 0.03, 0.0])
def test_it_runs_for_its_full_time(seconds):
    execution = execute(HybridAutomaton.of(AIR, Ball()), (1.0, 0.0), Push(), seconds)
    assert execution.termination is Termination.COMPLETED
    assert execution.final_time == pytest.approx(seconds, abs=1e-15)
    assert execution.final_state[0] == pytest.approx(1 - 9.81 / 2 * seconds**2, abs=1e-12)


@pytest.mark.parametrize(
    ("seconds", "dt"),
    [(-1.0, 0.01), (math.nan, 0.01), (math.inf, 0.01), (1.0, 0.0), (1e308, 0.01), (1.0, 1e-300)],
)
def test_times_that_are_none_or_never_end_are_refused(seconds, dt):
    with pytest.raises(ParameterError, match=r"seconds|control_dt"):
        execute(HybridAutomaton.of(AIR, Ball()), (1.0, 0.0), Push(), seconds, dt)


class Corner(Ball):
    """A ball between a floor and a wall, without gravity: x and y, and how fast."""

    name = "the ball in the corner"
    state_names = ("x", "y", "dx", "dy")
    start = (1.0, 1.0, -1.0, -1.0)

    def flow(self, x, control):
        return jnp.stack([x[2], x[3], control[0], control[0]])

    @property
    def events(self):
        def bounce(axis):
            return lambda x: x.at[axis + 2].multiply(-1.0)

        return tuple(Event(name, lambda x, k=k: x[k], bounce(k)) for k, name in enumerate(("wall", "floor")))


def test_of_two_events_at_the_same_moment_both_happen(x64):
    start = (1.0, 1.0)
    phases = (Phase("in", "", Comparison("x", ">", -1)),)
    edges = (Edge("in", "in", "wall"), Edge("in", "in", "floor"))
    behaviour = Behaviour("corner", "", (Signal("x", "m"),), phases, edges)
    execution = execute(HybridAutomaton.of(behaviour, Corner()), (*start, -1.0, -1.0), Push(), 1.5)
    assert [str(transition.edge.event) for transition in execution.transitions] == ["wall", "floor"]
    np.testing.assert_allclose(execution.final_state, [1.5 - start[0], 1.5 - start[1], 1, 1], atol=1e-9)
    state, time = jnp.array([*start, -1.0, -1.0]), jnp.zeros(())
    for _ in range(3):
        state = eqx.filter_jit(advance)(Corner(), state, time, jnp.zeros(1), 0.5).x
    np.testing.assert_allclose(state, execution.final_state, atol=1e-9)


def test_events_are_where_a_solver_with_dense_output_finds_them():
    behaviour = dataclasses.replace(
        AIR, signals=(Signal("x"),), phases=(Phase("air", "", Comparison("x", ">", -9)),)
    )
    automaton, compared = HybridAutomaton.of(behaviour, Switching()), 0
    for start in random_starts(40):
        expected = solved(start, 0.5)
        if expected is not None and len(expected.touchdowns) > 1:
            execution = execute(automaton, start, Push(), 0.5, control_dt=0.05)
            found = [transition.time for transition in execution.transitions]
            np.testing.assert_allclose(found, expected.touchdowns, atol=1e-6)
            np.testing.assert_allclose(execution.final_state, expected.state, atol=1e-5)
            compared += 1
        if compared == 2:
            break
    assert compared == 2
