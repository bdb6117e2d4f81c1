import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import Behaviour, Comparison, Not, Phase, Phrase, Signal, load_behaviour
from coachable.behaviours.checking.comparison import always_equal, disagreements, staying_differs
from coachable.behaviours.expressions import Arithmetic, Call, Number, Variable
from coachable.behaviours.predicates import All, Any

WALKING = load_behaviour("compass-walking")
GRID = [
    dict(zip("xy", pair, strict=True)) for pair in itertools.product((-1.5, -1.0, 0.0, 0.5, 1.0), repeat=2)
]

atoms = st.builds(
    Comparison, st.sampled_from("xy"), st.sampled_from(("<", "<=", ">", ">=")), st.sampled_from((-1, 0, 1))
)
predicates = st.recursive(
    atoms,
    lambda part: st.one_of(part.map(Not), st.builds(All, part, part), st.builds(Any, part, part)),
    max_leaves=3,
)


def behaviour(*parts):
    phases = tuple(Phase(f"P{index}", "", part) for index, part in enumerate(parts))
    return Behaviour("b", "", (Signal("x"), Signal("y")), phases, ())


def places(one, state):
    name = one.phase_at(state)
    return None if name is None else one.phase_names.index(name)


behaviours = st.lists(predicates, min_size=1, max_size=3)


@settings(max_examples=25)
@given(behaviours, behaviours)
def test_every_pair_of_places_is_found_and_every_state_confirms_its_pair(these, those):
    one, other = behaviour(*these), behaviour(*those)
    found = {(d.first, d.second): d.state for d in disagreements(one, other)}
    for (first, second), state in found.items():
        assert state is not None
        assert (places(one, state), places(other, state)) == (first, second)
    seen = {(places(one, state), places(other, state)) for state in GRID}
    assert {pair for pair in seen if pair[0] != pair[1]} <= set(found)


def test_strict_signs_differ_from_the_papers_only_where_a_signal_is_zero():
    found = disagreements(WALKING, load_behaviour("compass-walking-released"))
    assert [(d.first, d.second) for d in found] == [(0, None), (1, None), (2, None), (3, None)]
    for disagreement in found:
        assert disagreement.state is not None
        assert 0.0 in disagreement.state.values()


def test_other_words_for_the_same_are_the_same():
    back = Phrase("stance leg leans back", Comparison("theta_1", ">", 0))
    ahead = Phrase("swing leg leads", Not(Comparison(0, ">=", "theta_2")))
    rolls = Phrase("stance leg rolls forward", Not(Comparison("dtheta_1", ">", 0)))
    swings = Phrase(
        "swing leg swings forward", Comparison(Arithmetic(Number(2), "*", Variable("dtheta_2")), ">", 0)
    )
    phases = tuple(
        Phase(name, "", All(*parts))
        for name, *parts in (
            ("trailing", back, Not(ahead), rolls, swings),
            ("passing", swings, All(ahead, back), rolls),
            ("leading", Not(back), ahead, rolls, swings),
            ("returning", Not(Any(back, Not(ahead))), rolls, Not(swings)),
        )
    )
    assert disagreements(WALKING, Behaviour("coach", "", WALKING.signals, phases, ())) == ()


@pytest.mark.parametrize(
    ("band", "other", "differs"), [(0.1, 0.1, False), (0.1, 0.2, True), (None, 0.1, True), (0, None, False)]
)
def test_deadbands_differ_where_one_keeps_and_the_other_does_not(band, other, differs):
    answer = staying_differs(Comparison("x", ">", 0, band), Comparison("x", ">", 0, other))
    assert answer.decided
    assert (answer.state is not None) == differs
    if answer.state is not None:
        assert -0.2 < answer.state["x"] <= 0


def test_expressions_are_equal_if_they_are_in_every_state():
    x, y = Variable("x"), Variable("y")
    assert always_equal(Arithmetic(x, "+", y), Arithmetic(y, "+", x))
    assert not always_equal(x, y)
    assert not always_equal(Call("abs", x), x)
