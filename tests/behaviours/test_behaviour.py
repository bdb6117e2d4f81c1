import contextlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import All, Any, Behaviour, Comparison, Edge, Not, Phase, Signal
from coachable.errors import BehaviourError

TEXT = st.text(max_size=12)
IDENTIFIERS = st.from_regex(r"[a-z_][a-z0-9_]{0,6}", fullmatch=True)


@st.composite
def parts_of_behaviours(draw):
    """Arguments of `Behaviour`, which is built in the test: beartype draws random numbers of its own."""
    signals = draw(
        st.lists(
            st.builds(Signal, IDENTIFIERS, TEXT, TEXT), min_size=1, max_size=4, unique_by=lambda s: s.name
        )
    )
    comparisons = st.builds(
        Comparison,
        st.sampled_from([signal.name for signal in signals]),
        st.sampled_from(["<", "<=", ">", ">="]),
        st.floats(allow_nan=False, allow_infinity=False),
    )
    predicates = st.recursive(
        comparisons,
        lambda inner: (
            st.lists(inner, max_size=3).map(lambda parts: All(*parts))
            | st.lists(inner, max_size=3).map(lambda parts: Any(*parts))
            | inner.map(Not)
        ),
        max_leaves=6,
    )
    names = draw(st.lists(TEXT.filter(str.strip), min_size=1, max_size=4, unique=True))
    edges = st.builds(Edge, st.sampled_from(names), st.sampled_from(names), st.none() | TEXT)
    return {
        "name": draw(TEXT),
        "description": draw(TEXT),
        "signals": tuple(signals),
        "phases": tuple(Phase(name, draw(TEXT), draw(predicates)) for name in names),
        "edges": tuple(draw(st.lists(edges, max_size=5, unique=True))),
    }


@settings(max_examples=60)
@given(parts_of_behaviours())
def test_json_round_trip_is_identity(parts):
    behaviour = Behaviour(**parts)
    text = behaviour.to_json()
    again = Behaviour.from_json(text)
    assert again == behaviour
    assert hash(again) == hash(behaviour)
    assert again.to_json() == text


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
        ({"signals": (Signal("height"), Signal("height"))}, r"signal height is given 2 times"),
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


BROKEN = {
    "cut off": (lambda text: text[:100], r"^line \d+, column \d+: not JSON"),
    "empty": (lambda text: "", r"^line 1, column 1: not JSON"),
    "a list": (lambda text: "[]", r"^the document: expected an object"),
    "not a number": (
        lambda text: text.replace('"bound": 0.0', '"bound": NaN', 1),
        r"NaN is not a finite number",
    ),
    "a huge number": (
        lambda text: text.replace('"bound": 0.0', '"bound": 1e999', 1),
        r"^phases\[0\]\.predicate: .*must be a finite",
    ),
    "text as a bound": (
        lambda text: text.replace('"bound": 0.0', '"bound": "0"', 1),
        r"^phases\[0\]\.predicate\.bound: expected a number, found '0'",
    ),
    "a wrong relation": (
        lambda text: text.replace('"<="', '"=<"'),
        r"^phases\[1\]\.predicate: .*unknown relation '=<'",
    ),
    "a missing field": (
        lambda text: text.replace('"title"', '"tilte"', 1),
        r"^phases\[0\]: unknown field 'tilte'; did you mean 'title'",
    ),
    "no edges": (lambda text: '{"name": "x"}', r"^the document: the field 'description' is missing"),
    "phases as text": (
        lambda text: '{"name": "", "description": "", "signals": [], "edges": [], "phases": "air"}',
        r"^phases: expected a list, found 'air'",
    ),
    "a number as a name": (
        lambda text: text.replace('"name": "hop"', '"name": 3'),
        r"^name: expected text, found 3",
    ),
    "a bad signal name": (
        lambda text: text.replace('"speed"', '"speed of hip"'),
        r"^signals\[1\]: signal 'speed of",
    ),
    "an unknown phase": (
        lambda text: text.replace('"target": "air"', '"target": "are"'),
        r"edge ground → are",
    ),
    "no predicate": (
        lambda text: text.replace('"signal": "height"', '"sgnal": "height"', 1),
        r"^phases\[0\]\.predicate: unknown field 'sgnal'; did you mean 'signal'",
    ),
    "too deep": (lambda text: "[" * 100_000, r"nested too deeply"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_json_is_refused_saying_where(case):
    breaking, complaint = BROKEN[case]
    with pytest.raises(BehaviourError, match=complaint):
        Behaviour.from_json(breaking(hop().to_json()))


@given(st.data())
def test_damaged_json_is_read_or_refused_but_never_crashes(data):
    text = hop().to_json()
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 20)))
    damaged = text[:start] + data.draw(st.text(alphabet='{}[]",:0a', max_size=3)) + text[end:]
    with contextlib.suppress(BehaviourError):
        Behaviour.from_json(damaged)
