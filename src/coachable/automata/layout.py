"""Where the boxes and the arrows of a drawn automaton go."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

from coachable.behaviours.behaviour import Behaviour

Point = tuple[float, float]

_GAP = (52.0, 54.0)
_RADII = (248.0, 176.0)
_CLEARANCE = 3.0
_HEAD = 10.0
_SAMPLES = 600


@dataclass(frozen=True)
class Box:
    """An upright rectangle around a centre; y grows downward, as everywhere in SVG."""

    x: float
    y: float
    width: float
    height: float

    def contains(self, point: Point, margin: float = 0.0) -> bool:
        """Whether a point is in the box or at most the margin away from it."""
        across, along = abs(point[0] - self.x), abs(point[1] - self.y)
        return across <= self.width / 2 + margin and along <= self.height / 2 + margin

    def overlaps(self, other: Box, gap: Point = (0.0, 0.0)) -> bool:
        """Whether two boxes are less than a gap (across, along) apart."""
        across = abs(self.x - other.x) - (self.width + other.width) / 2
        along = abs(self.y - other.y) - (self.height + other.height) / 2
        return across < gap[0] and along < gap[1]


@dataclass(frozen=True)
class Arrow:
    """A curve and its head as SVG path data, and where a label goes: a point, and the way off the curve."""

    curve: str
    head: str
    label_at: Point
    away: Point


def drawing_order(behaviour: Behaviour) -> tuple[str, ...]:
    """The phases in the order in which the first edge of each leads through them all, else as given."""
    follows = {edge.source: edge.target for edge in reversed(behaviour.edges)}
    order = [behaviour.phase_names[0]]
    while (following := follows.get(order[-1])) is not None and following not in order:
        order.append(following)
    return tuple(order) if len(order) == len(behaviour.phases) else behaviour.phase_names


def arrow_head(tip: Point, behind: Point, size: float = _HEAD) -> str:
    """A filled head with its tip at a point, which it reaches coming from another."""
    (x, y), (along, across) = tip, _unit((tip[0] - behind[0], tip[1] - behind[1]))

    def at(back: float, aside: float) -> str:
        return f"{x - back * along - aside * across:.1f} {y - back * across + aside * along:.1f}"

    return f"M{at(0.0, 0.0)}L{at(size, 0.42 * size)}L{at(0.75 * size, 0.0)}L{at(size, -0.42 * size)}Z"


@dataclass(frozen=True)
class Ring:
    """Boxes clockwise around an ellipse with its centre at (0, 0), the first one on top."""

    boxes: tuple[Box, ...]
    radii: Point

    @staticmethod
    def of(num_boxes: int, width: float, height: float) -> Ring:
        """The smallest ring on which boxes of this size leave room for the arrows between them."""
        across, along = _RADII
        while True:
            ellipse = Ring((), (across, along))
            points = [ellipse.point(ellipse.angle(index, num_boxes)) for index in range(num_boxes)]
            boxes = tuple(Box(x, y, width, height) for x, y in points)
            if not any(one.overlaps(other, _GAP) for one, other in combinations(boxes, 2)):
                return Ring(boxes, (across, along))
            across, along = 1.02 * across, 1.04 * along

    @staticmethod
    def angle(index: int | float, count: int) -> float:
        """The parameter at which the box of an index lies; between two indices, between two boxes [rad]."""
        return 2 * math.pi * index / count - math.pi / 2

    def point(self, angle: float) -> Point:
        """The point of the ellipse at a parameter."""
        return self.radii[0] * math.cos(angle), self.radii[1] * math.sin(angle)

    def arrow(self, source: int, target: int) -> Arrow:
        """The arrow between two boxes: along the ellipse to the next one, through the inside to others."""
        if source == target:
            return self._loop(self.boxes[source])
        if target == (source + 1) % len(self.boxes):
            return self._arc(source, target)
        return self._chord(source, target)

    def _arc(self, source: int, target: int) -> Arrow:
        def angle(t: float) -> float:
            return self.angle(source + t, len(self.boxes))

        start, end, tip = self._cut(lambda t: self.point(angle(t)), source, target)
        (x0, y0), (x1, y1) = self.point(angle(start)), self.point(angle(end))
        radii = f"{self.radii[0]:.1f} {self.radii[1]:.1f}"
        middle = angle((start + tip) / 2)
        return Arrow(
            curve=f"M{x0:.1f} {y0:.1f}A{radii} 0 0 1 {x1:.1f} {y1:.1f}",
            head=arrow_head(self.point(angle(tip)), (x1, y1)),
            label_at=self.point(middle),
            away=_unit((math.cos(middle) / self.radii[0], math.sin(middle) / self.radii[1])),
        )

    def _chord(self, source: int, target: int) -> Arrow:
        (x0, y0), (x2, y2) = ((self.boxes[index].x, self.boxes[index].y) for index in (source, target))
        # Bent to the left of its direction, so that an arrow and its reverse do not lie on each other.
        away = _unit((y2 - y0, x0 - x2))
        bend = 0.16 * math.hypot(x2 - x0, y2 - y0)
        x1, y1 = 0.4 * (x0 + x2) + bend * away[0], 0.4 * (y0 + y2) + bend * away[1]

        def blossom(s: float, t: float) -> Point:
            a, b, c = (1 - s) * (1 - t), s + t - 2 * s * t, s * t
            return a * x0 + b * x1 + c * x2, a * y0 + b * y1 + c * y2

        start, end, tip = self._cut(lambda t: blossom(t, t), source, target)
        # A quadratic Bézier curve between s and t has the control points b(s, s), b(s, t), b(t, t).
        corners = [blossom(start, start), blossom(start, end), blossom(end, end)]
        begin, control, last = (f"{x:.1f} {y:.1f}" for x, y in corners)
        middle = (start + tip) / 2
        head = arrow_head(blossom(tip, tip), corners[2])
        return Arrow(f"M{begin}Q{control} {last}", head, blossom(middle, middle), away)

    def _loop(self, box: Box) -> Arrow:
        side = 1 if box.y > 0 else -1
        x, start = box.x - 0.25 * box.width, box.y + side * box.height / 2
        far, tip = start + 46 * side, start + _CLEARANCE * side
        behind = (x + 19, tip + 0.7 * _HEAD * side)
        controls = f"{x - 34:.1f} {far:.1f} {x + 34:.1f} {far:.1f}"
        curve = f"M{x - 16:.1f} {start:.1f}C{controls} {behind[0]:.1f} {behind[1]:.1f}"
        return Arrow(curve, arrow_head((x + 16, tip), behind), (x, start + 36 * side), (0.0, float(side)))

    def _cut(self, curve: Callable[[float], Point], source: int, target: int) -> tuple[float, float, float]:
        """When a curve over [0, 1] leaves its source, when its line ends, and when its head arrives."""
        times = [step / _SAMPLES for step in range(_SAMPLES + 1)]
        start = max(t for t in times if self.boxes[source].contains(curve(t)))
        tip = min(t for t in times if self.boxes[target].contains(curve(t), _CLEARANCE))
        end = max(t for t in times if t < tip and math.dist(curve(t), curve(tip)) >= 0.7 * _HEAD)
        return start, end, tip


def surrounding(boxes: Sequence[Box], margin: float) -> Box:
    """The smallest box that leaves a margin around the others."""
    left = min(box.x - box.width / 2 for box in boxes) - margin
    right = max(box.x + box.width / 2 for box in boxes) + margin
    top = min(box.y - box.height / 2 for box in boxes) - margin
    bottom = max(box.y + box.height / 2 for box in boxes) + margin
    return Box((left + right) / 2, (top + bottom) / 2, right - left, bottom - top)


def _unit(vector: Point) -> Point:
    length = math.hypot(*vector) or 1.0
    return vector[0] / length, vector[1] / length
