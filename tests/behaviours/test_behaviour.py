import math

import pytest

from coachable.behaviours import (
    All,
    Any,
    Assignment,
    Behaviour,
    Comparison,
    Constant,
    Dwell,
    Edge,
    Not,
    Number,
    Phase,
    Phrase,
    Signal,
    Variable,
)
from coachable.foundation.errors import BehaviourError

UP = Comparison("height", ">", 0)
DOWN = Comparison("height", "<=", 0)


def hop(**changes):
    parts = {
        "name": "hop",
        "description": "Up and down.",
        "signals": (Signal("height", "m"), Signal("speed", "m/s")),
        "phases": (Phase("air", "off the ground", UP), Phase("ground", "on it", DOWN)),
        "edges": (Edge("air", "ground"), Edge("ground", "air", event="takeoff")),
    }
    return Behaviour(**(parts | changes))


def test_phase_at_is_the_first_phase_that_holds():
    behaviour = hop(phases=(Phase("high", "", Comparison("height", ">", 1)), Phase("air", "", UP)), edges=())
    assert behaviour.phase_at({"height": 2.0, "speed": 0.0}) == "high"
    assert behaviour.phase_at({"height": 1.0, "speed": 0.0}) == "air"
    assert behaviour.phase_at({"height": -0.0, "speed": 0.0}) is None


@pytest.mark.parametrize("values", [(math.nan, 0.0), (1.0, math.nan)])
def test_a_state_with_a_nan_is_outside_even_of_a_negation(values):
    everywhere = hop(phases=(Phase("all", "", Not(Comparison("height", ">", 5))),), edges=())
    assert everywhere.phase_at({"height": 1.0, "speed": 0.0}) == "all"
    assert everywhere.phase_at(dict(zip(("height", "speed"), values, strict=True))) is None


def test_a_missing_signal_is_named():
    with pytest.raises(BehaviourError, match=r"speed has no value; did you mean 'sped'"):
        hop().phase_at({"height": 0.0, "sped": 0.0})


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"phases": (), "edges": ()}, r"'hop': it has no phases"),
        ({"signals": (Signal("height"), Signal("height"))}, r"name height is given 2 times"),
        (
            {"phases": (Phase("air", "", UP), Phase("air", "", DOWN)), "edges": ()},
            r"phase air is given 2 times",
        ),
        ({"phases": (Phase(" ", "", UP),), "edges": ()}, r"empty name"),
        ({"signals": (Signal("heigth"),)}, r"phase air: unknown signal 'height'; did you mean 'heigth'"),
        (
            {"edges": (Edge("air", "grund"),)},
            r"edge air → grund: unknown phase 'grund'; did you mean 'ground'",
        ),
        ({"edges": (Edge("x", "air"),)}, r"unknown phase 'x'; known: 'air', 'ground'"),
        ({"edges": (Edge("air", "ground"),) * 2}, r"edge air → ground is given 2 times"),
    ],
)
def test_a_contradiction_is_refused_and_the_culprit_named(changes, complaint):
    with pytest.raises(BehaviourError, match=complaint):
        hop(**changes)


def test_two_edges_between_a_pair_of_phases_may_differ_in_their_event():
    edges = (Edge("air", "ground", "landing"), Edge("air", "ground", "crash"))
    assert hop(edges=edges).edges == edges


def test_what_predicates_are_written_in_is_collected():
    limit = Constant("limit", Number(0.5, "m"))
    high = Phrase("far up", Comparison("height", ">", limit))
    flying = Phrase("flying high", All(high, UP))
    behaviour = hop(phases=(Phase("air", "", Any(flying)), Phase("ground", "", DOWN)))
    assert behaviour.vocabulary == (high, flying)
    assert behaviour.constants == (limit,)
    assert behaviour.phases[0].predicate == flying


def test_a_phrase_or_a_constant_with_two_meanings_is_refused():
    one, other = Phrase("far up", UP), Phrase("far up", DOWN)
    with pytest.raises(BehaviourError, match=r"phrase far up is given 2 times"):
        hop(phases=(Phase("air", "", one), Phase("ground", "", other)))
    near, far = (Comparison("height", ">", Constant("limit", Number(value))) for value in (1, 2))
    with pytest.raises(BehaviourError, match=r"name limit is given 2 times"):
        hop(phases=(Phase("air", "", near), Phase("ground", "", far)))


def test_a_cycle_closes_along_edges():
    up, down = hop().edges
    assert hop(cycles=((up, down),)).cycles == ((up, down),)
    with pytest.raises(BehaviourError, match=r"continues from air → ground with air → ground"):
        hop(cycles=((up,),))
    with pytest.raises(BehaviourError, match=r"air → air, which is not an edge"):
        hop(cycles=((Edge("air", "air"),),))
    with pytest.raises(BehaviourError, match=r"no edges"):
        hop(cycles=((),))


def test_a_reset_speaks_of_signals():
    for assignment in (Assignment("hight", Variable("height")), Assignment("height", Variable("hight"))):
        with pytest.raises(BehaviourError, match=r"unknown signal 'hight'; did you mean 'height'"):
            hop(edges=(Edge("air", "ground", reset=(assignment,)),))


@pytest.mark.parametrize("times", [(-1, 2), (0, math.nan), (math.inf, math.inf)])
def test_a_dwell_time_is_a_time(times):
    with pytest.raises(BehaviourError):
        Dwell(*times)


@pytest.mark.parametrize(
    "words", ["", "far  up", " up", "up and away", "not up", "1st phase", "up, away", "u\u0440"]
)
def test_a_phrase_can_be_written_in_a_line(words):
    with pytest.raises(BehaviourError, match="phrase"):
        Phrase(words, UP)


@pytest.mark.parametrize("unit", ["[m]", "m ", "a  b", 'm"', "#", "m\n"])
def test_a_unit_can_be_written_in_brackets(unit):
    with pytest.raises(BehaviourError, match="a unit such as rad/s"):
        Signal("height", unit)
    with pytest.raises(BehaviourError, match="a unit such as rad/s"):
        Number(1, unit)
