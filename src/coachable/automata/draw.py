"""The picture of a behaviour's automaton as SVG, after figure 4 of the paper. Needs nothing but Python."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from coachable.automata.layout import Arrow, Box, Ring, drawing_order, surrounding
from coachable.automata.lettering import SIZES, Line, lettering, safe, size_of
from coachable.automata.notation import pretty_name, pretty_predicate
from coachable.automata.pictogram import COLOURS, STANCE, SWING, is_walker, pictogram
from coachable.automata.pictogram import WIDTH as PICTURE
from coachable.behaviours.behaviour import Behaviour, Edge, Phase
from coachable.behaviours.predicates import Comparison, Predicate, conjuncts

RESETS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "touchdown": MappingProxyType(
            {"theta_1": "theta_2", "theta_2": "theta_1", "dtheta_1": "dtheta_1⁺", "dtheta_2": "dtheta_2⁺"}
        )
    }
)
"""What each event does to the signals: μ₃ of the compass walker; ⁺ marks what the impact's equation gives."""

_INK, _GREY = "#1f2933", "#5f6b7a"
_FONTS = "'Helvetica Neue', Helvetica, Arial, 'DejaVu Sans', sans-serif"
_STYLE = f"""
.automaton text {{ font-family: {_FONTS}; fill: {_INK}; }}
{" ".join(f".automaton .{kind} {{ font-size: {size:g}px; }}" for kind, size in SIZES.items())}
.automaton .name, .automaton .event {{ font-weight: bold; }}
.automaton .title, .automaton .note {{ fill: {_GREY}; }}
.automaton .card {{ fill: #ffffff; stroke: #e3e7ec; }}
.automaton .node {{ fill: #f8fafc; stroke: #b8c2cc; stroke-width: 1.2; }}
.automaton .clearing {{ fill: #ffffff; }}
.automaton .edge {{ fill: none; stroke: {_GREY}; stroke-width: 1.8; }}
.automaton .edge-head {{ fill: {_GREY}; }}
.automaton .ground {{ stroke: #c3ccd5; stroke-width: 1.2; }}
.automaton .leg {{ fill: none; stroke-width: 3.4; stroke-linecap: round; }}
.automaton .motion {{ fill: none; stroke-width: 1.6; }}
.automaton .stance {{ stroke: {STANCE}; }}
.automaton .swing {{ stroke: {SWING}; }}
.automaton .stance-head {{ fill: {STANCE}; }}
.automaton .swing-head {{ fill: {SWING}; }}
.automaton .mass {{ fill: #ffffff; stroke-width: 1.6; }}
.automaton .hip {{ fill: {_INK}; }}
"""
_PADDING, _MARGIN = 14.0, 24.0
_TITLE_LETTERS, _FORMULA_LETTERS = 20, 30


def automaton_svg(behaviour: Behaviour, resets: Mapping[str, Mapping[str, str]] = RESETS) -> str:
    """The automaton of a behaviour as a self-contained SVG document.

    The phases stand clockwise around an ellipse, in the order of their cycle if they form one, each with its
    invariant. Edges that carry an event name it and say what it does to the signals. If the behaviour is one
    of the compass walker, each phase shows it. The card is white, to be read on any background.

    **Arguments:** `resets`: for each event, what each signal is set to.
    """
    phases = {phase.name: phase for phase in behaviour.phases}
    order = drawing_order(behaviour)
    colours = {pretty_name(name): colour for name, colour in COLOURS.items()} if is_walker(behaviour) else {}
    texts = {name: _node_lines(phase) for name, phase in phases.items()}
    ring = Ring.of(len(order), *_node_size([size_of(lines) for lines in texts.values()], bool(colours)))
    nodes = [
        _node(phases[name], box, texts[name], colours) for name, box in zip(order, ring.boxes, strict=True)
    ]
    arrows, labels, boxes = [], [], list(ring.boxes)
    for (source, target), edges in _by_ends(behaviour.edges).items():
        arrow = ring.arrow(order.index(source), order.index(target))
        arrows.append(f'<path class="edge" d="{arrow.curve}"/><path class="edge-head" d="{arrow.head}"/>')
        if lines := [line for edge in edges for line in _event_lines(edge, behaviour, resets)]:
            boxes.append(box := _label_box(arrow, size_of(lines), boxes))
            labels.append(_label(box, lines, colours))
        boxes.append(Box(*arrow.label_at, 2.0, 2.0))
    title = f"{behaviour.name}: {behaviour.description}"
    return _document(title, surrounding(boxes, _MARGIN), [*arrows, *labels, *nodes])


def _document(title: str, page: Box, parts: Sequence[str]) -> str:
    left, top = page.x - page.width / 2, page.y - page.height / 2
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" class="automaton" role="img" width="{page.width:.0f}" '
            f'height="{page.height:.0f}" viewBox="{left:.1f} {top:.1f} {page.width:.1f} {page.height:.1f}">',
            f"<title>{safe(title)}</title>",
            f"<style>{_STYLE}</style>",
            _rectangle("card", Box(page.x, page.y, page.width - 2, page.height - 2), 14.0),
            *parts,
            "</svg>\n",
        ]
    )


def _node_lines(phase: Phase) -> list[Line]:
    title = [Line.plain("title", line) for line in _balanced(phase.title, _TITLE_LETTERS)]
    return [Line.plain("name", phase.name), *title, *_formula(phase.predicate)]


def _balanced(text: str, num_letters: int) -> list[str]:
    """The text in as few lines as fit, and no line longer than it must be."""
    count = len(textwrap.wrap(text, num_letters))
    widths = (width for width in range(1, num_letters) if len(textwrap.wrap(text, width)) == count)
    return textwrap.wrap(text, next(widths, num_letters))


def _formula(predicate: Predicate) -> list[Line]:
    """An invariant: comparisons in two columns where they are short, else in one line that is broken."""
    parts = conjuncts(predicate)
    if all(isinstance(part, Comparison) for part in parts):
        cells = [pretty_predicate(part) for part in parts]
        if len(cells) > 1 and max(map(len, cells)) <= _FORMULA_LETTERS // 2:
            column = 0.56 * max(map(len, cells)) + 0.4
            return [
                Line(
                    "formula",
                    tuple((column * place, cell) for place, cell in enumerate(cells[index : index + 2])),
                )
                for index in range(0, len(cells), 2)
            ]
    # Broken before a connective, never within a comparison.
    text = pretty_predicate(predicate).replace(" ", "\u00a0")
    text = text.replace("\u00a0∧", " ∧").replace("\u00a0∨", " ∨")
    return [Line.plain("formula", line) for line in textwrap.wrap(text, _FORMULA_LETTERS)]


def _event_lines(edge: Edge, behaviour: Behaviour, resets: Mapping[str, Mapping[str, str]]) -> list[Line]:
    """The event of an edge, and what it does to the signals, two assignments a line."""
    if edge.event is None:
        return []
    changes = [
        (pretty_name(name), pretty_name(value.removesuffix("⁺")) + "⁺" * value.endswith("⁺"))
        for name, value in resets.get(edge.event, {}).items()
        if name in behaviour.signal_names
    ]
    lines = [Line.plain("event", edge.event)]
    for index in range(0, len(changes), 2):
        cells = []
        for place, (name, value) in enumerate(changes[index : index + 2]):
            start = 5.9 * place
            cells += [(start, name), (start + 1.4, ":="), (start + 2.8, value)]
        lines.append(Line("reset", tuple(cells)))
    if any(value.endswith("⁺") for _, value in changes):
        lines.append(Line.plain("note", "⁺ right after the impact"))
    return lines


def _node_size(texts: Sequence[tuple[float, float]], pictured: bool) -> tuple[float, float]:
    """The size that every node has, so that the one with the most text fits."""
    width = max(width for width, _ in texts) + 2 * _PADDING + (PICTURE + _PADDING if pictured else 0)
    return max(width, 110.0), max(max(height for _, height in texts) + 1.6 * _PADDING, 70.0)


def _node(phase: Phase, box: Box, lines: Sequence[Line], colours: Mapping[str, str]) -> str:
    left = box.x - box.width / 2 + _PADDING
    picture = pictogram(phase, left + PICTURE / 2, box.y) if colours else ""
    text = lettering(
        lines, left + (PICTURE + _PADDING if colours else 0), box.y - size_of(lines)[1] / 2, colours
    )
    return f"<g>{_rectangle('node', box, 12.0)}{picture}{text}</g>"


def _label_box(arrow: Arrow, size: tuple[float, float], taken: Sequence[Box]) -> Box:
    """Beside the arrow, on the side that it leaves free, and as far off as other boxes push it."""
    (x, y), (across, along) = arrow.label_at, arrow.away
    width, height = size
    if abs(across) > 0.3:
        x += math.copysign(width / 2 + 8, across)
    if abs(along) > 0.3:
        y += math.copysign(height / 2 + 8, along)
    places = [Box(x + step * across, y + step * along, width, height) for step in range(0, 200, 8)]
    return next((box for box in places if not any(map(box.overlaps, taken))), places[0])


def _label(box: Box, lines: Sequence[Line], colours: Mapping[str, str]) -> str:
    text = lettering(lines, box.x - box.width / 2, box.y - box.height / 2, colours)
    return _rectangle("clearing", box, 4.0) + text


def _rectangle(kind: str, box: Box, radius: float) -> str:
    return (
        f'<rect class="{kind}" x="{box.x - box.width / 2:.1f}" y="{box.y - box.height / 2:.1f}" '
        f'width="{box.width:.1f}" height="{box.height:.1f}" rx="{radius:g}"/>'
    )


def _by_ends(edges: Sequence[Edge]) -> dict[tuple[str, str], list[Edge]]:
    grouped: dict[tuple[str, str], list[Edge]] = {}
    for edge in edges:
        grouped.setdefault((edge.source, edge.target), []).append(edge)
    return grouped
