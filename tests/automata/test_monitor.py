import math
import re
from datetime import datetime, timedelta, timezone
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.automata.cycle_progress import completed_cycles
from coachable.automata.monitor import Monitor
from coachable.automata.violation import Kind
from coachable.behaviours import All, Any, Behaviour, Comparison, Dwell, Edge, Not, Phase, Phrase, Signal
from coachable.behaviours import load_behaviour as load
from coachable.foundation.errors import TraceError
from coachable.rewards.forms import reward_table
from tests.automata.tracked import DT, RUNS, X, behaviour_of, descriptions, follow

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
    found, overdue = [], set()
    for row, step in enumerate(follow(behaviour, xs)):
        if step.first:
            found += [(row, Kind.START_OUTSIDE)] if step.phase is None else []
            continue
        if step.previous != step.phase:
            if step.phase is None:
                found.append((row, Kind.LEFT))
            elif step.previous is not None and (step.previous, step.phase) not in edges:
                found.append((row, Kind.NOT_AN_EDGE))
        if step.too_short:
            found.append((row, Kind.TOO_SHORT))
        if step.too_long and (step.phase, step.stay) not in overdue:
            found.append((row, Kind.TOO_LONG))
            overdue.add((step.phase, step.stay))
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


@settings(max_examples=50)
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
    texts = sentences(behaviour, 0.02 * np.arange(12), x=[0, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 1], y=[0] * 12)
    assert texts[2:] == [
        "t = 0.06 s: P → outside comes too soon: P lasted 0.04 s of at least 0.05 s.",
        "t = 0.22 s: P lasts too long: 0.12 s of at most 0.1 s.",
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
        (2.0, {"x": 10**400, "y": 0.0}, "signal x must be a number"),
        (10**400, {"x": 1.0, "y": 0.0}, "the time must be numbers"),
        (2.0, {"x": "1.0", "y": 0.0}, "signal x must be a number"),
    ],
)
def test_a_sample_that_cannot_be_watched_is_refused_and_leaves_no_trace(t, values, words):
    monitor = Monitor(one_phase(Comparison("x", ">", 0)))
    monitor.feed(1.0, {"x": 1.0, "y": 0.0})
    before = monitor.report()
    with pytest.raises(TraceError, match=words):
        monitor.feed(t, values)
    assert monitor.report() == before


@pytest.mark.parametrize("options", [{"dt": 0.0}, {"dt": math.nan}, {"flicker": -1.0}, {"flicker": math.inf}])
def test_times_of_a_monitor_that_are_none_are_refused(options):
    with pytest.raises(TraceError, match=next(iter(options))):
        Monitor(one_phase(Comparison("x", ">", 0)), **options)


def test_nothing_was_seen_of_an_empty_trace():
    monitor = Monitor(WALKING)
    assert monitor.feed_rows([], {name: [] for name in ORDER})[1] == ()
    report = monitor.report()
    assert (report.samples, report.start, report.share_in_cycle, report.first) == (0, None, None, None)
    assert monitor.phase is None


def stand(times, columns=None):
    monitor = Monitor(one_phase(Comparison("x", ">", 0)))
    count = len(times)
    monitor.feed_rows(times, columns or {"x": [1.0] * count, "y": [0.0] * count})
    return monitor.report()


STAMPS = np.datetime64("2026-01-01T12:00:00") + np.arange(3) * np.timedelta64(10, "ms")
BERLIN = timezone(timedelta(hours=1))
MOMENTS = [datetime(2026, 1, 1, 13, 0, 0, 10_000 * index, BERLIN) for index in range(3)]


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (STAMPS, "2026-01-01T12:00:00"),
        (list(STAMPS), "2026-01-01T12:00:00"),
        (MOMENTS, "2026-01-01T12:00:00.* UTC"),
        ([moment.replace(tzinfo=None) for moment in MOMENTS], "2026-01-01T13:00:00"),
        (STAMPS - STAMPS[0], "durations"),
        (10_000_000 * np.arange(3), "nanoseconds"),
        (1_764_460_800_000 + 10 * np.arange(3), "milliseconds"),
        (0.01 * np.arange(3), "^$"),
    ],
)
def test_times_are_converted_to_seconds_and_that_is_said(times, words):
    report = stand(times)
    assert report.end == pytest.approx(0.02)
    assert re.search(words, report.clock)
    single = Monitor(one_phase(Comparison("x", ">", 0)))
    if "nanoseconds" not in words:
        for time in times:
            single.feed(time, {"x": 1.0, "y": 0.0})
        assert single.report().end == pytest.approx(0.02)


def test_pandas_gives_times_and_what_is_missing():
    pd = pytest.importorskip("pandas")
    index = pd.date_range("2026-01-01", periods=3, freq="10ms", tz="Europe/Berlin")
    columns = {"x": pd.array([1, None, 1], "Int64"), "y": pd.Series([0.0] * 3)}
    for times in (index, index.to_series(), list(index), index.tz_localize(None)):
        report = stand(times, columns)
        assert report.end == pytest.approx(0.02)
        assert report.samples_in["P"] == 2
    for missing in ([pd.Timedelta(0), pd.NaT], [pd.Timestamp(0), pd.NaT], [pd.NaT, pd.NaT]):
        with pytest.raises(TraceError, match="its time is not a number"):
            stand(missing)


def test_whole_numbers_that_are_no_seconds_are_refused_one_by_one():
    monitor = Monitor(one_phase(Comparison("x", ">", 0)))
    monitor.feed(0, {"x": 1.0, "y": 0.0})
    with pytest.raises(TraceError, match="nanoseconds"):
        monitor.feed(10_000_000, {"x": 1.0, "y": 0.0})


@pytest.mark.parametrize(
    ("first", "second"),
    [(MOMENTS[:1], STAMPS[1:]), (STAMPS[:1], [1.0, 2.0]), ([0.0], STAMPS)],
)
def test_two_kinds_of_time_in_one_trace_are_refused(first, second):
    monitor = Monitor(one_phase(Comparison("x", ">", 0)))
    monitor.feed_rows(first, {"x": [1.0], "y": [1.0]})
    before = monitor.report()
    with pytest.raises(TraceError, match="time"):
        monitor.feed_rows(second, {"x": [1.0] * len(second), "y": [1.0] * len(second)})
    assert monitor.report() == before


def test_what_is_masked_is_missing():
    masked = np.ma.array([1.0, -9999.0, 1.0], mask=[False, True, False])
    assert stand([0, 1, 2], {"x": masked, "y": masked}).samples_in["P"] == 2
    assert stand([0, 1, 2], {"x": masked.astype(int), "y": masked}).samples_in["P"] == 2
    monitor = Monitor(one_phase(Comparison("x", ">", 0)))
    (violation,) = monitor.feed(0.0, {"x": np.ma.masked, "y": 0.0})
    assert violation.sentence.endswith("x is NaN.")
    for times in (
        masked,
        np.ma.array(STAMPS, mask=masked.mask),
        np.ma.array(STAMPS - STAMPS[0], mask=masked.mask),
    ):
        with pytest.raises(TraceError, match="sample 2: its time is not a number"):
            stand(times, {"x": [1.0] * 3, "y": [1.0] * 3})
        monitor = Monitor(one_phase(Comparison("x", ">", 0)))
        monitor.feed(times[0], {"x": 1.0, "y": 0.0})
        with pytest.raises(TraceError, match="sample 2: its time is not a number"):
            monitor.feed(times[1], {"x": 1.0, "y": 0.0})
    with pytest.raises(TraceError, match="signal x must be numbers"):
        stand([0, 1, 2], {"x": STAMPS, "y": [1.0] * 3})


@given(
    descriptions(),
    st.lists(st.tuples(X, st.sampled_from([1, 1, 1, 1, 2, 4, 5, 6, 40])), min_size=2, max_size=30),
    st.data(),
)
@settings(max_examples=50)
def test_how_a_trace_with_gaps_is_cut_changes_nothing(description, samples, data):
    behaviour = behaviour_of(description)
    xs, times = [x for x, _ in samples], DT * np.cumsum([step for _, step in samples])
    cuts = [0, *sorted(data.draw(st.lists(st.integers(0, len(xs)), max_size=4))), len(xs)]
    whole, pieces, single = Monitor(behaviour), Monitor(behaviour), Monitor(behaviour)
    expected = whole.feed_rows(times, {"x": xs})[1]
    in_pieces = [v for a, b in pairwise(cuts) for v in pieces.feed_rows(times[a:b], {"x": xs[a:b]})[1]]
    one_by_one = [v for t, x in zip(times.tolist(), xs, strict=True) for v in single.feed(t, {"x": x})]
    assert repr(in_pieces) == repr(one_by_one) == repr(list(expected))
    assert repr(pieces.report()) == repr(single.report()) == repr(whole.report())


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_there_is_no_verdict_across_a_gap(side):
    """Two seconds of at most one, a minimum of one left after a gap, neither of which anybody saw."""
    behaviour = one_phase(Comparison("x", ">", 0), Dwell(1.0, 1.0))
    monitor = Monitor(behaviour)
    times = [0.0, 0.1, 0.2, 0.3, 2.3, 2.4, 2.5]
    xs = [1.0, 1.0, 1.0, 1.0, side, side, side]
    _, violations = monitor.feed_rows(times, {"x": xs, "y": [0.0] * 7})
    report = monitor.report()
    assert (report.gaps.count, report.gaps.total) == (1, pytest.approx(2.0))
    assert [violation.kind for violation in violations] == ([Kind.START_OUTSIDE] if side < 0 else [])
    assert report.stays["P"].count == 0


def test_a_slower_rate_is_no_gap_for_ever():
    times = np.concatenate([0.001 * np.arange(100), 1.0 + 0.1 * np.arange(100)])
    report = stand(times)
    assert 1 <= report.gaps.count <= 5


def nodding(flicker=None, absence=1):
    """Four seconds inside, some samples outside, again and again: at most five are allowed."""
    behaviour = one_phase(Comparison("x", ">", 0), Dwell(at_most=5.0))
    xs = ([1.0] * 40 + [-1.0] * absence) * 3
    monitor = Monitor(behaviour, flicker=flicker)
    found = monitor.feed_rows(0.1 * np.arange(len(xs)), {"x": xs, "y": [0.0] * len(xs)})[1]
    return [violation for violation in found if violation.kind is Kind.TOO_LONG], monitor.report()


def test_a_limit_is_not_undone_by_one_sample_outside():
    (violation,), report = nodding()
    assert violation.time == pytest.approx(5.1)
    assert "P lasts too long: 5.1 s, 1 short absence included, of at most 5 s" in violation.sentence
    assert report.stays["P"].longest == pytest.approx(4.0)
    assert not nodding(absence=2)[0]
    assert nodding(flicker=0.2, absence=2)[0]
    assert not nodding(flicker=0.2, absence=3)[0]
    assert not nodding(flicker=0.0)[0]
