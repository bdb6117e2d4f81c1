"""Questions to the solver: what it proves must be true, and a witness must be one."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import All, Any, Comparison, Near, Not, Number, Variable, holds
from coachable.behaviours.checking.solver import smt
from coachable.behaviours.checking.solver.corners import without_corners
from coachable.behaviours.expressions import Arithmetic, Call, Negative
from coachable.behaviours.rewriting import expanded

X, Y = Variable("x"), Variable("y")


def sin(angle):
    return Call("sin", angle)


def cos(angle):
    return Call("cos", angle)


def plus(one, other):
    return Arithmetic(one, "+", other)


def minus(one, other):
    return Arithmetic(one, "-", other)


def times(one, other):
    return Arithmetic(one, "*", other)


def over(one, other):
    return Arithmetic(one, "/", other)


IMPOSSIBLE = {
    "more than one": [Comparison(sin(X), ">", 1)],
    "Pythagoras": [
        Comparison(plus(times(sin(X), sin(X)), times(cos(X), cos(X))), "<", 1),
    ],
    "the sine of nothing": [Comparison(X, "<=", 0), Comparison(X, ">=", 0), Comparison(sin(X), ">", 0)],
    "an odd function": [Comparison(plus(sin(X), sin(Negative(X))), ">", 0)],
    "an even function": [Comparison(cos(X), ">", cos(Negative(X)))],
    "below its argument": [Comparison(X, ">", 0), Comparison(sin(X), ">=", X), Comparison(X, "<", 3)],
    "a small angle": [Comparison(sin(X), ">", 0.5), Comparison(X, ">", 0), Comparison(X, "<", 0.52)],
    "a later period": [Comparison(sin(X), ">", 0.5), Comparison(X, ">", 10), Comparison(X, "<", 12)],
    "a falling cosine": [
        Comparison(cos(X), ">", cos(Y)),
        Comparison(X, ">=", Y),
        Comparison(Y, ">", 0),
        Comparison(X, "<", 3),
    ],
    "a square": [Comparison(times(X, X), "<", 0)],
    "absolutely negative": [Comparison(Call("abs", X), "<", 0)],
    "less than the least": [Comparison(Call("min", X, Y), ">", X)],
    "a quotient of unlike signs": [
        Comparison(over(X, Y), ">", 0),
        Comparison(X, ">", 0),
        Comparison(Y, "<", 0),
    ],
    "a decimal": [
        Comparison(plus(X, Number(0.1)), ">", 0.3),
        Comparison(X, "<=", 0.2),
    ],
}

POSSIBLE = {
    "a sine": [Comparison(sin(X), ">", 0.5)],
    "a narrow band": [Near(sin(times(Number(2), X)), Number(0.3), Number(1e-4)), Comparison(X, ">", 1)],
    "far out": [Comparison(cos(X), ">", 0.9), Comparison(X, ">", 100)],
    "two angles": [Comparison(minus(cos(X), cos(Y)), ">", 0.1), Comparison(X, ">", 0), Comparison(Y, "<", 1)],
    "an irrational root": [Comparison(times(X, X), "<", 2), Comparison(times(X, X), ">", 1.99)],
    "a hyperbola": [Comparison(times(X, Y), ">=", 2), Comparison(plus(X, Y), "<", 1)],
    "a quotient": [Comparison(over(X, Y), ">", 1), Comparison(Y, "<", 0)],
    "only where it divides by zero": [
        Comparison(over(X, Y), ">", 1),
        Comparison(Y, "<=", 0),
        Comparison(X, ">", 0),
    ],
    "great and small": [Comparison(Call("max", X, Y), "<", Call("abs", X))],
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_what_holds_nowhere_is_refuted(case):
    assert smt.refuted(("x", "y"), *IMPOSSIBLE[case]) is True
    assert smt.witness(("x", "y"), *IMPOSSIBLE[case]) is False


@pytest.mark.parametrize("case", POSSIBLE)
def test_what_holds_somewhere_has_a_witness(case):
    assert smt.refuted(("x", "y"), *POSSIBLE[case]) is not True
    found = smt.witness(("x", "y"), *POSSIBLE[case])
    assert isinstance(found, dict)
    assert all(holds(predicate, found) for predicate in POSSIBLE[case])


def test_a_state_that_floats_do_not_agree_to_is_no_witness():
    on_the_point = [Comparison(plus(X, Number(0.1)), ">=", 0.8), Comparison(X, "<=", 0.7)]
    assert smt.refuted(("x",), *on_the_point) is False
    assert smt.witness(("x",), *on_the_point) is None


def test_a_hair_that_floats_see_is_no_witness():
    addition_theorem = minus(sin(plus(X, Y)), plus(times(sin(X), cos(Y)), times(cos(X), sin(Y))))
    assert smt.refuted(("x", "y"), Comparison(addition_theorem, ">", 0.1)) is True
    by_a_hair, state = Comparison(addition_theorem, ">", 0), {"x": 0.1, "y": 1.0}
    assert holds(by_a_hair, state)
    assert not smt.witness(("x", "y"), by_a_hair)
    assert not smt.witness(("x", "y"), by_a_hair, Comparison(X, "<=", 0.1), Comparison(X, ">=", 0.1))


def test_a_witness_is_of_short_numbers():
    assert smt.witness(("x", "y"), Comparison(X, ">", 0), Comparison(Y, "<=", 0)) == {"x": 0.1, "y": -0.1}
    assert smt.witness(("x",), Comparison(X, ">", 1.05), Comparison(X, "<", 1.3)) == {"x": 1.2}


ANGLES = st.sampled_from([X, Y, plus(X, Y), times(Number(2), X)])
COMPARISONS = st.builds(
    Comparison,
    st.builds(lambda function, angle: Call(function, angle), st.sampled_from(["sin", "cos", "abs"]), ANGLES),
    st.sampled_from(["<", "<=", ">", ">="]),
    st.sampled_from([-0.75, 0.0, 0.25, 0.75]),
)


@settings(max_examples=12, deadline=None)
@given(st.lists(COMPARISONS, min_size=1, max_size=3))
def test_nothing_that_holds_on_a_grid_is_refuted(parts):
    grid = [{"x": i / 3, "y": j / 3} for i in range(-12, 13) for j in range(-12, 13)]
    found = smt.witness(("x", "y"), *parts)
    if any(holds(All(*parts), values) for values in grid):
        assert found is not False
        assert smt.refuted(("x", "y"), *parts) is not True
    if found:
        assert holds(All(*parts), found)


CORNERED = st.builds(
    Comparison,
    st.sampled_from(
        [
            Call("abs", minus(X, Y)),
            Call("min", X, Y, Number(0.5)),
            minus(Call("max", X, Call("abs", Y)), Call("min", X, Y)),
        ]
    ),
    st.sampled_from(["<", "<=", ">", ">="]),
    st.sampled_from([-1.0, 0.0, 0.5]),
)


@given(CORNERED, st.sampled_from([-1.0, 0.0, 0.5, 2.0]), st.sampled_from([-1.0, 0.0, 0.5, 2.0]))
def test_cases_mean_what_the_corner_means(comparison, x, y):
    for predicate in (comparison, Not(comparison), Any(comparison)):
        cases = without_corners(expanded(predicate))
        assert "abs" not in str(cases)
        assert "min" not in str(cases)
        assert holds(cases, {"x": x, "y": y}) == holds(predicate, {"x": x, "y": y})


def test_very_many_corners_are_left_as_they_are():
    many = Comparison(Call("min", *[plus(X, Number(float(i))) for i in range(60)]), ">", 0)
    assert without_corners(many) == many
    assert smt.refuted(("x",), many) is False


def test_conflict_keeps_nothing_that_can_be_left_out():
    parts = [Comparison("x", ">", 1), Comparison("y", ">", 0), Comparison("x", "<", 0)]
    assert smt.conflict(("x", "y"), parts) == (parts[0], parts[2])


def test_essence_drops_what_follows():
    parts = [Comparison("x", ">", 0), Comparison("y", ">", 0), Comparison("x", ">=", 0)]
    assert smt.essence(("x", "y"), parts) == (parts[0], parts[1])


def test_huge_numbers_are_no_trouble():
    assert smt.witness(("x",), Comparison(X, ">", 1e300)) == {"x": 2e300}
    assert smt.witness(("x",), Comparison(times(X, Number(1e-300)), ">", 1e300)) is None
    assert smt.refuted(("x",), Comparison(sin(times(X, Number(1e300))), ">", 1)) is True
