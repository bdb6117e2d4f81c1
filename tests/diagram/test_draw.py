import dataclasses
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coachable import cli
from coachable.behaviours import (
    All,
    Any,
    Assignment,
    Behaviour,
    Between,
    Comparison,
    Edge,
    Not,
    Number,
    Phase,
    Phrase,
    Signal,
    Variable,
    load_behaviour,
)
from coachable.behaviours.expressions import Arithmetic, Call
from coachable.behaviours.library import SHIPPED
from coachable.behaviours.notation import pretty_name, pretty_predicate
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.diagram.draw import MOST_PHASES, automaton_svg
from coachable.diagram.layout import Ring, drawing_order
from coachable.diagram.plain_text import automaton_dot
from tests.behaviours.random_behaviours import built, expressions, predicates, recipe
from tests.diagram.pictures import BEHAVIOURS, HEIGHT, WALKING, elements, graph


def attribute(element, name):
    value = element.get(name)
    assert value is not None
    return value


def texts(svg, kind=None):
    return ["".join(element.itertext()) for element in elements(svg, "text", kind)]


def test_the_picture_of_ideal_walking_says_what_figure_4_says():
    svg = automaton_svg(WALKING)
    assert texts(svg, "name") == ["O1", "O2", "O3", "O4"]
    assert texts(svg, "event") == ["touchdown"]
    # A dot above the first letter of a cell is drawn as a circle of its own.
    assert texts(svg, "formula")[:4] == ["θ₁ > 0", "θ₂ ≤ 0", "θ₁ ≤ 0", "θ₂ > 0"]
    assert "".join(texts(svg, "reset")) == "θ₁:=θ₂θ₂:=θ₁θ₁:=θ₁⁺θ₂:=θ₂⁺"
    dots = [circle for circle in elements(svg, "circle") if circle.get("class") is None]
    assert len(dots) == 4 * 2 + 4
    assert len(elements(svg, "path", "edge")) == len(elements(svg, "path", "edge-head")) == 4
    assert len(elements(svg, "path", "leg stance")) == len(elements(svg, "path", "leg swing")) == 4


def test_the_pictograms_lean_as_the_signs_say():
    svg = automaton_svg(WALKING)
    leaning = {"stance": [], "swing": []}
    for leg, lean in leaning.items():
        for path in elements(svg, "path", f"leg {leg}"):
            x0, _, x1, _ = map(float, re.findall(r"-?[\d.]+", attribute(path, "d")))
            lean.append(x1 > x0)
    # θ₁ > 0: the hip is behind the foot. θ₂ > 0: the swing foot is ahead of the hip.
    assert leaning == {"stance": [False, False, True, True], "swing": [False, True, True, True]}


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_behaviour_is_drawn_alike_each_time(name):
    behaviour = load_behaviour(name)
    svg = automaton_svg(behaviour)
    assert svg == automaton_svg(parse(to_text(behaviour)))
    assert float(attribute(ET.fromstring(svg), "width")) <= 1060
    assert len(svg) < 60_000


@pytest.mark.parametrize("name", ["compass-walking", "compass-walking-released"])
def test_ideal_walking_fits_a_readme(name):
    assert float(attribute(ET.fromstring(automaton_svg(load_behaviour(name))), "width")) <= 860


def test_a_cycle_stands_clockwise_in_its_order_however_its_phases_are_given():
    shuffled = dataclasses.replace(WALKING, phases=tuple(WALKING.phases[index] for index in (2, 0, 3, 1)))
    assert drawing_order(shuffled) == ("O1", "O2", "O3", "O4")
    assert drawing_order(dataclasses.replace(shuffled, cycles=())) == ("O3", "O4", "O1", "O2")
    ring = Ring.of(4, 10.0, 10.0)
    assert list(ring.angles) == pytest.approx([-math.pi / 2, 0, math.pi / 2, math.pi])
    angles = [math.atan2(box.y, box.x) for box in ring.boxes]
    assert angles == pytest.approx([-math.pi / 2, 0, math.pi / 2, math.pi])


def test_phases_that_form_no_cycle_stand_as_they_are_given_with_all_their_edges():
    tree = graph(5, (0, 2), (0, 1), (1, 4), (4, 1), (3, 3), event="jump")
    assert drawing_order(tree) == tree.phase_names
    svg = automaton_svg(tree)
    assert len(elements(svg, "path", "edge")) == 5
    assert texts(svg, "event") == ["jump"] * 5
    assert elements(svg, "path", "leg stance") == []


def test_edges_between_the_same_phases_share_an_arrow():
    behaviour = graph(2, (0, 1), (1, 0))
    more = (*behaviour.edges, Edge("P0", "P1", "slip"), Edge("P0", "P1", "trip"))
    svg = automaton_svg(dataclasses.replace(behaviour, edges=more, cycles=()))
    assert len(elements(svg, "path", "edge")) == 2
    assert texts(svg, "event") == ["slip", "trip"]
    assert texts(svg, "note") == ["or without an event"]


def test_text_is_shown_and_never_run():
    evil = '<script>&1</script>"]]>'
    phase = Phase(evil, evil, HEIGHT)
    behaviour = Behaviour(evil, evil, (Signal("height"),), (phase,), (Edge(evil, evil, evil),))
    svg = automaton_svg(behaviour)
    assert not elements(svg, "script")
    assert texts(svg, "name") == texts(svg, "event") == [evil]
    assert elements(svg, "title")[0].text == f"{evil}: {evil}"


@settings(max_examples=40)
@example("\x00", "\x1f\ufffe", "\x0b")
@given(st.text(max_size=40), st.text(max_size=200), st.text(max_size=20))
def test_any_text_makes_a_document_that_can_be_parsed(name, title, event):
    phases = (Phase(f"P{name}", title, HEIGHT),)
    behaviour = Behaviour(name, title, (Signal("height"),), phases, (Edge(f"P{name}", f"P{name}", event),))
    ET.fromstring(automaton_svg(behaviour))


@settings(max_examples=40)
@example((Not, (Any,)))
@example((Not, (All, (Phrase, "so", (Not, (All,))))))
@given(
    predicates(
        expressions(recipe(Variable, st.sampled_from(("x", "y", "z"))) | recipe(Number, st.floats(-9, 9)))
    )
)
def test_any_predicate_can_be_drawn(predicate):
    predicate = built(predicate)
    signals = tuple(map(Signal, ("x", "y", "z")))
    behaviour = Behaviour("b", "", signals, (Phase("P", "", predicate),), ())
    assert texts(automaton_svg(behaviour), "name") == ["P"]
    assert "phase0" in automaton_dot(behaviour)


def test_resets_are_the_callers_and_only_of_signals_that_there_are():
    svg = automaton_svg(graph(1, (0, 0), event="land"), resets={"land": {"height": "rest", "speed": "rest"}})
    assert "".join(texts(svg, "reset")) == "height:=rest"


def test_names_and_predicates_are_set_in_the_papers_letters():
    names = ("theta_1", "dtheta_12", "omega", "theta_x", "height", "dx")
    assert [pretty_name(name) for name in names] == ["θ₁", "θ\u0307₁₂", "ω", "theta_x", "height", "dx"]
    low = Comparison("height", "<=", -0.5, 0.01)
    nested = All(HEIGHT, Any(low, Not(HEIGHT), Not(All(HEIGHT, low))))
    assert pretty_predicate(nested) == (
        "height > 0 ∧ (height ≤ −0.5 (±0.01) ∨ height ≤ 0 ∨ ¬(height > 0 ∧ height ≤ −0.5 (±0.01)))"
    )
    assert (pretty_predicate(All()), pretty_predicate(Any())) == ("true", "false")


def test_drawing_needs_neither_numpy_nor_jax():
    program = "import sys, coachable.diagram.draw; assert not {'numpy', 'jax'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_longest_cycle_stands_around_the_ring_and_the_rest_beside_it():
    order = drawing_order(BEHAVIOURS["two cycles"])
    assert [name for name in order if name in ("P0", "P1", "P2", "P3")] == ["P0", "P1", "P2", "P3"]
    assert sorted(order) == [f"P{index}" for index in range(7)]


def test_dwell_deadbands_constants_and_outside_are_told():
    svg = automaton_svg(BEHAVIOURS["gait"])
    assert texts(svg, "dwell") == ["0.02–0.3 s"] * 14
    notes = texts(svg, "note")
    assert notes[0] == "contact = 5 N"
    assert notes[1].startswith("(±…) is a deadband")
    assert notes[2] == "In no phase: falling."
    assert "right_hip > 0 (±0.01)" in texts(svg, "formula")


def test_an_edge_says_its_own_reset():
    svg = automaton_svg(BEHAVIOURS["hop"])
    assert "".join(texts(svg, "reset")) == "speed:=−0.5 speedload:=0"


def test_what_does_not_fit_as_a_formula_is_said_in_the_words_it_was_written_in():
    long = Comparison(
        "height",
        ">",
        Arithmetic(Number(1), "/", Call("max", Number(0.25), Number(0.375), Number(0.5), Variable("height"))),
    )
    words = Phrase("the hip is well above where it would have to be", All(long, HEIGHT))
    behaviour = graph(2, (0, 1), predicate=All(words, Not(Phrase("still", HEIGHT))))
    svg = automaton_svg(behaviour)
    assert texts(svg, "words")[:3] == ["the hip is well above where it", "would have to be", "not still"]
    assert texts(svg, "formula") == []
    short = graph(2, (0, 1), predicate=Phrase("the hip is high", HEIGHT))
    assert texts(automaton_svg(short), "formula") == ["height > 0"] * 2


def test_a_long_formula_is_broken_before_its_signs():
    names = ("the_lowest_height", "height_of_the_hip", "the_greatest_height")
    behaviour = Behaviour(
        "b",
        "",
        tuple(map(Signal, names)),
        (Phase("P", "", Between(names[0], "<", names[1], "<", names[2])),),
        (),
    )
    assert texts(automaton_svg(behaviour), "formula") == [
        "the_lowest_height",
        "< height_of_the_hip",
        "< the_greatest_height",
    ]


def test_many_assignments_are_told_as_exchanges():
    names = [f"{side}_{joint}" for side in ("left", "right") for joint in "abcd"]
    swap = tuple(
        Assignment(name, Variable(name.replace("left", "x").replace("right", "left").replace("x", "right")))
        for name in names
    )
    behaviour = dataclasses.replace(
        graph(2, (1, 0)),
        signals=tuple(map(Signal, ("height", *names))),
        edges=(Edge("P0", "P1", "step", swap),),
    )
    assert texts(automaton_svg(behaviour), "reset") == [f"left_{joint} ↔ right_{joint}" for joint in "abcd"]


def run(capsys, *arguments):
    cli.main(["draw", *arguments])
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "start"),
    [("x.svg", b"<svg "), ("x.png", b"\x89PNG\r\n"), ("x.dot", b"digraph "), ("x.mmd", b"flowchart ")],
)
def test_the_command_draws_by_the_suffix(name, start, tmp_path, capsys):
    out = tmp_path / name
    assert run(capsys, "compass-walking", "-o", str(out)) == f"{out}: compass-walking\n"
    assert out.read_bytes().startswith(start)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("-o", "x.pdf"), "ends in .svg, .png, .dot, .mmd"),
        (("-o", "x.dot", "--reward", "stay"), "ends in .svg, .png"),
        (("-o", "no/such/folder/x.svg"), "No such file"),
    ],
)
def test_the_command_says_what_cannot_be_drawn(arguments, complaint, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        cli.main(["draw", "compass-walking", *arguments])
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err


def test_the_command_draws_the_reward(tmp_path, capsys):
    out = tmp_path / "reward.svg"
    run(capsys, "compass-walking", "--reward", "equation", "-o", str(out))
    assert "variant equation" in out.read_text(encoding="utf-8")


def test_more_phases_than_anybody_could_read_are_not_drawn(tmp_path, capsys):
    number = MOST_PHASES + 1
    bands = "".join(f"  P{i}: x >= {i}, x < {i + 1}\n" for i in range(number))
    file = tmp_path / "bands.behaviour"
    file.write_text(f'behaviour "bands & more"\n\nsignals\n  x [m] place\n\nphases\n{bands}')
    svg = automaton_svg(load_behaviour(file))
    assert f"bands &amp; more: {number} phases" in svg
    ET.fromstring(svg)
    with pytest.raises(SystemExit) as stopped:
        cli.main(["draw", str(file), "-o", str(tmp_path / "bands.svg")])
    assert (stopped.value.code, f"{number} phases" in capsys.readouterr().err) == (2, True)
    assert not (tmp_path / "bands.svg").exists()
