import dataclasses
import json

import pytest

from coachable import cli
from coachable.behaviours import Assignment, Comparison, Dwell, Edge, Signal, Variable, load_behaviour
from coachable.rewards.difference import differences

WALKING = dataclasses.replace(load_behaviour("compass-walking"), cycles=())
O1, *_, O4 = WALKING.phases


def changed(**fields):
    return dataclasses.replace(WALKING, **fields)


def with_first(**fields):
    return changed(phases=(dataclasses.replace(O1, **fields), *WALKING.phases[1:]))


CYCLE = WALKING.edges
PUSHING = changed(
    phases=(dataclasses.replace(O1, name="push"), *WALKING.phases[1:]),
    edges=(Edge("push", "O2"), *CYCLE[1:3], Edge("O4", "push", "touchdown")),
)
TURNED = (*CYCLE[1:], CYCLE[0])
ON_LANDING = (*CYCLE[:3], dataclasses.replace(CYCLE[3], event="landing"))
SWAP = (Assignment("theta_1", Variable("theta_2")),)
WITH_RESET = (*CYCLE[:3], dataclasses.replace(CYCLE[3], reset=SWAP))


def test_a_behaviour_means_what_it_means():
    assert differences(WALKING, WALKING) == ()


@pytest.mark.parametrize(
    ("other", "about", "words"),
    [
        (
            changed(signals=(*WALKING.signals, Signal("lift"))),
            "signals",
            "Only the second has the signal lift",
        ),
        (
            changed(signals=(Signal("theta_1", "deg"), *WALKING.signals[1:])),
            "signals",
            "theta_1 has rad in the first and deg in the second",
        ),
        (changed(edges=CYCLE[:3]), "reward", "Going from O4 to O1 pays +1 in the first and -1 in the second"),
        (changed(edges=(*CYCLE, Edge("O2", "O4"))), "reward", "from O2 to O4 pays -1 in the first"),
        (with_first(dwell=Dwell(0.05, 0.4)), "dwell", "as long as it likes in the first and 0.05 s to 0.4 s"),
        (with_first(dwell=Dwell(at_least=0.1)), "dwell", "at least 0.1 s in the second"),
        (changed(cycles=(CYCLE,)), "cycles", "Only the second counts the cycle O1 → O2 → O3 → O4 → O1"),
        (changed(edges=ON_LANDING), "events", "on touchdown in the first and on landing in the second"),
        (changed(edges=WITH_RESET), "events", "on touchdown with theta_1 := theta_2 in the second"),
        (changed(outside="falling"), "outside", "Only the second means states outside all phases"),
        (PUSHING, "names", "What the first calls O1, the second calls push"),
        (with_first(title="trailing"), "names", "“trailing” in the second"),
    ],
)
def test_each_difference_is_told(other, about, words):
    (found,) = differences(WALKING, other)
    assert found.about == about
    assert words in found.sentence
    assert found.matters == (about != "names")
    (back,) = differences(other, WALKING)
    assert back.about == about


def test_a_deadband_is_told_with_a_state_that_it_keeps():
    parts = O1.predicate.parts
    banded = Comparison("theta_1", ">", 0, 0.01)
    (found,) = differences(WALKING, with_first(predicate=type(O1.predicate)(banded, *parts[1:])))
    assert found.about == "deadband"
    assert found.state is not None
    assert -0.01 < found.state["theta_1"] <= 0


def test_phases_that_one_lacks_are_told_before_what_follows_from_it():
    found = differences(WALKING, changed(phases=WALKING.phases[:3], edges=CYCLE[:2]))
    assert [one.about for one in found] == ["phases", "phases"]
    assert found[0].sentence == "The first has 4 phases, the second 3."
    assert found[1].state is not None
    assert WALKING.phase_at(found[1].state) == "O4"


def test_the_order_of_edges_and_the_start_of_a_cycle_mean_nothing():
    assert differences(changed(cycles=(CYCLE,)), changed(edges=TURNED, cycles=(TURNED,))) == ()


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as end:
        cli.main(["diff", *arguments])
    return end.value.code, capsys.readouterr()


def test_the_command_exits_0_for_the_same_meaning_1_for_another_2_for_what_cannot_be_read(capsys):
    code, printed = run(capsys, "compass-walking", "compass-walking")
    assert code == 0
    assert printed.out == "The same phases everywhere.\nThey mean the same.\n"
    code, printed = run(capsys, "compass-walking", "compass-walking-released")
    assert code == 1
    assert "A state is O1 in the first and outside in the second.\n  theta_1 = " in printed.out
    assert " rad/s" in printed.out
    code, printed = run(capsys, "compass-walking", "compass-waking")
    assert code == 2
    assert "did you mean" in printed.err


def test_the_command_prints_json(capsys):
    code, printed = run(capsys, "compass-walking", "compass-walking-released", "--json")
    told = json.loads(printed.out)
    assert code == 1
    assert not told["same_meaning"]
    released = load_behaviour("compass-walking-released")
    for difference in told["differences"]:
        assert WALKING.phase_at(difference["state"]) is not None
        assert released.phase_at(difference["state"]) is None
