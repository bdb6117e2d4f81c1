import math

import pytest
import z3
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from coachable.behaviours import All, Any, Between, Comparison, Constant, Near, Not, Number, Phrase, holds
from coachable.behaviours.expressions import Arithmetic, Call, Negative, Variable, evaluate
from coachable.behaviours.smt import Terms, find_state, to_z3

NAMES = ("x", "y", "z")
# Small dyadic numbers: sums and products of a few of them are exact in floats, as they are in Z3.
numbers = st.integers(-8, 8).map(lambda n: n / 4)
states = st.fixed_dictionaries(dict.fromkeys(NAMES, numbers))

leaves = st.one_of(
    numbers.map(Number),
    st.sampled_from(NAMES).map(Variable),
    st.just(Constant("half", Number(0.5))),
)


def larger(part):
    return st.one_of(
        part.map(Negative),
        st.builds(Arithmetic, part, st.sampled_from("+-*"), part),
        part.map(lambda e: Call("abs", e)),
        st.builds(Call, st.sampled_from(("min", "max")), part, part),
    )


expressions = st.recursive(leaves, larger, max_leaves=5)
atoms = st.one_of(
    st.builds(Comparison, expressions, st.sampled_from(("<", "<=", ">", ">=")), expressions),
    st.builds(Between, expressions, st.sampled_from(("<", "<=")), expressions, st.just("<"), expressions),
    st.builds(Near, expressions, expressions, numbers),
)


def joined(part):
    return st.one_of(
        part.map(Not),
        part.map(lambda p: Phrase("some words", p)),
        st.lists(part, max_size=3).map(lambda parts: All(*parts)),
        st.lists(part, max_size=3).map(lambda parts: Any(*parts)),
    )


predicates = st.recursive(atoms, joined, max_leaves=6)


@settings(max_examples=150)
@given(predicates, states)
def test_the_formula_says_of_every_state_what_the_predicate_says(predicate, state):
    terms = Terms.of(NAMES)
    formula = to_z3(predicate, terms)
    values = [(terms.signals[name], z3.RealVal(str(value))) for name, value in state.items()]
    assert z3.is_true(z3.simplify(z3.substitute(z3.And(formula), *values))) == holds(predicate, state)


@given(states)
def test_a_division_is_guarded(state):
    quotient = Arithmetic(Variable("x"), "/", Variable("y"))
    terms = Terms.of(NAMES)
    formula = to_z3(Comparison(quotient, "<", 1), terms)
    values = [(terms.signals[name], z3.RealVal(str(value))) for name, value in state.items()]
    guarded = z3.is_true(z3.simplify(z3.substitute(z3.And(*terms.conditions), *values)))
    assert guarded == (state["y"] != 0)
    assume(guarded)
    said = z3.is_true(z3.simplify(z3.substitute(formula, *values)))
    assert said == (state["x"] / state["y"] < 1)


@pytest.mark.parametrize("angle", [-4.0, -1.6, -0.3, 0.0, 1e-3, 0.5, 1.5, 2.0, 3.1, 3.2, 6.0])
def test_what_is_said_of_sine_and_cosine_is_true(angle):
    terms = Terms.of(("x",))
    s, c = terms.circle(Variable("x"))
    bounds = terms.conditions[1:]
    values = [(terms.signals["x"], angle), (s, math.sin(angle)), (c, math.cos(angle))]
    substituted = [(term, z3.RealVal(repr(value))) for term, value in values]
    assert z3.is_true(z3.simplify(z3.substitute(z3.And(*bounds), *substituted)))


def found(predicate):
    terms = Terms()
    formula = to_z3(predicate, terms)
    return find_state([formula], terms, lambda state: holds(predicate, state))


SINE, COSINE = (Call(name, Variable("x")) for name in ("sin", "cos"))


@pytest.mark.parametrize(
    "predicate",
    [
        Between(0.5, "<", SINE, "<", 0.5001),
        All(Comparison(SINE, ">", 0), Comparison(COSINE, "<", -0.5)),
        All(Near(SINE, -0.2, 1e-6), Comparison(COSINE, "<", 0)),
        Between(7, "<", Arithmetic(Variable("x"), "*", Variable("y")), "<=", 7.001),
        Comparison("x", ">", 1e6),
        Near("x", 0.1, 0),
    ],
)
def test_a_state_that_is_found_is_one(predicate):
    answer = found(predicate)
    assert answer.state is not None
    assert holds(predicate, answer.state)


def test_a_state_has_no_more_digits_than_it_needs():
    answer = found(Between(0.3331, "<", "x", "<", 0.4299))
    assert answer.state is not None
    assert answer.state["x"] == pytest.approx(0.4)


@pytest.mark.parametrize(
    "predicate",
    [
        Comparison(Arithmetic(Arithmetic(SINE, "*", SINE), "+", Arithmetic(COSINE, "*", COSINE)), ">", 1),
        All(Comparison("x", ">", 0), Comparison("x", "<", 3), Comparison(SINE, "<", 0)),
        Comparison(Call("abs", Variable("x")), "<", 0),
    ],
)
def test_what_cannot_be_is_known_not_to_be(predicate):
    answer = found(predicate)
    assert answer.state is None
    assert answer.decided


def test_what_only_the_pair_could_be_is_not_claimed():
    # sin 2 is 0.909…; the bounds alone do not exclude 0.95.
    answer = found(All(Near("x", 2, 0), Comparison(SINE, ">", 0.95)))
    assert answer.state is None
    assert not answer.decided
    assert evaluate(SINE, {"x": 2.0}) < 0.95
