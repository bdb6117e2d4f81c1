"""The picture of a behaviour's automaton as SVG, after figure 4 of the paper. Needs nothing but Python."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from coachable.behaviours.behaviour import Behaviour, Edge, Phase
from coachable.behaviours.notation import pretty_name
from coachable.diagram.captions import (
    RESETS,
    balanced,
    dwell_text,
    edge_lines,
    node_lines,
    notes,
    uses_phrases,
)
from coachable.diagram.layout import Box, Ring, drawing_order, surrounding
from coachable.diagram.lettering import SIZES, Line, lettering, safe, size_of, text_width
from coachable.diagram.pictogram import COLOURS, is_walker, pictogram
from coachable.diagram.pictogram import WIDTH as PICTURE
from coachable.diagram.routing import Arrow, crossed_boxes, label_boxes, routes
from coachable.foundation.style import STANCE, SWING

INK, GREY = "#1f2933", "#5f6b7a"
_FONTS = "'Helvetica Neue', Helvetica, Arial, 'DejaVu Sans', sans-serif"
_STYLE = f"""
.automaton text {{ font-family: {_FONTS}; fill: {INK}; }}
{" ".join(f".automaton .{kind} {{ font-size: {size:g}px; }}" for kind, size in SIZES.items())}
.automaton .name, .automaton .event, .automaton .heading {{ font-weight: bold; }}
.automaton .title, .automaton .note, .automaton .dwell, .automaton .description {{ fill: {GREY}; }}
.automaton .card {{ fill: #ffffff; stroke: #e3e7ec; }}
.automaton .node {{ fill: #f8fafc; stroke: #b8c2cc; stroke-width: 1.2; }}
.automaton .clearing {{ fill: #ffffff; }}
.automaton .edge {{ fill: none; stroke: {GREY}; stroke-width: 1.8; }}
.automaton .edge-head {{ fill: {GREY}; }}
.automaton .ground {{ stroke: #c3ccd5; stroke-width: 1.2; }}
.automaton .leg {{ fill: none; stroke-width: 3.4; stroke-linecap: round; }}
.automaton .motion {{ fill: none; stroke-width: 1.6; }}
.automaton .stance {{ stroke: {STANCE}; }}
.automaton .swing {{ stroke: {SWING}; }}
.automaton .stance-head {{ fill: {STANCE}; }}
.automaton .swing-head {{ fill: {SWING}; }}
.automaton .mass {{ fill: #ffffff; stroke-width: 1.6; }}
.automaton .hip {{ fill: {INK}; }}
"""
_PADDING, _MARGIN = 14.0, 24.0
_CHANNEL = 84.0
"""How wide it is free inside the ring where arrows go through it [px]."""

_ATTEMPTS = 9
_HEADING, _DESCRIPTIONS, _LONG_DESCRIPTION = 28, (34, 27, 21), 60


MOST_PHASES = 150
"""What is drawn at most: the time grows faster than the square of it, and nobody reads the picture."""


def _too_many(behaviour: Behaviour) -> str:
    words = safe(
        f"{behaviour.name}: {len(behaviour.phases)} phases, more than the {MOST_PHASES} that are drawn"
    )
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" class="automaton" viewBox="0 0 800 60">'
        f'<text x="24" y="36" font-family="sans-serif" font-size="14">{words}</text></svg>\n'
    )


def automaton_svg(behaviour: Behaviour, resets: Mapping[str, Mapping[str, str]] = RESETS) -> str:
    """The automaton of a behaviour as a self-contained SVG document.

    The phases stand clockwise around an ellipse, in the order of their cycle if they form one, each with its
    invariant: as a formula, or as phrases of the vocabulary where the formulas would not fit. Edges that
    carry an event show it with its reset. If the behaviour is one of the compass walker,
    each phase shows it. The card is white, to be read on any background.

    A behaviour of more than `MOST_PHASES` is not drawn: the document says so.

    **Arguments:** `resets`: for each event, the value of each signal after it, for edges that have no
    reset of their own.
    """
    if len(behaviour.phases) > MOST_PHASES:
        return _too_many(behaviour)
    phases = {phase.name: phase for phase in behaviour.phases}
    order = drawing_order(behaviour)
    colours = {pretty_name(name): colour for name, colour in COLOURS.items()} if is_walker(behaviour) else {}
    as_phrases = uses_phrases(behaviour)
    texts = {name: node_lines(phase, as_phrases) for name, phase in phases.items()}
    pairs = [(order.index(source), order.index(target)) for source, target in by_ends(behaviour.edges)]
    labels = [edge_lines(edges, behaviour, resets) for edges in by_ends(behaviour.edges).values()]
    width, height = _node_size([(phases[name], texts[name]) for name in order], bool(colours))
    ring, arrows, places = _laid_out(len(order), (width, height), pairs, [size_of(lines) for lines in labels])
    nodes = [
        _node(phases[name], box, texts[name], colours) for name, box in zip(order, ring.boxes, strict=True)
    ]
    written = [(box, lines) for box, lines in zip(places, labels, strict=True) if lines]
    boxes = [*ring.boxes, *places, *(Box(x, y, 2.0, 2.0) for arrow in arrows for x, y in arrow.points)]
    written += [*_heading(behaviour, boxes), *_below(notes(behaviour), boxes)]
    page = surrounding([*boxes, *(box for box, _ in written)], _MARGIN)
    return document(
        f"{behaviour.name}: {behaviour.description}",
        page,
        [*map(_drawn, arrows), *(_label(box, lines, colours) for box, lines in written), *nodes],
    )


def by_ends(edges: Sequence[Edge]) -> dict[tuple[str, str], list[Edge]]:
    """The edges that lead from each phase to each other: they share an arrow."""
    grouped: dict[tuple[str, str], list[Edge]] = {}
    for edge in edges:
        grouped.setdefault((edge.source, edge.target), []).append(edge)
    return grouped


def document(title: str, page: Box, parts: Sequence[str], style: str = "") -> str:
    """An SVG document with a white card as large as the page, and the parts on it."""
    left, top = page.x - page.width / 2, page.y - page.height / 2
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" class="automaton" role="img" width="{page.width:.0f}" '
            f'height="{page.height:.0f}" viewBox="{left:.1f} {top:.1f} {page.width:.1f} {page.height:.1f}">',
            f"<title>{safe(title)}</title>",
            f"<style>{_STYLE}{style}</style>",
            rectangle("card", Box(page.x, page.y, page.width - 2, page.height - 2), 14.0),
            *parts,
            "</svg>\n",
        ]
    )


def rectangle(kind: str, box: Box, radius: float) -> str:
    """SVG of a box with round corners."""
    return (
        f'<rect class="{kind}" x="{box.x - box.width / 2:.1f}" y="{box.y - box.height / 2:.1f}" '
        f'width="{box.width:.1f}" height="{box.height:.1f}" rx="{radius:g}"/>'
    )


def _laid_out(
    count: int,
    size: tuple[float, float],
    pairs: Sequence[tuple[int, int]],
    labels: Sequence[tuple[float, float]],
) -> tuple[Ring, list[Arrow], list[Box]]:
    """A ring that is as small as it can be with arrows and labels clear of one another and of the boxes."""
    through = any(target not in (source, (source + 1) % count) for source, target in pairs)
    spread, inside = 1.0, _CHANNEL if through else 0.0
    for _ in range(_ATTEMPTS):
        ring = Ring.of(count, *size, spread, inside)
        arrows = list(routes(ring, pairs).values())
        places, crowded = label_boxes(arrows, labels, ring.boxes)
        hits = [arrow for arrow in arrows if crossed_boxes(arrow, ring.boxes)]
        if not crowded and not hits:
            break
        spread, inside = 1.2 * spread, 1.25 * inside
    return ring, arrows, places


def _node_size(nodes: Sequence[tuple[Phase, Sequence[Line]]], pictured: bool) -> tuple[float, float]:
    """The size that every node has, so that the one with the most text fits."""
    widths = [max(size_of(lines)[0], _first_line_width(phase, lines)) for phase, lines in nodes]
    width = max(widths) + 2 * _PADDING + (PICTURE + _PADDING if pictured else 0)
    return max(width, 110.0), max(max(size_of(lines)[1] for _, lines in nodes) + 1.6 * _PADDING, 70.0)


def _first_line_width(phase: Phase, lines: Sequence[Line]) -> float:
    dwell = dwell_text(phase.dwell)
    return lines[0].width + (text_width(dwell) * SIZES["dwell"] + 16.0 if dwell else 0.0)


def _node(phase: Phase, box: Box, lines: Sequence[Line], colours: Mapping[str, str]) -> str:
    left, top = box.x - box.width / 2 + _PADDING, box.y - size_of(lines)[1] / 2
    picture = pictogram(phase, left + PICTURE / 2, box.y) if colours else ""
    text = lettering(lines, left + (PICTURE + _PADDING if colours else 0), top, colours)
    if dwell := dwell_text(phase.dwell):
        x, y = box.x + box.width / 2 - _PADDING, top + lines[0].height - 0.36 * SIZES["name"]
        text += f'<text class="dwell" text-anchor="end" x="{x:.1f}" y="{y:.1f}">{safe(dwell)}</text>'
    return f"<g>{rectangle('node', box, 12.0)}{picture}{text}</g>"


def _heading(behaviour: Behaviour, boxes: Sequence[Box]) -> Iterator[tuple[Box, list[Line]]]:
    """The name and the description: in the middle of the ring if it is free there, else above."""
    name = [Line.plain("heading", line) for line in balanced(behaviour.name, _HEADING)]

    def described(num_letters: int) -> list[Line]:
        return [
            *name,
            *(Line.plain("description", line) for line in balanced(behaviour.description, num_letters)),
        ]

    for lines in map(described, _DESCRIPTIONS):
        box = Box(0.0, 0.0, *size_of(lines))
        if lines and not any(box.overlaps(other, (12.0, 12.0)) for other in boxes):
            yield box, lines
            return
    if lines := described(_LONG_DESCRIPTION):
        around, (width, height) = surrounding(boxes, 0.0), size_of(lines)
        left, top = around.x - around.width / 2, around.y - around.height / 2
        corner = Box(left + width / 2, top + height / 2, width, height)
        free = not any(corner.overlaps(other, (14.0, 14.0)) for other in boxes)
        yield corner if free else Box(corner.x, corner.y - height - 16, width, height), lines


def _below(lines: list[Line], boxes: Sequence[Box]) -> Iterator[tuple[Box, list[Line]]]:
    """The notes, at the left below everything."""
    if lines:
        around, (width, height) = surrounding(boxes, 0.0), size_of(lines)
        left, bottom = around.x - around.width / 2, around.y + around.height / 2
        yield Box(left + width / 2, bottom + 18 + height / 2, width, height), lines


def _drawn(arrow: Arrow) -> str:
    return f'<path class="edge" d="{arrow.curve}"/><path class="edge-head" d="{arrow.head}"/>'


def _label(box: Box, lines: Sequence[Line], colours: Mapping[str, str]) -> str:
    text = lettering(lines, box.x - box.width / 2, box.y - box.height / 2, colours)
    return rectangle("clearing", box, 4.0) + text
