import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.behaviours.predicates import All, Any, Comparison, Not, Signal, holds, signals_of
from coachable.behaviours.rewriting import normal_form
from coachable.foundation.errors import BehaviourError

NAMES = ("x", "y", "z")
BOUNDS = st.sampled_from([-1.0, -0.0, 0.0, 0.5])
COMPARISONS = st.builds(Comparison, st.sampled_from(NAMES), st.sampled_from(["<", "<=", ">", ">="]), BOUNDS)
PREDICATES = st.recursive(
    COMPARISONS,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda parts: All(*parts))
        | st.lists(inner, max_size=3).map(lambda parts: Any(*parts))
        | inner.map(Not)
    ),
    max_leaves=8,
)
NUMBERS = BOUNDS | st.floats(allow_nan=False)
VALUES = st.fixed_dictionaries(dict.fromkeys(NAMES, NUMBERS))


def meaning(predicate, values):
    """What a predicate means, written with nothing but Python's own words."""
    if isinstance(predicate, All):
        return all(meaning(part, values) for part in predicate.parts)
    if isinstance(predicate, Any):
        return any(meaning(part, values) for part in predicate.parts)
    if isinstance(predicate, Not):
        return not meaning(predicate.part, values)
    value, bound = values[predicate.left.signal], predicate.right.value
    if predicate.relation == "<":
        return value < bound
    if predicate.relation == "<=":
        return value <= bound
    if predicate.relation == ">":
        return value > bound
    return value >= bound


@given(PREDICATES, VALUES)
def test_holds_is_the_meaning_and_a_bool(predicate, values):
    answer = holds(predicate, values)
    assert type(answer) is bool
    assert answer == meaning(predicate, values)


@given(PREDICATES, VALUES)
def test_printed_predicate_read_by_python_means_the_same(predicate, values):
    words = {"true": True, "false": False, **values}
    assert eval(str(predicate), {}, words) == holds(predicate, values)


@given(PREDICATES, VALUES)
def test_normal_form_means_the_same_and_is_its_own_normal_form(predicate, values):
    normal = normal_form(predicate)
    assert holds(normal, values) == holds(predicate, values)
    assert normal_form(normal) == normal


@given(st.lists(PREDICATES, max_size=4), st.randoms(use_true_random=False), st.sampled_from([All, Any]))
def test_normal_form_forgets_order_nesting_and_repetition(parts, random, kind):
    shuffled = parts + parts[:1]
    random.shuffle(shuffled)
    cut = len(shuffled) // 2
    assert normal_form(kind(*parts)) == normal_form(kind(kind(*shuffled[:cut]), *shuffled[cut:]))


@given(PREDICATES)
def test_signals_of_are_exactly_the_values_that_are_needed(predicate):
    names = signals_of(predicate)
    assert len(set(names)) == len(names)
    holds(predicate, dict.fromkeys(names, 0.0))
    for missing in names:
        with pytest.raises(KeyError):
            holds(predicate, {name: 0.0 for name in names if name != missing})


def test_zeros_of_either_sign_are_on_the_same_side_of_every_bound():
    for relation, expected in ((">", False), ("<", False), (">=", True), ("<=", True)):
        for bound in (0.0, -0.0):
            for zero in (0.0, -0.0):
                assert holds(Comparison("x", relation, bound), {"x": zero}) is expected
    negative, positive = Comparison("x", ">", -0.0), Comparison("x", ">", 0)
    assert (str(negative), hash(negative)) == (str(positive), hash(positive))


def test_nothing_compares_with_nan():
    for relation in ("<", "<=", ">", ">="):
        assert not holds(Comparison("x", relation, 0.0), {"x": math.nan})


def test_predicates_print_as_a_person_would_write_them():
    leaning = Comparison("theta_1", ">", 0)
    assert str(leaning) == "theta_1 > 0"
    assert str(Comparison("x", "<=", 0.25)) == "x <= 0.25"
    assert str(All(leaning, Not(Any(leaning, Comparison("x", "<", 1))))) == (
        "theta_1 > 0 and not (theta_1 > 0 or x < 1)"
    )


def test_predicates_are_values():
    assert All(Comparison("x", ">", 0)) == All(Comparison("x", ">", 0.0))
    assert len({All(), Any(), All(), Not(All())}) == 3
    with pytest.raises(AttributeError):
        setattr(All(), "parts", ())  # noqa: B010


@pytest.mark.parametrize("bound", [math.nan, math.inf, -math.inf])
def test_a_bound_is_a_finite_number(bound):
    with pytest.raises(BehaviourError, match=r"theta_1 > .*finite"):
        Comparison("theta_1", ">", bound)


def test_an_unknown_relation_is_refused_with_the_known_ones():
    with pytest.raises(BehaviourError, match=r"'=='; use one of < <= > >="):
        Comparison("x", "==", 0)


@pytest.mark.parametrize("name", ["", "1x", "theta 1", "a-b"])
def test_a_signal_name_can_be_written_in_a_predicate(name):
    with pytest.raises(BehaviourError, match="letters"):
        Signal(name)
