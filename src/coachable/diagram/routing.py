"""The arrows between the boxes of a drawn automaton, and the places of their labels: clear of all else."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from coachable.diagram.layout import Box, Point, Ring, unit

_CLEARANCE = 3.0
_HEAD = 10.0
_SAMPLES = 360
_KEPT = 48
_TIMES = [step / _SAMPLES for step in range(_SAMPLES + 1)]
_PASSING = 7.0
"""How far an arrow keeps from the boxes that it passes, and from the ends of other arrows [px]."""


@dataclass(frozen=True)
class Arrow:
    """A curve and its head as SVG path data, with points along the curve; `away` is off it, outwards."""

    curve: str
    head: str
    points: tuple[Point, ...]
    away: Point

    @property
    def middle(self) -> Point:
        """The point half-way along."""
        return self.points[len(self.points) // 2]


@dataclass(frozen=True)
class _Curve:
    """A cubic Bézier curve."""

    corners: tuple[Point, Point, Point, Point]

    def points(self) -> list[Point]:
        """Points along the curve, evenly in its parameter."""
        (x0, y0), (x1, y1), (x2, y2), (x3, y3) = self.corners
        weights = (((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3) for t in _TIMES)
        return [
            (a * x0 + b * x1 + c * x2 + d * x3, a * y0 + b * y1 + c * y2 + d * y3) for a, b, c, d in weights
        ]

    def blossom(self, r: float, s: float, t: float) -> Point:
        """The polar form, which gives the corners of any piece of the curve."""
        weights = (
            (1 - r) * (1 - s) * (1 - t),
            r * (1 - s) * (1 - t) + s * (1 - r) * (1 - t) + t * (1 - r) * (1 - s),
            r * s * (1 - t) + r * t * (1 - s) + s * t * (1 - r),
            r * s * t,
        )
        x, y = (
            sum(w * corner[axis] for w, corner in zip(weights, self.corners, strict=True)) for axis in (0, 1)
        )
        return x, y

    def path(self, start: float, end: float) -> str:
        """SVG path data of the piece between two parameters."""
        pieces = [
            self.blossom(*times)
            for times in ((start, start, start), (start, start, end), (start, end, end), (end, end, end))
        ]
        begin, *rest = (f"{x:.1f} {y:.1f}" for x, y in pieces)
        return f"M{begin}C{' '.join(rest)}"


def arrow_head(tip: Point, behind: Point, size: float = _HEAD) -> str:
    """A filled head with its tip at a point, which it reaches coming from another."""
    (x, y), (along, across) = tip, unit((tip[0] - behind[0], tip[1] - behind[1]))

    def at(back: float, aside: float) -> str:
        return f"{x - back * along - aside * across:.1f} {y - back * across + aside * along:.1f}"

    return f"M{at(0.0, 0.0)}L{at(size, 0.42 * size)}L{at(0.75 * size, 0.0)}L{at(size, -0.42 * size)}Z"


def routes(
    ring: Ring,
    pairs: Sequence[tuple[int, int]],
    around: Sequence[Box] = (),
    beside: Sequence[Arrow] = (),
) -> dict[tuple[int, int], Arrow]:
    """An arrow for each (source, target): along the ring to the next box, else where it hits the least.

    **Arguments:** `around`, `beside`: further boxes and arrows to be clear of.
    """
    count = len(ring.boxes)
    arrows: dict[tuple[int, int], Arrow] = {}
    along = [pair for pair in pairs if pair[0] != pair[1] and pair[1] == (pair[0] + 1) % count]
    loops = [pair for pair in pairs if pair[0] == pair[1]]
    across = [pair for pair in pairs if pair not in along and pair not in loops]
    for source, target in along:
        arrows[source, target] = _arc(ring, source, target)
    for source, target in sorted(across, key=lambda pair: _apart(ring, pair)):
        ends = (ring.boxes[source], ring.boxes[target])
        ways = [_arrow(curve, *ends) for curve in _chords(*ends)]
        passed = [*around, *(box for box in ring.boxes if box not in ends)]
        arrows[source, target] = _best(ways, ends, passed, (*beside, *arrows.values()))
    for source, _ in loops:
        own = ring.boxes[source]
        passed = [*around, *(box for box in ring.boxes if box != own)]
        arrows[source, source] = _best(list(_loops(own)), (own,), passed, (*beside, *arrows.values()))
    return {pair: arrows[pair] for pair in pairs}


def straight(source: Box, target: Box, aside: float) -> Arrow:
    """A straight arrow, to the left of the line between two boxes by some distance [px]."""
    across, along = unit((target.y - source.y, source.x - target.x))
    (x0, y0), (x3, y3) = ((box.x + aside * across, box.y + aside * along) for box in (source, target))
    one, two = ((2 * x0 + x3) / 3, (2 * y0 + y3) / 3), ((x0 + 2 * x3) / 3, (y0 + 2 * y3) / 3)
    return _arrow(_Curve(((x0, y0), one, two, (x3, y3))), source, target)


def label_boxes(
    arrows: Sequence[Arrow], sizes: Sequence[Point], boxes: Sequence[Box]
) -> tuple[list[Box], list[int]]:
    """A box beside each arrow for its label, and the arrows beside which there was no room for it.

    A size of zero needs no room.
    """
    placed: list[Box] = []
    crowded = []
    lines = [point for arrow in arrows for point in arrow.points]
    for index, (arrow, size) in enumerate(zip(arrows, sizes, strict=True)):
        if size == (0.0, 0.0):
            placed.append(Box(*arrow.middle, 0.0, 0.0))
            continue
        taken = [*boxes, *(box for box in placed if box.width)]
        places = list(_beside(arrow, size))
        free = (
            box
            for box in places
            if not any(
                abs(x - box.x) < box.width / 2 + 2 and abs(y - box.y) < box.height / 2 + 2 for x, y in lines
            )
            and not any(box.overlaps(other, (4.0, 4.0)) for other in taken)
        )
        if (box := next(free, None)) is None:
            crowded.append(index)
            box = min(places, key=lambda box: sum(box.overlaps(other, (4.0, 4.0)) for other in taken))
        placed.append(box)
    return placed, crowded


def crossed_boxes(arrow: Arrow, boxes: Sequence[Box], margin: float = 0.0) -> int:
    """How many boxes an arrow goes through; its own it only touches."""
    inner = arrow.points[2:-2]
    return sum(
        any(
            abs(x - box.x) < box.width / 2 + margin and abs(y - box.y) < box.height / 2 + margin
            for x, y in inner
        )
        for box in boxes
    )


def _apart(ring: Ring, pair: tuple[int, int]) -> float:
    one, other = (ring.boxes[index] for index in pair)
    return math.hypot(one.x - other.x, one.y - other.y)


def _arc(ring: Ring, source: int, target: int) -> Arrow:
    """The arrow along the ellipse, clockwise; almost straight between boxes that stand side by side."""
    one, other = ring.boxes[source], ring.boxes[target]
    if len(ring.boxes) > 2 and abs(one.y - other.y) < one.height / 4:
        bulge = math.copysign(0.08 * abs(one.x - other.x), one.y + other.y)
        third, rest = (2 * one.x + other.x) / 3, (one.x + 2 * other.x) / 3
        return _arrow(
            _Curve(((one.x, one.y), (third, one.y + bulge), (rest, other.y + bulge), (other.x, other.y))),
            one,
            other,
        )
    begin, end = ring.angles[source], ring.angles[target]
    span, (across, along) = (end - begin) % (2 * math.pi), ring.radii
    angles = [begin + t * span for t in _TIMES]
    points = [(across * math.cos(angle), along * math.sin(angle)) for angle in angles]
    start, stop, tip = _cut(points, one, other)
    (x0, y0), (x1, y1), middle = points[start], points[stop], points[(start + tip) // 2]
    return Arrow(
        curve=f"M{x0:.1f} {y0:.1f}A{across:.1f} {along:.1f} 0 0 1 {x1:.1f} {y1:.1f}",
        head=arrow_head(points[tip], points[stop]),
        points=_thinned(points[start : tip + 1]),
        away=unit((middle[0] / across**2, middle[1] / along**2)),
    )


def _arrow(curve: _Curve, source: Box, target: Box) -> Arrow:
    points = curve.points()
    start, stop, tip = _cut(points, source, target)
    (x0, y0), (x1, y1), middle = points[start], points[tip], points[(start + tip) // 2]
    off = (middle[0] - (x0 + x1) / 2, middle[1] - (y0 + y1) / 2)
    almost_straight = math.hypot(*off) < 2
    return Arrow(
        curve=curve.path(_TIMES[start], _TIMES[stop]),
        head=arrow_head(points[tip], points[stop]),
        points=_thinned(points[start : tip + 1]),
        away=unit((y1 - y0, x0 - x1) if almost_straight else off),
    )


def _chords(source: Box, target: Box) -> Iterator[_Curve]:
    """Ways from box to box: bent to either side, and out and in again at the side of both.

    The first is bent to the left of its direction, so that an arrow and its reverse do not lie on each other.
    """
    (x0, y0), (x3, y3) = (source.x, source.y), (target.x, target.y)
    length = math.hypot(x3 - x0, y3 - y0)
    left = unit((y3 - y0, x0 - x3))
    for bend in (0.2, 0.1, 0.3, 0.45, -0.1, -0.2, -0.3, -0.45, 0.6, -0.6):
        aside = (bend * length * left[0], bend * length * left[1])
        third, rest = ((x3 - x0) / 3, (y3 - y0) / 3), (2 * (x3 - x0) / 3, 2 * (y3 - y0) / 3)
        yield _Curve(
            (
                (x0, y0),
                (x0 + third[0] + aside[0], y0 + third[1] + aside[1]),
                (x0 + rest[0] + aside[0], y0 + rest[1] + aside[1]),
                (x3, y3),
            )
        )
    for across, along in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        for far in (0.8, 1.0, 1.2, 1.5):
            reach = (far * across * source.width, far * along * (source.height + 60))
            yield _Curve(((x0, y0), (x0 + reach[0], y0 + reach[1]), (x3 + reach[0], y3 + reach[1]), (x3, y3)))


def _loops(box: Box) -> Iterator[Arrow]:
    """Ways from a box to itself, the ones on its outer sides first."""
    up, out = (-1 if box.y <= 0 else 1), (-1 if box.x < 0 else 1)
    for vertical, across in ((up, out), (-up, -out)):
        for part in (-0.25, 0.25, 0.0, -0.36, 0.36):
            foot = (box.x + part * box.width, box.y + vertical * box.height / 2)
            yield _loop(foot, (0.0, float(vertical)))
        for part in (0.0, -0.25, 0.25):
            foot = (box.x + across * box.width / 2, box.y + part * box.height)
            yield _loop(foot, (float(across), 0.0))


def _loop(foot: Point, away: Point) -> Arrow:
    along = (-away[1], away[0]) if away[0] else (1.0, 0.0)

    def at(aside: float, off: float) -> Point:
        return foot[0] + aside * along[0] + off * away[0], foot[1] + aside * along[1] + off * away[1]

    curve = _Curve((at(-14.0, 0.0), at(-30.0, 44.0), at(30.0, 44.0), at(14.0, _CLEARANCE)))
    points, stop = curve.points(), round(0.91 * _SAMPLES)
    return Arrow(
        curve=curve.path(0.0, _TIMES[stop]),
        head=arrow_head(points[-1], points[stop]),
        points=_thinned(points),
        away=away,
    )


def _best(ways: Sequence[Arrow], own: Sequence[Box], passed: Sequence[Box], drawn: Sequence[Arrow]) -> Arrow:
    """The way that hits the least, the first of equals."""

    def cost(arrow: Arrow) -> float:
        hits = 1000.0 * crossed_boxes(arrow, passed, _PASSING) + 1000.0 * crossed_boxes(arrow, own)
        near = sum(
            math.dist(mine, theirs) < 2 * _PASSING
            for other in drawn
            for mine in (arrow.points[0], arrow.points[-1])
            for theirs in (other.points[0], other.points[-1])
        )
        shared = sum(
            any(math.dist(point, place) < _PASSING for place in other.points[::3])
            for other in drawn
            for point in arrow.points[2:-2:3]
        )
        steps = zip(arrow.points, arrow.points[1:], strict=False)
        return hits + 300.0 * near + 80.0 * shared + 0.1 * sum(math.dist(one, two) for one, two in steps)

    return min(ways, key=cost)


def _beside(arrow: Arrow, size: Point) -> Iterator[Box]:
    """Places for a label: beside the arrow's middle first, then along it and farther off."""
    width, height = size
    last = len(arrow.points) - 1
    for step in range(0, 40, 5):
        for part in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8):
            index = round(part * last)
            before, here, after = (arrow.points[max(0, min(last, index + by))] for by in (-2, 0, 2))
            normal = unit((after[1] - before[1], before[0] - after[0]))
            outwards = normal[0] * arrow.away[0] + normal[1] * arrow.away[1] >= 0
            for sign in (1, -1) if outwards else (-1, 1):
                across, along = sign * normal[0], sign * normal[1]
                off = 7 + step + abs(across) * width / 2 + abs(along) * height / 2
                yield Box(here[0] + off * across, here[1] + off * along, width, height)
                # In the corner that a slanting arrow leaves free a label can come nearer.
                x = here[0] + (math.copysign(width / 2 + 6 + step, across) if abs(across) > 0.3 else 0)
                y = here[1] + (math.copysign(height / 2 + 6 + step, along) if abs(along) > 0.3 else 0)
                yield Box(x, y, width, height)


def _cut(points: Sequence[Point], source: Box, target: Box) -> tuple[int, int, int]:
    """The points at which a curve leaves its source, its line ends, and its head arrives."""
    last = len(points) - 1
    wide, high = source.width / 2, source.height / 2
    leaves = next(
        (i for i, (x, y) in enumerate(points) if abs(x - source.x) > wide or abs(y - source.y) > high), last
    )
    wide, high = target.width / 2 + _CLEARANCE, target.height / 2 + _CLEARANCE
    arrives = next(
        (
            i
            for i, (x, y) in enumerate(points)
            if i >= leaves and abs(x - target.x) <= wide and abs(y - target.y) <= high
        ),
        last,
    )
    ends = next(
        (i for i in range(arrives, leaves, -1) if math.dist(points[i], points[arrives]) >= 0.7 * _HEAD),
        leaves,
    )
    return max(leaves - 1, 0), ends, arrives


def _thinned(points: Sequence[Point]) -> tuple[Point, ...]:
    """So many of the points as are needed to see what a curve hits, the first and the last among them."""
    last = len(points) - 1
    return tuple(points[round(last * step / _KEPT)] for step in range(_KEPT + 1))
