"""The locations of one run in plain floats are those of columns of arrays, to the last bit."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.automata.decision_diagram import DecisionDiagram
from coachable.automata.tracker import Tracker
from coachable.behaviours import (
    All,
    Any,
    Behaviour,
    Comparison,
    Not,
    Number,
    Phase,
    Signal,
    Variable,
)
from coachable.behaviours.expressions import Arithmetic, Call
from tests.automata.tracked import RUNS, behaviour_of, descriptions
from tests.behaviours.random_behaviours import built, expressions, predicates, recipe

X, Y = Variable("x"), Variable("y")
NUMBERS = st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5, 1e308, 5e-324, math.inf, -math.inf, math.nan])
OPERANDS = expressions(
    st.sampled_from([(Variable, "x"), (Variable, "y")]) | recipe(Number, st.sampled_from([0, -1, 0.5, 1e308]))
)
STATES = st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=12)


def of_phases(*predicates):
    phases = tuple(Phase(f"P{index}", "", predicate) for index, predicate in enumerate(predicates))
    return Behaviour("some", "", (Signal("x"), Signal("y")), phases, ())


def same_as_columns(behaviour, states, previous):
    """Follow the states both ways, warnings being errors, and give the locations."""
    tracker = Tracker.of(behaviour)
    diagram, location, found = DecisionDiagram(tracker), previous, []
    columns = {name: np.array(column) for name, column in zip("xy", zip(*states, strict=True), strict=True)}
    for x, y in states:
        location = diagram.locate((x, y), location)
        found.append(location)
    assert tracker.along(columns, previous).tolist() == found
    return found


@settings(max_examples=75)
@given(st.lists(predicates(OPERANDS), min_size=1, max_size=3), STATES, st.integers(0, 4))
def test_any_predicates_are_decided_as_in_columns(recipes, states, previous):
    behaviour = of_phases(*map(built, recipes))
    same_as_columns(behaviour, states, min(previous, len(behaviour.phases) + 1))


@given(descriptions(), RUNS, st.integers(0, 4))
def test_runs_through_deadbands_are_followed_as_in_columns(description, run, previous):
    behaviour = behaviour_of(description)
    tracker = Tracker.of(behaviour)
    diagram, location, found = DecisionDiagram(tracker), min(previous, tracker.none_yet), []
    expected = tracker.along({"x": np.array(run)}, location).tolist()
    held = tracker.latches.of_phase(location)
    for x in run:
        location, held = diagram.step([x], location, held)
        found.append(location)
    assert found == expected


@pytest.mark.parametrize("function", ["sin", "cos"])
def test_a_sine_is_the_columns_to_the_last_bit(function):
    angles = np.random.default_rng(0).uniform(-50, 50, 100)
    for angle, value in zip(angles.tolist(), getattr(np, function)(angles).tolist(), strict=True):
        wave = Call(function, X)
        exactly = All(Comparison(wave, ">=", value), Comparison(wave, "<=", value))
        assert same_as_columns(of_phases(exactly), [(angle, 0.0)], 2) == [0]


@pytest.mark.parametrize("function", ["min", "max"])
@pytest.mark.parametrize("zeros", [(0.0, -0.0), (-0.0, 0.0)])
def test_of_two_zeros_the_same_one_is_taken_as_in_columns(function, zeros):
    infinite = Arithmetic(Number(1), "/", Call(function, X, Y))
    for phase in (Comparison(infinite, ">", 0), Comparison(infinite, "<", 0)):
        same_as_columns(of_phases(phase), [zeros], 2)


def test_infinities_that_add_up_to_nan_are_not_nan():
    behaviour = of_phases(Comparison("x", ">", "y"))
    assert same_as_columns(behaviour, [(math.inf, -math.inf), (math.nan, 0.0), (0.0, math.nan)], 2) == [
        0,
        1,
        1,
    ]


class Watched(float):
    """A number that remembers that it was compared."""

    def __new__(cls, value, asked, name):
        self = super().__new__(cls, value)
        self.asked, self.name = asked, name
        return self

    def __gt__(self, other):
        self.asked.append(self.name)
        return float(self) > other


def test_no_comparison_is_asked_twice_in_a_sample():
    up, right = Comparison("x", ">", 0), Comparison("y", ">", 0)
    behaviour = of_phases(All(up, right), All(Not(right), up), All(right, Not(up)), Not(Any(up, right)))
    diagram = DecisionDiagram(Tracker.of(behaviour))
    for x, y, location in [(1.0, 1.0, 0), (1.0, -1.0, 1), (-1.0, 1.0, 2), (1.0, 1.0, 0), (-1.0, -1.0, 3)]:
        asked = []
        sample = (Watched(x, asked, "x"), Watched(y, asked, "y"))
        assert diagram.locate(sample, 5) == location
        # Whether one of two holds is a question of its own.
        assert asked == (["x", "y", "x", "y"] if location == 3 else ["x", "y"])
