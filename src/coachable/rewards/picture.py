"""The picture of what r_or pays, after figure 5 of the paper: who goes where, and the whole table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Literal

from jaxtyping import Int8
from numpy import ndarray

from coachable.behaviours.behaviour import Behaviour
from coachable.diagram.captions import balanced
from coachable.diagram.draw import document, rectangle
from coachable.diagram.layout import Box, Ring, drawing_order, surrounding
from coachable.diagram.lettering import Line, lettering, safe, size_of, text_width
from coachable.diagram.routing import Arrow, routes, straight
from coachable.foundation.style import PAID, PUNISHED
from coachable.rewards.forms import Schedule, Variant, reward_table
from coachable.rewards.forms.form import OUTSIDE

Drawn = Variant | Literal["schedule"]

_SAYS: Mapping[Drawn, str] = MappingProxyType(
    {
        "stay": "Solid, +1: staying in a phase, following an edge, entering. Dashed, −1: all else.",
        "equation": "Solid, +1: following an edge, entering. Dashed, −1: all else, staying as well.",
        "released": "Solid, +1: staying, even outside; going on in the order. Dashed, −1: all else.",
        "schedule": "Solid, +1: being where it is expected, and going on along an edge. Dashed, −1: all "
        "else. When the time of a phase is over, the next one is expected.",
    }
)
_STYLE = f"""
.automaton .paid {{ fill: none; stroke: {PAID}; stroke-width: 1.9; }}
.automaton .paid-head {{ fill: {PAID}; }}
.automaton .punished {{ fill: none; stroke: {PUNISHED}; stroke-width: 1.5; stroke-dasharray: 5 4; }}
.automaton .punished-head {{ fill: {PUNISHED}; }}
.automaton .nowhere {{ fill: #ffffff; stroke: #8a94a0; stroke-width: 1.2; stroke-dasharray: 3 3; }}
.automaton .cell-paid {{ fill: #d3eee4; }}
.automaton .cell-punished {{ fill: #fbe6e0; }}
.automaton .pay {{ font-size: 12.5px; text-anchor: middle; }}
.automaton .pay-paid {{ fill: {PAID}; font-weight: bold; }}
.automaton .pay-punished {{ fill: {PUNISHED}; }}
.automaton .axis {{ font-size: 12.5px; }}
"""
_KINDS = {1: "paid", -1: "punished"}
_RADII, _PADDING, _MARGIN = (176.0, 138.0), 12.0, 24.0
_CELL = (40.0, 27.0)
_TITLE, _FEW, _WIDEST_PAGE = 18, 6, 960.0
_APART = 34.0


def reward_svg(behaviour: Behaviour, variant: Drawn = "stay") -> str:
    """What r_or pays for each step from one location to another, as a self-contained SVG document.

    With `"schedule"`, what it pays for being at a location while another is expected, or none yet. What
    entering pays then depends on that, and is no arrow; the fine for a phase passed over is not shown.

    On the left the phases on their ring with outside in the middle: a solid green arrow is a step that pays
    +1, a dashed red one a step that pays −1. Shown are staying, the edges, their reverses where the phases
    are few, and entering and leaving. The table beside it holds every step.

    **Raises:** `ParameterError` for an unknown variant, and what `Schedule.bind` raises.
    """
    schedule = variant == "schedule"
    table = Schedule().bind(behaviour, 1.0).table if schedule else reward_table(behaviour, variant)
    parts, boxes = _ring(behaviour, table, entering=not schedule)
    around = surrounding(boxes, 0.0)
    axes, last = ("expected ↓ in →", "none yet") if schedule else ("from ↓ to →", OUTSIDE)
    grid, page = _grid(behaviour, table, around, axes, last)
    header = [
        Line.plain("heading", f"What r_or pays: {behaviour.name}, variant {variant}"),
        *(Line.plain("description", line) for line in balanced(_SAYS[variant], 100)),
    ]
    head = Box(0.0, 0.0, *size_of(header))
    inner = surrounding([around, page], 0.0)
    left, top = inner.x - inner.width / 2, inner.y - inner.height / 2 - 20 - head.height
    text = lettering(header, left, top, {})
    heading = Box(left + head.width / 2, top + head.height / 2, head.width, head.height)
    title = f"What r_or pays for {behaviour.name}, variant {variant}"
    return document(title, surrounding([inner, heading], _MARGIN), [text, *parts, *grid], _STYLE)


def _ring(
    behaviour: Behaviour, table: Int8[ndarray, "previous current"], entering: bool
) -> tuple[list[str], list[Box]]:
    """The phases, the arrows between them, and outside: as SVG, and the room that they take."""
    order = drawing_order(behaviour)
    place = {behaviour.phase_names.index(name): position for position, name in enumerate(order)}
    titles = {phase.name: phase.title for phase in behaviour.phases}
    texts = [
        [
            *(Line.plain("name", line) for line in balanced(name, _TITLE)),
            *(Line.plain("title", line) for line in balanced(titles[name], _TITLE)),
        ]
        for name in order
    ]
    sizes = [size_of(lines) for lines in texts]
    width, height = (max(size[axis] for size in sizes) + 2 * _PADDING for axis in (0, 1))
    nowhere = [Line.plain("title", line) for line in balanced(behaviour.outside or "outside", _TITLE)]
    hole = Box(0.0, 0.0, size_of(nowhere)[0] + 2 * _PADDING, size_of(nowhere)[1] + 2 * _PADDING)
    room = hole.width + 130 if len(order) > 2 else 0.0
    ring = Ring.of(len(order), width, height, inside=room, radii=_RADII)
    if len(order) <= 2:
        ring = _apart(ring, hole)
    outside = len(order)
    drawn = []
    for index in range(outside):
        box = ring.boxes[place[index]]
        if entering:
            drawn.append((straight(hole, box, 7.0), int(table[outside, index])))
        drawn.append((straight(box, hole, 7.0), int(table[index, outside])))
    steps = list(_steps(behaviour))
    spokes = [arrow for arrow, _ in drawn]
    arrows = routes(ring, [(place[p], place[c]) for p, c in steps], around=[hole], beside=spokes)
    drawn += [(arrow, int(table[p, c])) for arrow, (p, c) in zip(arrows.values(), steps, strict=True)]
    parts = [_painted(*one) for one in drawn] + _node("nowhere", hole, nowhere)
    for box, lines in zip(ring.boxes, texts, strict=True):
        parts += _node("node", box, lines)
    points = [Box(x, y, 3.0, 3.0) for arrow, _ in drawn for x, y in arrow.points]
    return parts, [*ring.boxes, hole, *points]


def _apart(ring: Ring, hole: Box) -> Ring:
    """One or two boxes, moved so far out that outside has room between them."""
    boxes = tuple(
        Box(box.x, (-1 if box.y < 0 else 1) * (box.height / 2 + hole.height / 2 + 60), box.width, box.height)
        for box in ring.boxes
    )
    return Ring(boxes, ring.angles, (hole.width / 2 + 90, abs(boxes[0].y)))


def _steps(behaviour: Behaviour) -> Iterator[tuple[int, int]]:
    """The steps between phases that are shown as arrows."""
    names = behaviour.phase_names
    edges = dict.fromkeys((names.index(edge.source), names.index(edge.target)) for edge in behaviour.edges)
    reverses = [(target, source) for source, target in edges] if len(names) <= _FEW else []
    yield from dict.fromkeys((*edges, *reverses, *((index, index) for index in range(len(names)))))


def _node(kind: str, box: Box, lines: Sequence[Line]) -> list[str]:
    """A box with its text in the middle."""
    width, height = size_of(lines)
    return [rectangle(kind, box, 10.0), lettering(lines, box.x - width / 2, box.y - height / 2, {})]


def _painted(arrow: Arrow, pays: int) -> str:
    kind = _KINDS[pays]
    return f'<path class="{kind}" d="{arrow.curve}"/><path class="{kind}-head" d="{arrow.head}"/>'


def _grid(
    behaviour: Behaviour, table: Int8[ndarray, "previous current"], beside: Box, axes: str, last: str
) -> tuple[list[str], Box]:
    """The table as SVG, at the right of a box if the page stays narrow enough, else below it."""
    names, rows = [*behaviour.phase_names, OUTSIDE], [*behaviour.phase_names, last]
    longest = 12.5 * max(map(text_width, (*rows, axes[:-2])))
    widest = 12.5 * max(map(text_width, names))
    cell = max(_CELL[0], widest + 8) if len(names) <= _FEW else _CELL[0]
    slanted = widest > cell - 6
    head = 0.72 * widest + 18 if slanted else 20.0
    width = longest + 10 + len(names) * cell + (0.72 * widest if slanted else 0.0)
    height = head + len(names) * _CELL[1]
    if beside.width + _APART + width + 2 * _MARGIN <= _WIDEST_PAGE:
        left, top = beside.x + beside.width / 2 + _APART, beside.y - height / 2
    else:
        left, top = beside.x - width / 2, beside.y + beside.height / 2 + _APART
    x0, y0 = left + longest + 10, top + head
    parts = [_axis(x0 - 8, y0 - 6, axes, "end", "note")]
    for index, name in enumerate(names):
        x, y = x0 + (index + 0.5) * cell, y0 + (index + 0.5) * _CELL[1] + 4.5
        parts.append(_axis(x0 - 8, y, rows[index], "end"))
        turn = f' transform="rotate(-45 {x - 3:.1f} {y0 - 6:.1f})"' if slanted else ""
        parts.append(
            _axis(x - 3 if slanted else x, y0 - 6, name, "start" if slanted else "middle", turn=turn)
        )
    for (row, column), pays in _entries(table):
        x, y = x0 + (column + 0.5) * cell, y0 + (row + 0.5) * _CELL[1]
        kind = _KINDS[pays]
        parts.append(rectangle(f"cell-{kind}", Box(x, y, cell - 3, _CELL[1] - 3), 4.0))
        sign = "+1" if pays > 0 else "−1"
        parts.append(f'<text class="pay pay-{kind}" x="{x:.1f}" y="{y + 4.5:.1f}">{sign}</text>')
    return parts, Box(left + width / 2, top + height / 2, width, height)


def _entries(table: Int8[ndarray, "previous current"]) -> Iterator[tuple[tuple[int, int], int]]:
    for row, line in enumerate(table.tolist()):
        for column, pays in enumerate(line):
            yield (row, column), pays


def _axis(x: float, y: float, text: str, anchor: str, kind: str = "axis", turn: str = "") -> str:
    return f'<text class="{kind}" text-anchor="{anchor}" x="{x:.1f}" y="{y:.1f}"{turn}>{safe(text)}</text>'
