import dataclasses
import itertools
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coachable.automata.draw import automaton_svg
from coachable.automata.layout import Ring, drawing_order
from coachable.automata.notation import pretty_name, pretty_predicate
from coachable.behaviours import All, Any, Behaviour, Comparison, Edge, Not, Phase, Signal, load_behaviour
from coachable.behaviours.library import SHIPPED
from coachable.behaviours.parser import parse
from coachable.behaviours.printer import to_text

SVG = "{http://www.w3.org/2000/svg}"
WALKING = load_behaviour("compass-walking")
HEIGHT = Comparison("height", ">", 0)


def elements(svg, tag, kind=None):
    found = ET.fromstring(svg).iter(SVG + tag)
    return [element for element in found if kind is None or element.get("class") == kind]


def attribute(element, name):
    value = element.get(name)
    assert value is not None
    return value


def texts(svg, kind=None):
    return ["".join(element.itertext()) for element in elements(svg, "text", kind)]


def graph(num_phases, *pairs, event=None):
    phases = tuple(Phase(f"P{index}", "a title", HEIGHT) for index in range(num_phases))
    edges = tuple(Edge(f"P{source}", f"P{target}", event) for source, target in pairs)
    return Behaviour("graph", "", (Signal("height", "m"),), phases, edges)


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
    assert automaton_svg(behaviour) == automaton_svg(parse(to_text(behaviour)))


def test_ideal_walking_fits_a_readme():
    assert float(attribute(ET.fromstring(automaton_svg(WALKING)), "width")) <= 860


def test_nothing_lies_on_anything_else():
    svg = automaton_svg(WALKING)
    page = [float(number) for number in attribute(ET.fromstring(svg), "viewBox").split()]
    boxes = [
        [float(attribute(box, key)) for key in ("x", "y", "width", "height")]
        for box in [*elements(svg, "rect", "node"), *elements(svg, "rect", "clearing")]
    ]
    assert len(boxes) == 5
    for x, y, width, height in boxes:
        assert page[0] < x < x + width < page[0] + page[2]
        assert page[1] < y < y + height < page[1] + page[3]
    for one, other in itertools.combinations(boxes, 2):
        apart = [abs(one[axis] + one[axis + 2] / 2 - other[axis] - other[axis + 2] / 2) for axis in (0, 1)]
        assert any(apart[axis] >= (one[axis + 2] + other[axis + 2]) / 2 for axis in (0, 1))
    for text in elements(svg, "text"):
        x, y = float(attribute(text, "x")), float(attribute(text, "y"))
        assert any(0 <= x - box[0] <= box[2] and 0 <= y - box[1] <= box[3] for box in boxes)


def distance_to_border(box, x, y):
    return max(abs(x - box.x) - box.width / 2, abs(y - box.y) - box.height / 2)


@pytest.mark.parametrize("count", range(1, 7))
def test_every_arrow_goes_from_border_to_border(count):
    ring = Ring.of(count, 250.0, 120.0)
    for source, target in itertools.product(range(count), repeat=2):
        arrow = ring.arrow(source, target)
        start = map(float, re.findall(r"-?[\d.]+", arrow.curve)[:2])
        tip = map(float, re.findall(r"-?[\d.]+", arrow.head)[:2])
        assert distance_to_border(ring.boxes[source], *start) == pytest.approx(0, abs=3)
        assert distance_to_border(ring.boxes[target], *tip) == pytest.approx(3, abs=3)
    for one, other in itertools.combinations(ring.boxes, 2):
        assert not one.overlaps(other, (50.0, 50.0))
    assert ring.boxes[0].y == min(box.y for box in ring.boxes)


def test_a_cycle_stands_clockwise_in_its_order_however_its_phases_are_given():
    shuffled = dataclasses.replace(WALKING, phases=tuple(WALKING.phases[index] for index in (2, 0, 3, 1)))
    assert drawing_order(shuffled) == ("O3", "O4", "O1", "O2")
    ring = Ring.of(4, 10.0, 10.0)
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


def test_text_is_shown_and_never_run():
    evil = "<script>alert('1')</script> & \"]]>"
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


def test_resets_are_the_callers_and_only_of_signals_that_there_are():
    svg = automaton_svg(graph(1, (0, 0), event="land"), resets={"land": {"height": "rest", "speed": "rest"}})
    assert "".join(texts(svg, "reset")) == "height:=rest"


def test_names_and_predicates_are_set_in_the_papers_letters():
    names = ("theta_1", "dtheta_12", "omega", "theta_x", "height", "dx")
    assert [pretty_name(name) for name in names] == ["θ₁", "θ\u0307₁₂", "ω", "theta_x", "height", "dx"]
    low = Comparison("height", "<=", -0.5)
    nested = All(HEIGHT, Any(low, Not(HEIGHT)))
    assert pretty_predicate(nested) == "height > 0 ∧ (height ≤ −0.5 ∨ ¬(height > 0))"
    assert (pretty_predicate(All()), pretty_predicate(Any())) == ("true", "false")


def test_drawing_needs_neither_numpy_nor_jax():
    program = "import sys, coachable.automata.draw; assert not {'numpy', 'jax'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)
