"""Every finding, where it is due and where it is not."""

import dataclasses

import pytest

from coachable.behaviours import (
    All,
    Any,
    Assignment,
    Behaviour,
    Between,
    Comparison,
    Constant,
    Dwell,
    Edge,
    Near,
    Not,
    Number,
    Phase,
    Phrase,
    Signal,
    Variable,
    holds,
    load_behaviour,
)
from coachable.behaviours.checking import boxes, partition
from coachable.behaviours.checking.checker import check
from coachable.behaviours.checking.findings import Proven
from coachable.behaviours.expressions import Arithmetic, Call
from coachable.behaviours.rewriting import widened
from coachable.behaviours.text.parser import parse

X, V = Signal("x", "m"), Signal("v", "m/s", derivative_of="x")
LOW, HIGH = Comparison("x", "<", 0), Comparison("x", ">=", 0)
FORWARD, BACKWARD = Comparison("v", ">", 0), Comparison("v", "<=", 0)


def behaviour(phases, edges=(), signals=(X, V), **further):
    """Phases as name → predicate, or (predicate, dwell)."""
    pairs = {name: value if isinstance(value, tuple) else (value, None) for name, value in phases.items()}
    return Behaviour(
        "example",
        "",
        signals,
        tuple(Phase(name, name, predicate, dwell) for name, (predicate, dwell) in pairs.items()),
        tuple(edge if isinstance(edge, Edge) else Edge(*edge) for edge in edges),
        **further,
    )


def cycle(phases, *names, **further):
    edges = tuple(Edge(*pair) for pair in zip(names, (*names[1:], names[0]), strict=True))
    return behaviour(phases, edges, cycles=(edges,), **further)


def kinds(of):
    return {finding.kind for finding in check(of).findings}


def the(of, kind):
    (finding,) = (finding for finding in check(of).findings if finding.kind == kind)
    return finding


def paper():
    """The paper's behaviour, with what are derivatives declared as such and its cycle."""
    shipped = load_behaviour("compass-walking")
    signals = tuple(
        dataclasses.replace(signal, derivative_of=signal.name[1:] if signal.name.startswith("d") else None)
        for signal in shipped.signals
    )
    return dataclasses.replace(shipped, signals=signals, cycles=(shipped.edges,))


def test_the_paper_passes_and_hears_of_camping_and_of_what_is_outside():
    report = check(paper())
    assert ", ".join(report.proven).startswith(
        "4 phases, pairwise disjoint, 12 of 16 orthants outside, cycle closed through touchdown"
    )
    assert report.unknown == ()
    assert report.passes()
    assert not report.passes(strict=True)
    assert {finding.kind for finding in report.findings} <= {"camping", "gap", "unused-phrase"}
    camp = the(paper(), "camping")
    assert camp.subjects[0].name == "O4"
    assert camp.witness["dtheta_1"] == camp.witness["dtheta_2"] == 0.0
    assert paper().phase_at(camp.witness) == "O4"
    assert paper().phase_at(the(paper(), "gap").witness) is None


def test_a_clean_behaviour_has_nothing_to_find():
    clean = check(cycle({"up": FORWARD, "down": Not(FORWARD)}, "up", "down", signals=(Signal("v", "m/s"),)))
    assert clean.findings == ()
    assert clean.proven[:3] == ("2 phases", "pairwise disjoint", "no state outside")
    assert "cycle closed" in clean.proven


def test_overlap_shows_a_state_in_both_and_tells_of_a_hidden_phase():
    partly = the(behaviour({"low": Comparison("x", "<", 1), "high": Comparison("x", ">", 0)}), "overlap")
    assert 0 < partly.witness["x"] < 1
    assert [subject.name for subject in partly.subjects] == ["high", "low"]
    assert "written first" in partly.message
    hidden = the(behaviour({"low": Comparison("x", "<", 1), "lower": Comparison("x", "<", 0)}), "overlap")
    assert "no state counts as lower" in hidden.message
    assert "overlap" not in kinds(behaviour({"low": LOW, "high": HIGH}))


def test_an_empty_phase_names_what_excludes_what():
    empty = behaviour({"none": All(Comparison("x", ">", 1), FORWARD, Comparison("x", "<", 0)), "low": LOW})
    assert "`x > 1` and `x < 0` never hold together" in the(empty, "empty-phase").message
    assert "empty-phase" not in kinds(behaviour({"some": Near("x", 1, 0), "low": LOW}))
    assert the(behaviour({"none": Any(), "low": LOW}), "empty-phase").message == (
        "No state is in none: `false` holds nowhere."
    )


def test_a_gap_is_counted_and_named():
    two = {"low": LOW, "high": Comparison("x", ">", 1)}
    gap = the(behaviour(two), "gap")
    assert "3 cells, and 1 of them is outside: x >= 0 and x <= 1." in gap.message
    assert 0 <= gap.witness["x"] <= 1
    named = check(behaviour(two, outside="between"))
    assert '1 of 3 cells outside, which is "between"' in named.proven
    assert "gap" not in {finding.kind for finding in named.findings}
    assert "unused-outside" in kinds(behaviour({"low": LOW, "high": HIGH}, outside="between"))


def test_a_gap_between_sines_has_a_witness_though_its_cells_are_not_counted():
    foot_up = Comparison(Arithmetic(Call("cos", Variable("x")), "-", Number(0.5)), ">", 0)
    gap = the(behaviour({"up": foot_up}, signals=(Signal("x", "rad"),)), "gap")
    assert gap.message == "Some states are in no phase."
    assert not holds(foot_up, gap.witness)


def test_phases_far_apart_are_joined_only_by_a_jump():
    phases = {"low": LOW, "high": Comparison("x", ">", 1), "between": Between(0, "<=", "x", "<=", 1)}
    apart = the(behaviour(phases, [("low", "high")]), "no-common-boundary")
    assert "`x <= 0`; `x >= 1`" in apart.message
    assert "no-common-boundary" not in kinds(behaviour(phases, [("low", "high", "kick"), ("low", "between")]))


def test_phases_that_touch_through_a_deadband_alone_do_touch():
    def phases(deadband):
        return {"low": Comparison("x", "<", 0), "high": Comparison("x", ">", 1, deadband)}

    assert "no-common-boundary" in kinds(behaviour(phases(0.5), [("high", "low")]))
    assert "no-common-boundary" not in kinds(behaviour(phases(1.0), [("high", "low")]))


@pytest.mark.parametrize(
    ("source", "target", "possible"),
    [
        (All(LOW, FORWARD), All(HIGH, FORWARD), True),
        (All(HIGH, FORWARD), All(LOW, FORWARD), False),
        (All(HIGH, BACKWARD), All(LOW, BACKWARD), True),
        (All(LOW, BACKWARD), All(HIGH, BACKWARD), False),
        # At the boundary itself it may stand, and may then fall below.
        (All(HIGH, FORWARD), All(LOW, BACKWARD), True),
        # A boundary of the speed itself may be crossed either way.
        (FORWARD, BACKWARD, True),
        (BACKWARD, FORWARD, True),
        # A position whose speed nobody declared is free.
        (All(Comparison("y", ">", 0), FORWARD), All(Comparison("y", "<=", 0), FORWARD), True),
        # The sum rises where its derivative, the speed, is positive.
        (
            All(Comparison(Arithmetic(Variable("x"), "+", Number(1)), ">", 0), FORWARD),
            All(Comparison(Arithmetic(Variable("x"), "+", Number(1)), "<=", 0), FORWARD),
            False,
        ),
        # 1 / (2 + x²) falls while x > 0 rises.
        (
            All(
                Comparison(Arithmetic(Variable("x"), "*", Variable("x")), "<", 1),
                Comparison("x", ">", 0),
                Comparison("v", "<", -1),
            ),
            All(
                Comparison(Arithmetic(Variable("x"), "*", Variable("x")), ">=", 1),
                Comparison("x", ">", 0),
                Comparison("v", "<", -1),
            ),
            False,
        ),
        # The height cos x falls while x > 0 rises: it cannot come up again.
        (
            All(Comparison(Call("cos", Variable("x")), "<", 0.5), Between(0.1, "<", "x", "<", 3), FORWARD),
            All(Comparison(Call("cos", Variable("x")), ">=", 0.5), Between(0.1, "<", "x", "<", 3), FORWARD),
            False,
        ),
        (
            All(Comparison(Call("cos", Variable("x")), ">", 0.5), Between(0.1, "<", "x", "<", 3), FORWARD),
            All(Comparison(Call("cos", Variable("x")), "<=", 0.5), Between(0.1, "<", "x", "<", 3), FORWARD),
            True,
        ),
    ],
)
def test_an_edge_is_impossible_where_derivatives_forbid_it(source, target, possible):
    edged = behaviour({"A": source, "B": target}, [("A", "B")], signals=(X, V, Signal("y", "m")))
    assert ("impossible-edge" not in kinds(edged)) == possible


def test_an_impossible_edge_names_the_derivative_and_excludes_its_cycle():
    turned = cycle({"A": All(LOW, FORWARD), "B": All(HIGH, FORWARD)}, "A", "B")
    edge = the(turned, "impossible-edge")
    assert "Entering A across the boundary of `x < 0` requires `v < 0`" in edge.message
    assert edge.subjects[0].name == "B → A"
    assert "B → A is impossible" in the(turned, "impossible-cycle").message


def test_a_cycle_of_possible_edges_can_be_impossible():
    inside = Between(0, "<=", "x", "<=", 1)
    phases = {
        "above": Comparison("x", ">", 1),
        "inside": All(inside, Comparison("v", ">=", 0)),
        "below": LOW,
        "turn": All(inside, Comparison("v", "<", 0)),
    }
    edges = (
        Edge("above", "inside"),
        Edge("inside", "below"),
        Edge("below", "turn"),
        Edge("turn", "above", "lift"),
    )
    blocked = behaviour(phases, edges, cycles=(edges,))
    assert "impossible-edge" not in kinds(blocked)
    assert "can never be left along inside → below" in the(blocked, "impossible-cycle").message
    free = dataclasses.replace(blocked, signals=(X, Signal("v", "m/s")))
    assert "impossible-cycle" not in kinds(free)
    assert "cycle closed through lift" in check(free).proven


def test_a_reset_must_be_able_to_land_in_its_target():
    def jumping(by):
        rise = (Assignment("x", Arithmetic(Variable("x"), "+", Number(by))),)
        return behaviour({"low": LOW, "high": HIGH}, [Edge("high", "low", "kick", rise)])

    assert "impossible-reset" in kinds(jumping(1.0))
    assert "impossible-reset" not in kinds(jumping(-1.0))


def test_two_edges_at_once():
    def choice(first, second, **labels):
        edges = [Edge("high", "A", **labels), Edge("high", "B")]
        return behaviour({"high": HIGH, "A": All(LOW, first), "B": All(LOW, second)}, edges)

    at = the(choice(Comparison("v", "<", 1), FORWARD), "two-edges-at-once")
    assert 0 < at.witness["v"] < 1
    assert "two-edges-at-once" not in kinds(choice(BACKWARD, FORWARD))
    assert "two-edges-at-once" not in kinds(choice(Comparison("v", "<", 1), FORWARD, event="kick"))
    resets = [(Assignment("x", Number(to)),) for to in (1.0, 2.0)]
    twofold = behaviour({"low": LOW, "high": HIGH}, [Edge("low", "high", "kick", reset) for reset in resets])
    assert "leads to two states at once" in the(twofold, "two-edges-at-once").message


@pytest.mark.parametrize(
    ("dwell", "complaint"),
    [
        (Dwell(2, 1), "at least 2 s and at most 1 s"),
        (Dwell(0, 0), "at most 0 s"),
        (Dwell(1.5), "in 1.5 s x would leave it, for there v is at least 1 m/s"),
        (Dwell(0.5), None),
        (Dwell(0.1, 2), None),
    ],
)
def test_dwell_times_that_cannot_be_kept(dwell, complaint):
    moving = All(Between(0, "<", "x", "<", 1), Comparison("v", ">", 1))
    rushing = cycle({"A": (moving, dwell), "B": Not(moving)}, "A", "B")
    if complaint is None:
        assert "contradictory-dwell" not in kinds(rushing)
    else:
        assert complaint in the(rushing, "contradictory-dwell").message


def test_a_phase_that_must_be_left_needs_an_edge():
    stuck = behaviour({"A": (LOW, Dwell(0, 1)), "B": HIGH}, [("B", "A")])
    assert "no edge leaves it" in the(stuck, "contradictory-dwell").message


def test_camping_is_bounded_by_a_dwell_time_and_forbidden_by_a_speed():
    def home(predicate, dwell=None):
        return cycle({"out": FORWARD, "home": (predicate, dwell)}, "out", "home")

    camp = the(home(BACKWARD), "camping")
    assert (camp.severity, camp.witness["v"]) == ("warning", 0.0)
    assert "+1 every step, for as long as the episode lasts" in camp.message
    bounded = the(home(BACKWARD, Dwell(0, 0.5)), "bounded-camping")
    assert "at most 0.5 s, then −1" in bounded.message
    assert "camping" not in kinds(home(BACKWARD, Dwell(0, 0.5)))
    assert "nowhere to camp" in check(home(Comparison("v", "<", 0))).proven


def test_a_deadband_lets_a_robot_camp_beyond_the_boundary():
    back = Comparison("v", "<", -0.1, 0.2)
    camp = the(behaviour({"out": FORWARD, "back": back}, [("out", "back"), ("back", "out")]), "camping")
    assert "kept there by its deadband" in camp.message
    assert not holds(back, camp.witness)
    assert holds(widened(back), camp.witness)


def test_standing_is_unknown_where_no_derivative_is_declared():
    report = check(behaviour({"low": LOW, "high": HIGH}, signals=(X,)))
    assert any("standing robot" in question for question in report.unknown)


LEAN = Signal("lean", "rad")
RATE = Signal("rate", "rad/s", derivative_of="lean")


@pytest.mark.parametrize(
    ("predicate", "message"),
    [
        (Comparison("lean", ">", Number(5.0, "deg")), "5 [deg] is 0.08727 [rad]"),
        (Comparison("lean", ">", Constant("most", Number(5.0, "deg"))), "5 [deg] is 0.08727 [rad]"),
        (Comparison("lean", ">", "rate"), "lean is in rad, and rate is in rad/s"),
        (Comparison(Arithmetic(Variable("lean"), "+", Variable("rate")), ">", 0), "rate is in rad/s"),
        (Comparison(Call("sin", Variable("height")), ">", 0), "sin takes radians"),
        (Comparison(Call("max", Variable("lean"), Variable("height")), ">", 0), "height is in m"),
        (Comparison("lean", ">", 0, Number(1.0, "m")), "is in m"),
        (Near("lean", 0, Number(1.0, "deg")), "1 [deg] is 0.01745 [rad]"),
        (Comparison(Arithmetic(Variable("lean"), "/", Number(2.0, "s")), ">", "lean"), "is in rad/s"),
        (Comparison("duty", ">", Number(50.0, "%")), "50 [%] is 0.5"),
        # What agrees: bare numbers, products, arcs, radians as numbers.
        (Comparison("lean", ">", 5), None),
        (Comparison(Arithmetic(Variable("height"), "*", Variable("rate")), ">", Number(1.0, "m/s")), None),
        (Comparison(Arithmetic(Number(2.0), "*", Variable("lean")), ">", Number(0.1, "rad")), None),
        (Comparison(Arithmetic(Variable("height"), "/", Number(2.0, "s")), ">", Number(1.0, "m/s")), None),
        (Comparison(Call("sin", Variable("lean")), ">", 0.5), None),
        (Near("lean", Number(0.1, "rad"), Number(0.01, "rad")), None),
    ],
)
def test_units_must_agree(predicate, message):
    signals = (LEAN, RATE, Signal("height", "m"), Signal("duty"))
    measured = behaviour({"A": predicate, "B": Not(predicate)}, signals=signals)
    found = [finding.message for finding in check(measured).findings if finding.kind == "unit-mismatch"]
    if message is None:
        assert found == []
    else:
        assert message in found[0]


def test_a_mismatch_in_a_phrase_is_told_once_and_at_the_phrase():
    phrase = Phrase("leans", Comparison("lean", ">", Number(5.0, "deg")))
    mixed = behaviour({"A": phrase, "B": Not(phrase)}, signals=(LEAN,), vocabulary=(phrase,))
    assert str(the(mixed, "unit-mismatch").subjects[0]) == "phrase leans"


def test_a_derivative_is_in_its_signals_unit_per_second():
    for unit, agrees in (("rad/s", True), ("1/s", True), ("deg/s", False), ("rad", False), ("", False)):
        rated = behaviour({"A": FORWARD}, signals=(LEAN, Signal("v", unit, derivative_of="lean")))
        assert ("unit-mismatch" not in kinds(rated)) == agrees, unit


def test_a_reset_keeps_the_unit():
    def jump(to):
        return behaviour(
            {"A": Comparison("lean", ">", 0), "B": Comparison("lean", "<=", 0)},
            [Edge("A", "B", "kick", (Assignment("lean", to),))],
            signals=(LEAN, RATE),
        )

    assert "unit-mismatch" in kinds(jump(Variable("rate")))
    assert "unit-mismatch" not in kinds(jump(Arithmetic(Number(0.0), "-", Variable("lean"))))


def test_units_that_cannot_be_read_or_look_misspelt():
    assert "unreadable-unit" in kinds(behaviour({"A": LOW}, signals=(Signal("x", "m//s"),)))
    assert "unfamiliar-unit" in kinds(behaviour({"A": LOW}, signals=(Signal("x", "rads"),)))
    assert kinds(behaviour({"A": LOW, "B": HIGH}, signals=(Signal("x", "step"),))) == {"unconnected-phase"}


def test_what_is_in_a_number_of_a_phase_is_read_too():
    broken = behaviour({"A": Comparison("x", ">", Number(1.0, "m//s"))})
    assert "unreadable-unit" in kinds(broken)


def test_words_that_nobody_needs():
    unused = Phrase("is far", Comparison("x", ">", Constant("far", Number(9.0, "m"))))
    inner = Phrase("is low", LOW)
    outer = Phrase("is down", inner)
    of = behaviour(
        {"low": outer, "high": Not(inner)},
        vocabulary=(inner, outer, unused),
        constants=(Constant("far", Number(9.0, "m")),),
    )
    names = {finding.kind: finding.subjects[0].name for finding in check(of).findings}
    assert (names["unused-phrase"], names["unused-constant"], names["unused-signal"]) == (
        "is far",
        "far",
        "v",
    )
    assert all(finding.severity == "note" for finding in check(of).findings if "unused" in finding.kind)


def test_phases_outside_the_order():
    phases = {"A": LOW, "B": Between(0, "<=", "x", "<", 1), "C": Comparison("x", ">=", 1)}
    of = check(behaviour(phases, [("A", "B")]))
    found = {finding.subjects[0].name: finding.kind for finding in of.findings if "phase" in finding.kind}
    assert found == {"A": "unentered-phase", "B": "dead-end-phase", "C": "unconnected-phase"}
    assert not kinds(behaviour({"A": LOW})) & {"unconnected-phase", "unentered-phase", "dead-end-phase"}


def test_the_same_behaviour_gives_the_same_report():
    assert check(paper()) == check(paper())


SIDES = """behaviour "sides"
signals
  sway [m]
  speed [m/s]
  left_load [N]
  right_load [N]
{}
phases
  left_stands: left_load > right_load, {}
cycle
  left_stands -> right_stands
"""


@pytest.mark.parametrize(
    ("mirror", "condition", "found"),
    [
        ("mirror left <-> right", "sway > 0 [m]", True),
        ("mirror left <-> right, sway -> -sway", "sway > 0 [m]", False),
        ("mirror left <-> right", "abs(sway) < 1 [m], speed > 0", False),
        ("mirror left <-> right", "0.1 [m] < sway < 0.2 [m]", True),
    ],
)
def test_a_lateral_signal_that_keeps_its_sign_in_the_mirror_is_found(mirror, condition, found):
    report = check(parse(SIDES.format(mirror, condition)))
    assert ("lateral-signal" in {finding.kind for finding in report.findings}) == found


def bands(number):
    phases = "".join(f"  P{i}: x >= {i}, x < {i + 1}\n" for i in range(number))
    return parse(f'behaviour "bands"\n\nsignals\n  x [m] place\n\nphases\n{phases}')


def test_phases_whose_bounds_are_apart_are_disjoint_without_the_solver(monkeypatch):
    def asked(*arguments):
        raise AssertionError("the solver was asked")

    monkeypatch.setattr(partition, "witness", asked)
    assert [str(one) for one in partition.overlaps(bands(300))] == [str(Proven("pairwise disjoint"))]


@pytest.mark.parametrize("first", ["x > 1", "x >= 1", "x < 1", "x <= 1", "x > 1, x < 2", "x > 2, x < 1"])
@pytest.mark.parametrize("second", ["x > 1", "x <= 1", "x >= 2", "x < 2", "y <= 0", "y > 0"])
def test_bounds_are_apart_only_where_the_solver_finds_no_state(first, second):
    text = f'behaviour "b"\n\nsignals\n  x [m] a\n  y [m] b\n\nphases\n  A: {first}\n  B: {second}\n'
    behaviour = parse(text)
    one, other = (phase.predicate for phase in behaviour.phases)
    is_apart = boxes.apart(boxes.box_of(one), boxes.box_of(other))
    meets = partition.witness(behaviour.signal_names, one, other) is not False
    assert not (is_apart and meets)
    if "x" in second and first != "x > 2, x < 1":
        assert is_apart != meets
