"""Where the boxes of a drawn automaton go: clockwise around an ellipse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour

Point = tuple[float, float]

_RADII = (248.0, 176.0)
_GAP = (52.0, 46.0)
_STEPS = 400


@dataclass(frozen=True)
class Box:
    """An upright rectangle around a centre; y grows downward, as everywhere in SVG."""

    x: float
    y: float
    width: float
    height: float

    def overlaps(self, other: Box, gap: Point = (0.0, 0.0)) -> bool:
        """Whether two boxes are less than a gap (across, along) apart."""
        across = abs(self.x - other.x) - (self.width + other.width) / 2
        along = abs(self.y - other.y) - (self.height + other.height) / 2
        return across < gap[0] and along < gap[1]


def drawing_order(behaviour: Behaviour) -> tuple[str, ...]:
    """The phases in the order in which they stand around the ring.

    The longest cycle that the behaviour declares comes first, then the others, each phase where its edges are
    shortest. Without a cycle, the first edge of each phase is followed; if that does not lead through them
    all, they stand as they are given.
    """
    if behaviour.cycles:
        cycles = sorted(behaviour.cycles, key=len, reverse=True)
        main = list(dict.fromkeys(edge.source for edge in cycles[0]))
        others = (edge.source for cycle in cycles[1:] for edge in cycle)
        order = list(dict.fromkeys((*main, *others, *behaviour.phase_names)))
        return tuple(_shortened(order, order[len(main) :], behaviour))
    follows = {edge.source: edge.target for edge in reversed(behaviour.edges)}
    order = [behaviour.phase_names[0]]
    while (following := follows.get(order[-1])) is not None and following not in order:
        order.append(following)
    return tuple(order) if len(order) == len(behaviour.phases) else behaviour.phase_names


def _shortened(order: list[str], movable: Sequence[str], behaviour: Behaviour) -> list[str]:
    """The order after moving phases, each to where the edges are shortest, until nothing is gained."""
    while True:
        moves = [
            [*rest[:at], name, *rest[at:]]
            for name in movable
            for rest in ([other for other in order if other != name],)
            for at in range(1, len(order))
        ]
        best = min(moves, key=lambda moved: _length(moved, behaviour), default=order)
        if _length(best, behaviour) >= _length(order, behaviour):
            return order
        order = best


def _length(order: Sequence[str], behaviour: Behaviour) -> int:
    """How many places all edges together go around the ring, the shorter way."""
    total = 0
    for edge in behaviour.edges:
        apart = abs(order.index(edge.source) - order.index(edge.target))
        total += min(apart, len(order) - apart)
    return total


@dataclass(frozen=True)
class Ring:
    """Boxes of one size clockwise around an ellipse with its centre at (0, 0), the first one on top."""

    boxes: tuple[Box, ...]
    angles: tuple[float, ...]
    radii: Point

    @staticmethod
    def of(
        num_boxes: int,
        width: float,
        height: float,
        spread: float = 1.0,
        inside: float = 0.0,
        radii: Point = _RADII,
    ) -> Ring:
        """The smallest ring on which boxes of this size leave gaps of one kind between neighbours.

        **Arguments:** `spread`: how much larger than usual the gaps are; `inside`: how wide it is free
        inside at least [px]; `radii`: the smallest ring for three boxes or more.
        """
        gap = (_GAP[0] * spread, _GAP[1] * spread)
        cell = (width + gap[0], height + gap[1])
        across = max(radii[0] if num_boxes > 2 else 150.0, (width + max(inside, gap[0])) / 2) * spread**0.5
        along = (radii[1] if num_boxes > 2 else cell[1] / 2) * spread**0.5
        while (angles := _even(num_boxes, (across, along), cell)) is None:
            across, along = 1.004 * across, 1.03 * along
        places = ((across * math.cos(angle), along * math.sin(angle)) for angle in angles)
        return Ring(tuple(Box(x, y, width, height) for x, y in places), angles, (across, along))

    def point(self, angle: float) -> Point:
        """The point of the ellipse at a parameter."""
        return self.radii[0] * math.cos(angle), self.radii[1] * math.sin(angle)


def _even(count: int, radii: Point, cell: Point) -> tuple[float, ...] | None:
    """The parameters of places around the ellipse, from the top, or none if they do not fit.

    Neighbours are a cell apart at least, across or along, and about equally far. Left and right are alike.
    """
    side = (count - 1) // 2
    angles = [math.pi * (step / _STEPS - 0.5) for step in range(_STEPS + 1)]
    ellipse = [(radii[0] * math.cos(angle), radii[1] * math.sin(angle)) for angle in angles]

    def apart(one: Point, other: Point) -> float:
        return max(abs(one[0] - other[0]) / cell[0], abs(one[1] - other[1]) / cell[1])

    def walk(distance: float) -> list[int] | None:
        """The places down the right side, each as soon as it is far enough from the one above."""
        steps = [0]
        while len(steps) <= side:
            above = ellipse[steps[-1]]
            far = (
                at
                for at in range(steps[-1], _STEPS)
                if apart(above, ellipse[at]) >= distance and 2 * ellipse[at][0] >= cell[0]
            )
            if (step := next(far, None)) is None:
                return None
            steps.append(step)
        x, y = ellipse[steps[-1]]
        below = ellipse[-1] if count % 2 == 0 else (-x, y)
        return steps if count == 1 or apart((x, y), below) >= distance else None

    if (best := walk(1.0)) is None:
        return None
    low, high = 1.0, 4.0
    for _ in range(12):
        middle = (low + high) / 2
        steps = walk(middle)
        low, high, best = (low, middle, best) if steps is None else (middle, high, steps)
    right = [angles[step] for step in best]
    if count % 2 == 0:
        # What is left over at the bottom is shared with the top.
        right = [(down - up) / 2 for down, up in zip(right[1:], reversed(right[1:]), strict=True)]
        right = [-math.pi / 2, *right, math.pi / 2]
    return (*right, *(math.pi - angle for angle in reversed(right[1 : side + 1])))


def surrounding(boxes: Sequence[Box], margin: float) -> Box:
    """The smallest box that leaves a margin around the others."""
    left = min(box.x - box.width / 2 for box in boxes) - margin
    right = max(box.x + box.width / 2 for box in boxes) + margin
    top = min(box.y - box.height / 2 for box in boxes) - margin
    bottom = max(box.y + box.height / 2 for box in boxes) + margin
    return Box((left + right) / 2, (top + bottom) / 2, right - left, bottom - top)


def unit(vector: Point) -> Point:
    """The vector at length one; nothing for nothing."""
    length = math.hypot(*vector) or 1.0
    return vector[0] / length, vector[1] / length
