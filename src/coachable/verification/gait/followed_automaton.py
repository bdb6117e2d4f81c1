"""The automaton that a plant really follows, drawn beside the one that was described."""

from collections.abc import Iterator, Sequence

from coachable.behaviours.behaviour import Behaviour
from coachable.diagram.captions import balanced
from coachable.diagram.draw import document, rectangle
from coachable.diagram.layout import Box, Ring, drawing_order, surrounding
from coachable.diagram.lettering import Line, lettering, size_of
from coachable.diagram.routing import Arrow, label_boxes, routes, straight
from coachable.foundation.style import FAINT, PAID, PUNISHED
from coachable.verification.gait.adherence import Adherence, Transition

_STYLE = f"""
.automaton .kept {{ fill: none; stroke: {PAID}; stroke-width: 2; }}
.automaton .kept-head {{ fill: {PAID}; }}
.automaton .strayed {{ fill: none; stroke: {PUNISHED}; stroke-width: 1.6; stroke-dasharray: 6 4; }}
.automaton .strayed-head {{ fill: {PUNISHED}; }}
.automaton .missed {{ fill: none; stroke: {FAINT}; stroke-width: 1.2; }}
.automaton .missed-head {{ fill: {FAINT}; }}
.automaton .nowhere {{ fill: #ffffff; stroke: #8a94a0; stroke-width: 1.2; stroke-dasharray: 3 3; }}
"""
_RADII, _PADDING, _MARGIN, _APART, _TITLE = (190.0, 150.0), 12.0, 24.0, 70.0, 18
_LEGEND = (
    "Green: an edge of the description. Dashed, red: not one. Grey: an edge that was never taken. "
    "Numbers: how often."
)


def followed_svg(behaviour: Behaviour, seen: Adherence) -> str:
    """Two rings as one self-contained SVG document: the description, and what the walk did with counts."""
    described = [
        Transition(transition.source, transition.target, 0, True)
        for transition in seen.transitions
        if transition.described
    ]
    left, left_boxes = _ring(behaviour, described, "described", counted=False)
    title = f"followed in {seen.seconds:.0f} s" + ("" if seen.up else ", until it fell")
    right, right_boxes = _ring(behaviour, seen.transitions, title, counted=True)
    one, other = surrounding(left_boxes, 0.0), surrounding(right_boxes, 0.0)
    shift = one.x + one.width / 2 + _APART + other.width / 2 - other.x
    moved = Box(other.x + shift, other.y, other.width, other.height)
    both = surrounding([one, moved], 0.0)
    notes = [Line.plain("note", line) for line in balanced(_LEGEND, 110)]
    left_edge, bottom = both.x - both.width / 2, both.y + both.height / 2 + 18
    width, height = size_of(notes)
    legend = Box(left_edge + width / 2, bottom + height / 2, width, height)
    return document(
        f"{behaviour.name}: described and followed",
        surrounding([both, legend], _MARGIN),
        [
            *left,
            f'<g transform="translate({shift:.1f} 0)">',
            *right,
            "</g>",
            lettering(notes, left_edge, bottom, {}),
        ],
        _STYLE,
    )


def _ring(
    behaviour: Behaviour, transitions: Sequence[Transition], title: str, *, counted: bool
) -> tuple[list[str], list[Box]]:
    """Phases around outside with the transitions between them: as SVG, and the room that they take."""
    order = drawing_order(behaviour)
    texts = [
        [Line.plain("name", line) for line in balanced(name, _TITLE)]
        + [
            Line.plain("title", line)
            for phase in behaviour.phases
            if phase.name == name
            for line in balanced(phase.title, _TITLE)
        ]
        for name in order
    ]
    width, height = (max(size_of(lines)[axis] for lines in texts) + 2 * _PADDING for axis in (0, 1))
    strays = any(None in (one.source, one.target) for one in transitions)
    nowhere = [Line.plain("title", line) for line in balanced(behaviour.outside or "outside", _TITLE)]
    hole = Box(0.0, 0.0, size_of(nowhere)[0] + 2 * _PADDING, size_of(nowhere)[1] + 2 * _PADDING)
    ring = Ring.of(len(order), width, height, inside=hole.width + 150.0, radii=_RADII)
    spokes = [
        (straight(hole, ring.boxes[order.index(one.target)], 8.0), one)
        if one.source is None
        else (straight(ring.boxes[order.index(one.source)], hole, 8.0), one)
        for one in transitions
        if one.source is None or one.target is None
    ]
    inner = [one for one in transitions if one.source is not None and one.target is not None]
    pairs = [(order.index(one.source or ""), order.index(one.target or "")) for one in inner]
    around = [hole] if strays else []
    ways = routes(ring, pairs, around=around, beside=[arrow for arrow, _ in spokes])
    drawn = [*spokes, *((ways[pair], one) for pair, one in zip(pairs, inner, strict=True))]
    labels = [[Line.plain("event", f"{one.count:,}")] if counted and one.count else [] for _, one in drawn]
    places, _ = label_boxes(
        [arrow for arrow, _ in drawn], [size_of(lines) for lines in labels], [*ring.boxes, *around]
    )
    top = min(box.y - box.height / 2 for box in ring.boxes)
    heading = [Line.plain("heading", title)]
    above = Box(0.0, top - 30.0 - size_of(heading)[1] / 2, *size_of(heading))
    parts = [_painted(arrow, one, counted) for arrow, one in drawn]
    parts += [_written(box, lines) for box, lines in zip(places, labels, strict=True) if lines]
    parts += list(_node("nowhere", hole, nowhere)) if strays else []
    for box, lines in zip(ring.boxes, texts, strict=True):
        parts += _node("node", box, lines)
    parts.append(_written(above, heading))
    points = [Box(x, y, 3.0, 3.0) for arrow, _ in drawn for x, y in arrow.points]
    return parts, [*ring.boxes, above, *points, *(box for box in places if box.width)]


def _painted(arrow: Arrow, one: Transition, counted: bool) -> str:
    kind = "strayed" if not one.described else "missed" if counted and not one.count else "kept"
    return f'<path class="{kind}" d="{arrow.curve}"/><path class="{kind}-head" d="{arrow.head}"/>'


def _node(kind: str, box: Box, lines: Sequence[Line]) -> Iterator[str]:
    width, height = size_of(lines)
    yield rectangle(kind, box, 10.0)
    yield lettering(lines, box.x - width / 2, box.y - height / 2, {})


def _written(box: Box, lines: Sequence[Line]) -> str:
    return rectangle("clearing", box, 4.0) + lettering(
        lines, box.x - box.width / 2, box.y - box.height / 2, {}
    )
