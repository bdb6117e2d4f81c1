"""Bounds of single signals: what they decide of many phases is not asked of the solver."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction

from coachable.behaviours.behaviour import Phase
from coachable.behaviours.checking.solver import bound_of, nearest_float
from coachable.behaviours.predicates import Predicate, holds
from coachable.behaviours.rewriting import conjuncts, expanded

Place = tuple[Fraction | float, bool]
Box = Mapping[str, tuple[Place, Place]]
"""For each signal that is bounded, where its values begin and where they end."""

_UNBOUNDED: tuple[Place, Place] = ((-math.inf, False), (math.inf, False))


def box_of(predicate: Predicate) -> Box:
    """What the comparisons of a phase that are joined by "and" allow at most."""
    box: dict[str, tuple[Place, Place]] = {}
    for part in conjuncts(expanded(predicate)):
        if (bound := bound_of(part)) is not None:
            begin, end = box.get(bound.signal, _UNBOUNDED)
            up = bound.upwards
            box[bound.signal] = max(begin, bound.place) if up else begin, end if up else min(end, bound.place)
    return box


def is_in_the_middle(predicate: Predicate) -> bool:
    """Whether a predicate is nothing but bounds, and holds in the middle between them."""
    if any(bound_of(part) is None for part in conjuncts(expanded(predicate))):
        return False
    return holds(predicate, {signal: _middle(*ends) for signal, ends in box_of(predicate).items()})


def apart(box: Box, other: Box) -> bool:
    """Whether no state is in both boxes, by one of their signals."""
    return any(
        box[signal][1] <= other[signal][0] or other[signal][1] <= box[signal][0]
        for signal in box.keys() & other.keys()
    )


def pairs_not_apart(phases: Sequence[Phase]) -> list[tuple[Phase, Phase]]:
    """The pairs of phases, in their order, that no bounds keep apart.

    Along the signal that most of them bound, a phase is compared with those only that have not ended where it
    begins.
    """
    boxes = [box_of(phase.predicate) for phase in phases]
    (along, _), *_ = Counter(itertools.chain(*boxes)).most_common(1) or [("", 0)]
    sides = [box.get(along, _UNBOUNDED) for box in boxes]
    found: list[tuple[int, int]] = []
    lasting: list[int] = []
    for index in sorted(range(len(phases)), key=lambda index: sides[index][0]):
        lasting = [other for other in lasting if sides[other][1] > sides[index][0]]
        for other in lasting:
            if not apart(boxes[index], boxes[other]):
                found.append((min(index, other), max(index, other)))
        lasting.append(index)
    return [(phases[one], phases[other]) for one, other in sorted(found)]


def _middle(begin: Place, end: Place) -> float:
    low, high = begin[0], end[0]
    if isinstance(low, Fraction) and isinstance(high, Fraction):
        return nearest_float((low + high) / 2)
    if isinstance(low, Fraction):
        return nearest_float(low + 1)
    return nearest_float(high - 1) if isinstance(high, Fraction) else 0.0
