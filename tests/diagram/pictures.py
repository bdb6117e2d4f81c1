"""Behaviours of every shape that a picture has to cope with, and the boxes and curves of what was drawn."""

import dataclasses
import functools
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import matplotlib
from matplotlib.font_manager import get_font

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
    load_behaviour,
)
from coachable.behaviours.expressions import Arithmetic, Call
from coachable.diagram.draw import automaton_svg
from coachable.diagram.layout import Box

SVG = "{http://www.w3.org/2000/svg}"
WALKING = load_behaviour("compass-walking")
HEIGHT = Comparison("height", ">", 0)
_FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"


def graph(num_phases, *pairs, event=None, title="a title", predicate=HEIGHT):
    phases = tuple(Phase(f"P{index}", title, predicate) for index in range(num_phases))
    edges = tuple(Edge(f"P{source}", f"P{target}", event) for source, target in pairs)
    return Behaviour("graph", "", (Signal("height", "m"),), phases, edges)


def around(count):
    return [(index, (index + 1) % count) for index in range(count)]


def gait():
    """Perry's phases of one leg and then of the other, as a vocabulary of phrases over eight signals."""
    contact = Constant("contact", Number(5, "N"))
    signals, phases = [], []
    for side, other in (("right", "left"), ("left", "right")):
        signals += [Signal(f"{side}_load", "N"), Signal(f"{side}_knee", "rad"), Signal(f"{side}_hip", "rad")]
        down = Phrase(f"{side} foot is down", Comparison(f"{side}_load", ">", contact))
        beside = Phrase(f"{other} foot is down", Comparison(f"{other}_load", ">", contact))
        ahead = Phrase(f"{side} thigh points forward", Comparison(f"{side}_hip", ">", 0, 0.01))
        straight = Phrase(f"{side} knee is nearly straight", Between(-0.1, "<", f"{side}_knee", "<=", 0.2))
        for name, parts in (
            ("loading response", (down, beside, ahead)),
            ("mid stance", (down, Not(beside), ahead, straight)),
            ("terminal stance", (down, Not(beside), Not(ahead))),
            ("pre-swing", (down, beside, Not(ahead), Not(straight))),
            ("initial swing", (Not(down), Not(ahead))),
            ("mid swing", (Not(down), ahead, Not(straight))),
            ("terminal swing", (Not(down), ahead, straight)),
        ):
            phases.append(Phase(f"{side[0]} {name}", f"{side} {name}", All(*parts), Dwell(0.02, 0.3)))
    names = [phase.name for phase in phases]
    edges = tuple(
        Edge(one, two, "heel strike" if "swing" in one else None)
        for one, two in zip(names, names[1:] + names[:1], strict=True)
    )
    return Behaviour(
        "gait", "Perry's gait, mirrored.", tuple(signals), tuple(phases), edges, (edges,), outside="falling"
    )


def hop():
    signals = (Signal("height", "m"), Signal("speed", "m/s"), Signal("load", "N"))
    phases = (
        Phase(
            "flight up",
            "rises",
            All(Comparison("load", "<=", 0), Comparison("speed", ">", 0)),
            Dwell(0.05, 0.4),
        ),
        Phase("flight down", "falls", All(Comparison("load", "<=", 0), Comparison("speed", "<=", 0))),
        Phase(
            "landing",
            "the leg gives way and takes up all the energy that there was in the fall",
            Comparison("load", ">", 0),
        ),
    )
    reset = (
        Assignment("speed", Arithmetic(Number(-0.5), "*", Variable("speed"))),
        Assignment("load", Number(0)),
    )
    edges = (
        Edge("flight up", "flight down"),
        Edge("flight down", "landing", "touchdown", reset),
        Edge("landing", "flight up", "lift-off"),
    )
    extra = (
        Edge("flight down", "flight up", "slip"),
        Edge("landing", "landing", "stumble"),
        Edge("landing", "flight up"),
    )
    return Behaviour("hop", "Hopping on the spot.", signals, phases, (*edges, *extra), (edges,))


def nonlinear():
    x, y = Variable("x"), Variable("y")
    radius = Arithmetic(Arithmetic(x, "*", x), "+", Arithmetic(y, "*", y))
    reach = Constant("reach", Number(0.3, "m"))
    far = Call("max", Call("abs", x), Call("abs", y))
    phases = (
        Phase(
            "A",
            "near",
            All(Comparison(radius, "<=", reach), Any(Comparison("x", ">", 0), Near("y", 0.2, 0.01))),
        ),
        Phase(
            "B",
            "",
            Comparison(far, ">", Arithmetic(Number(2), "/", Arithmetic(Number(1), "+", Call("cos", x)))),
        ),
        Phase("C", "between", Between(0.1, "<", "x", "<=", 0.3, 0.02)),
    )
    edges = (Edge("A", "B"), Edge("B", "A"), Edge("B", "C", "kick"), Edge("C", "A"), Edge("C", "A", "leap"))
    return Behaviour("nonlinear", "", (Signal("x", "m"), Signal("y", "m")), phases, edges)


def two_cycles():
    behaviour = graph(7, (0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (4, 5), (5, 6), (6, 0))
    edges = behaviour.edges
    more = (*edges, Edge("P5", "P2", "switch"), Edge("P2", "P5", "back"))
    return dataclasses.replace(behaviour, edges=more, cycles=(edges[:4], edges[4:]))


BEHAVIOURS = {
    "walking": WALKING,
    "gait": gait(),
    "hop": hop(),
    "nonlinear": nonlinear(),
    "two cycles": two_cycles(),
    "one phase": graph(1, (0, 0), event="again"),
    "two phases": graph(2, (0, 1), (1, 0), (0, 0), event="flip"),
    "no edges": graph(4),
    "chords": graph(
        8, *around(8), (0, 3), (3, 0), (1, 5), (5, 1), (2, 6), (7, 4), (4, 4), (0, 0), event="go"
    ),
    "sixteen": graph(16, *around(16), (3, 11), (12, 5), (2, 4), event="on"),
    "all to all": graph(4, *((a, b) for a in range(4) for b in range(4)), event="x"),
    "long titles": graph(6, *around(6), title="words " * 20, event="an event with a rather long name"),
}


@functools.cache
def drawn(name):
    """The picture of one of them, drawn once for all tests."""
    return automaton_svg(BEHAVIOURS[name])


def elements(svg, tag, kind=None):
    found = ET.fromstring(svg).iter(SVG + tag)
    return [element for element in found if kind is None or element.get("class") == kind]


def boxes(svg, kind):
    """The drawn rectangles of a kind."""
    found = []
    for element in elements(svg, "rect", kind):
        x, y, width, height = (float(element.get(key)) for key in ("x", "y", "width", "height"))
        found.append(Box(x + width / 2, y + height / 2, width, height))
    return found


def text_boxes(svg, sizes):
    """Where each text is when DejaVu Sans sets it: about the widest of the fonts that readers have."""
    found = []
    for element in elements(svg, "text"):
        kind = element.get("class").split()[0]
        bold = "-Bold" if kind in ("name", "event", "heading") else ""
        font = get_font(str(_FONTS / f"DejaVuSans{bold}.ttf"))
        font.set_size(100, 72)
        font.set_text("".join(element.itertext()))
        width = font.get_width_height()[0] / 64 / 100 * sizes[kind]
        x, y = float(element.get("x")), float(element.get("y"))
        start = {"end": x - width, "middle": x - width / 2}.get(element.get("text-anchor"), x)
        found.append(Box(start + width / 2, y - 0.3 * sizes[kind], width, 0.7 * sizes[kind]))
    return found


def curve_points(element, num_points=60):
    """Points along a drawn path of one M and one C or A command."""
    path = element.get("d")
    numbers = list(map(float, re.findall(r"-?[\d.]+", path)))
    if "C" in path:
        corners = [(numbers[i], numbers[i + 1]) for i in (0, 2, 4, 6)]
        for step in range(num_points + 1):
            t = step / num_points
            weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3)
            yield tuple(sum(w * c[axis] for w, c in zip(weights, corners, strict=True)) for axis in (0, 1))
    else:
        yield from ((numbers[0], numbers[1]), (numbers[-2], numbers[-1]))
