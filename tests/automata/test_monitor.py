import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.automata.cycle_progress import completed_cycles
from coachable.automata.monitor import Monitor
from coachable.automata.violation import Kind
from coachable.behaviours import All, Any, Behaviour, Comparison, Dwell, Edge, Not, Phase, Phrase, Signal
from coachable.behaviours import load_behaviour as load
from coachable.foundation.errors import TraceError
from coachable.rewards.forms import reward_table
from tests.automata.tracked import DT, RUNS, behaviour_of, descriptions, follow

WALKING = load("compass-walking")
ORDER = ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
O1, O2, O3, O4 = (
    (0.1, -0.1, -1.0, 1.0),
    (0.1, 0.1, -1.0, 1.0),
    (-0.1, 0.1, -1.0, 1.0),
    (-0.1, 0.1, -1.0, -1.0),
)


def told(behaviour, xs):
    """Every violation that the plain-Python oracle finds, as (row, kind)."""
    edges = {(edge.source, edge.target) for edge in behaviour.edges}
    found, overdue = [], False
    for row, step in enumerate(follow(behaviour, xs)):
        if step.first:
            found += [(row, Kind.START_OUTSIDE)] if step.phase is None else []
            continue
        if step.previous != step.phase:
            overdue = False
            if step.phase is None:
                found.append((row, Kind.LEFT))
            elif step.previous is not None and (step.previous, step.phase) not in edges:
                found.append((row, Kind.NOT_AN_EDGE))
        if step.too_short:
            found.append((row, Kind.TOO_SHORT))
        if step.too_long and not overdue:
            found.append((row, Kind.TOO_LONG))
            overdue = True
    return found


def found_by(monitor, xs, cuts=()):
    edges = [0, *sorted(cuts), len(xs)]
    violations = []
    for start, end in pairwise(edges):
        rows = DT * np.arange(start, end)
        violations += monitor.feed_rows(rows, {"x": xs[start:end]})[1]
    return violations


@given(descriptions(), RUNS)
def test_it_finds_what_the_words_say(description, xs):
    behaviour = behaviour_of(description)
    violations = found_by(Monitor(behaviour), xs)
    assert [(round(v.time / DT), v.kind) for v in violations] == told(behaviour, xs)
    assert all(violation.sentence for violation in violations)


@given(descriptions(), RUNS, st.data())
def test_how_a_trace_is_cut_changes_nothing(description, xs, data):
    behaviour = behaviour_of(description)
    cuts = data.draw(st.lists(st.integers(0, len(xs)), max_size=4))
    whole, pieces, single = Monitor(behaviour), Monitor(behaviour), Monitor(behaviour)
    expected = found_by(whole, xs)
    in_pieces = found_by(pieces, xs, cuts)
    one_by_one = [v for row, x in enumerate(xs) for v in single.feed(DT * row, {"x": x})]
    # repr, because NaN is not equal to itself
    assert repr(in_pieces) == repr(one_by_one) == repr(expected)
    assert repr(pieces.report()) == repr(single.report()) == repr(whole.report())
    assert pieces.phase == single.phase == whole.phase


@given(st.lists(st.sampled_from([O1, O2, O3, O4, (0.0,) * 4]), min_size=2, max_size=40))
def test_a_violation_is_where_the_reward_punishes_for_the_first_time(states):
    monitor = Monitor(WALKING)
    columns = dict(zip(ORDER, np.array(states).T, strict=True))
    locations, violations = monitor.feed_rows(np.arange(len(states)), columns)
    pays = reward_table(WALKING, "stay")[locations[:-1], locations[1:]]
    punished = 1 + np.flatnonzero((pays < 0) & (locations[:-1] != locations[1:]))
    assert [v.time for v in violations if v.kind is not Kind.START_OUTSIDE] == punished.tolist()
    assert monitor.report().follows == (locations[0] != 4 and bool(np.all(pays > 0)))


def cycling(*cycle):
    phases = [
        Phase(name, "", All(Comparison("x", ">=", index), Comparison("x", "<", index + 1)))
        for index, name in enumerate("ABC")
    ]
    edges = [Edge(a, b) for a in "ABC" for b in "ABC" if a != b]
    walk = [Edge(a, b) for a, b in pairwise([*cycle, cycle[0]])]
    return Behaviour("abc", "", (Signal("x", "m"),), tuple(phases), tuple(edges), (tuple(walk),))


@pytest.mark.parametrize(
    ("cycle", "trace", "completed"),
    [
        ("ABC", "ABCA", 1),
        ("ABC", "AABBCCA", 1),
        ("ABC", "ABCABCA", 2),
        ("ABC", "CABC", 1),
        ("ABC", "BCABCAB", 2),
        ("ABC", "ABC", 0),
        ("ABC", "ACBACBA", 0),
        ("ABC", "ABACABCA", 1),
        ("ABC", "ABC.ABCA", 1),
        ("ABAC", "ABACABACA", 2),
        ("ABAC", "BACABACAB", 2),
        ("ABAC", "ABABACA", 1),
    ],
)
def test_a_cycle_is_completed_when_all_its_edges_were_gone_along_in_order(cycle, trace, completed):
    monitor = Monitor(cycling(*cycle))
    xs = [{"A": 0, "B": 1, "C": 2, ".": 9}[at] for at in trace]
    locations, _ = monitor.feed_rows(np.arange(len(trace)), {"x": xs})
    assert monitor.report().cycles == (completed,)
    assert completed_cycles(monitor.behaviour, locations) == completed


def test_stays_are_counted_from_entry_to_exit_and_only_whole_ones():
    monitor = Monitor(cycling("A", "B"))
    monitor.feed_rows([0.0, 1.0, 1.5, 3.0, 3.5, 4.0, 9.0], {"x": [0, 1, 1, 0, 1, 1, 1]})
    report = monitor.report()
    b = report.stays["B"]
    assert (b.count, b.mean, b.shortest, b.longest) == (1, 2.0, 2.0, 2.0)
    assert (report.stays["A"].count, report.stays["A"].mean) == (1, 0.5)
    assert report.stays["C"].mean is None
    assert report.samples_in == {"A": 2, "B": 5, "C": 0}
    assert (report.start, report.end, report.samples, report.share_in_cycle) == (0.0, 9.0, 7, 1.0)


def sentences(behaviour, times, **columns):
    return [violation.sentence for violation in Monitor(behaviour).feed_rows(times, columns)[1]]


def test_a_wrong_turn_is_told_with_amount_and_unit():
    states = np.array([O2, (-0.02, 0.1, -1.0, -0.07)]).T
    assert sentences(WALKING, [3.11, 3.12], **dict(zip(ORDER, states, strict=True))) == [
        "t = 3.12 s: O2 → O4 is not an edge. "
        "O2: stance leg leans back (theta_1 fell short of its bound 0 by 0.02 rad), "
        "swing leg swings forward (dtheta_2 fell short of its bound 0 by 0.07 rad/s). "
        "O3: swing leg swings forward (dtheta_2 fell short of its bound 0 by 0.07 rad/s)."
    ]
    states = np.array([O2, (0.1, 0.1, 0.07, 1.0)]).T
    assert sentences(WALKING, [0.0, 0.01], **dict(zip(ORDER, states, strict=True))) == [
        "t = 0.01 s: O2 → outside leaves all phases. "
        "O2: stance leg rolls forward (dtheta_1 exceeded its bound 0 by 0.07 rad/s). "
        "O3: stance leg leans forward (not stance leg leans back (theta_1 exceeded its bound 0 by 0.1 rad)), "
        "stance leg rolls forward (dtheta_1 exceeded its bound 0 by 0.07 rad/s)."
    ]


def one_phase(predicate, dwell=None, outside=None):
    signals = (Signal("x", "m"), Signal("y", "s"))
    return Behaviour("one", "", signals, (Phase("P", "", predicate, dwell),), (), outside=outside)


def test_reasons_speak_the_words_of_the_coach():
    high = Phrase("held high", Comparison(1, "<", "x"))
    early = Phrase("early", Any(Comparison("y", "<", 1), Comparison("y", ">=", 9)))
    behaviour = one_phase(All(high, Not(early)), outside="dropped")
    (text,) = sentences(behaviour, [0.0, 1.0], x=[2.0, 0.5], y=[2.0, 0.25])
    assert text == (
        "t = 1 s: P → outside (dropped) leaves all phases. "
        "P: held high (x fell short of its bound 1 by 0.5 m), "
        "not early (y fell short of its bound 1 by 0.75 s)."
    )
    (text,) = sentences(one_phase(early), [0.0, 1.0], x=[0.0, 0.0], y=[0.0, 3.0])
    assert "early (y exceeded its bound 1 by 2 s or y fell short of its bound 9 by 6 s)" in text


def test_a_state_on_its_bound_is_told_as_such():
    (text,) = sentences(one_phase(Comparison("x", ">", 0.5)), [0.0], x=[0.5], y=[0.0])
    assert text == "t = 0 s: it starts outside, in no phase. P: x is at its bound 0.5 and not above it."


def test_a_deadband_is_part_of_the_bound_that_was_left():
    (text,) = sentences(
        one_phase(Comparison("x", ">", 0.5, 0.1)), [0.0, 1.0, 2.0], x=[0.6, 0.45, 0.3], y=[0] * 3
    )
    assert "t = 2 s: P → outside" in text
    assert "x fell short of its bound 0.5 - 0.1 by 0.1 m" in text


def test_nan_is_outside_and_named():
    (text,) = sentences(
        one_phase(Not(Comparison("x", ">", 0.5))), [0.0, 1.0], x=[0.1, 0.1], y=[0.0, math.nan]
    )
    assert text == "t = 1 s: P → outside leaves all phases. y is NaN."


def test_dwell_times_are_told():
    behaviour = one_phase(Comparison("x", ">", 0), Dwell(0.05, 0.1))
    texts = sentences(behaviour, 0.02 * np.arange(11), x=[0, 1, 1, 0, 1, 1, 1, 1, 1, 1, 1], y=[0] * 11)
    assert texts[2:] == [
        "t = 0.06 s: P → outside comes too soon: P lasted 0.04 s of at least 0.05 s.",
        "t = 0.2 s: P lasts too long: 0.12 s of at most 0.1 s.",
    ]


@pytest.mark.parametrize(
    ("times", "columns", "words"),
    [
        ([0.0, 0.1, 0.1], {"x": [1] * 3, "y": [1] * 3}, "sample 3: the time goes from 0.1 s to 0.1 s"),
        ([0.0, -0.1], {"x": [1] * 2, "y": [1] * 2}, "sample 2: the time goes from 0 s to -0.1 s"),
        ([0.0, math.nan], {"x": [1] * 2, "y": [1] * 2}, "sample 2: its time is not a number"),
        ([math.inf], {"x": [1], "y": [1]}, "sample 1: its time is not a number"),
        ([0.0], {"x": [1], "Y": [1]}, "signal y has no value; known: 'Y'"),
        ([0.0], {"x": [1, 2], "y": [1]}, "signal x has 2 samples, but there are 1 times"),
        ([0.0], {"x": np.array(["high"]), "y": [1]}, "signal x must be numbers"),
        (
            [0.0],
            {"x": np.array([[1]]), "y": [1]},
            r"signal x must be numbers, one a sample, but its shape is \(1, 1\)",
        ),
    ],
)
def test_what_cannot_be_watched_is_refused_and_leaves_no_trace(times, columns, words):
    monitor = Monitor(one_phase(Comparison("x", ">", 0)))
    before = monitor.report()
    with pytest.raises(TraceError, match=words):
        monitor.feed_rows(np.array(times), columns)
    assert monitor.report() == before


@pytest.mark.parametrize(
    ("t", "values", "words"),
    [
        (1.0, {"x": 1.0, "y": 0.0}, "sample 2: the time goes from 1 s to 1 s"),
        (math.nan, {"x": 1.0, "y": 0.0}, "sample 2: its time is not a number"),
        (2.0, {"x": 1.0}, "signal y has no value"),
    ],
)
def test_a_sample_that_cannot_be_watched_is_refused_and_leaves_no_trace(t, values, words):
    monitor = Monitor(one_phase(Comparison("x", ">", 0)))
    monitor.feed(1.0, {"x": 1.0, "y": 0.0})
    before = monitor.report()
    with pytest.raises(TraceError, match=words):
        monitor.feed(t, values)
    assert monitor.report() == before


def test_nothing_was_seen_of_an_empty_trace():
    monitor = Monitor(WALKING)
    assert monitor.feed_rows([], {name: [] for name in ORDER})[1] == ()
    report = monitor.report()
    assert (report.samples, report.start, report.share_in_cycle, report.first) == (0, None, None, None)
    assert monitor.phase is None
