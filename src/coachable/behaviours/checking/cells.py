"""The cells that the comparisons of a behaviour cut the signal space into."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.solver import cells, cut_of, is_affine
from coachable.behaviours.expressions import Constant, Number, Variable, evaluate
from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate
from coachable.behaviours.rewriting import conjuncts, expanded
from coachable.behaviours.tree import walk

_MOST_CELLS = 1024

Cell = tuple[bool, ...]
"""For each cut, on which side of it."""


@dataclass(frozen=True)
class Cells:
    """The cells that the comparisons of all phases cut the signal space into, and those in no phase."""

    number: int
    outside: tuple[tuple[Predicate, ...], ...]
    orthants: bool

    @property
    def word(self) -> str:
        """The name of the cells."""
        return "orthants" if self.orthants else "cells"


def cells_of(behaviour: Behaviour) -> Cells | None:
    """The cells that the behaviour's own comparisons cut out.

    `None` if they are too many to count, or if a comparison is not of sums of multiples of signals, with abs,
    min and max: what the solver finds then need not be all.
    """
    rules = [expanded(phase.predicate) for phase in behaviour.phases]
    comparisons = [comparison for rule in rules for comparison in walk(rule, Comparison)]
    sides = [side for comparison in comparisons for side in (comparison.left, comparison.right)]
    if not all(is_affine(side, with_corners=True) for side in sides):
        return None
    cuts: dict[object, Comparison] = {}
    located: dict[Comparison, tuple[object, bool]] = {}
    for comparison in dict.fromkeys(comparisons):
        cut, upper = located[comparison] = cut_of(comparison, behaviour.signal_names)
        plain = Comparison(comparison.left, comparison.relation, comparison.right)
        cuts.setdefault(cut, plain if upper else _opposite(plain))
    found = cells(behaviour.signal_names, tuple(cuts.values()), _MOST_CELLS)
    if found is None:
        return None
    place = {cut: number for number, cut in enumerate(cuts)}
    sided = {comparison: (place[cut], upper) for comparison, (cut, upper) in located.items()}
    tests = [_test(rule, sided) for rule in rules]
    outside = tuple(
        tuple(cut if upper else _opposite(cut) for cut, upper in zip(cuts.values(), cell, strict=True))
        for cell in found
        if not any(test(cell) for test in tests)
    )
    return Cells(len(found), outside, _are_signs(tuple(cuts.values())))


def _opposite(comparison: Comparison) -> Comparison:
    (opposite,) = (part for part in conjuncts(Not(comparison)) if isinstance(part, Comparison))
    return opposite


def _are_signs(cuts: Sequence[Comparison]) -> bool:
    """Whether every cut is between the signs of another signal, so that the cells are orthants."""
    signals = {cut.left for cut in cuts if isinstance(cut.left, Variable)}
    return len(signals) == len(cuts) > 0 and all(
        isinstance(cut.right, Number | Constant) and evaluate(cut.right, {}) == 0 for cut in cuts
    )


def _test(predicate: Predicate, sided: Mapping[Comparison, tuple[int, bool]]) -> Callable[[Cell], bool]:
    """Whether a predicate holds in a cell, with the cuts of its comparisons looked up once for all cells."""
    match predicate:
        case Comparison():
            place, upper = sided[predicate]
            return lambda cell: cell[place] == upper
        case Not(part):
            test = _test(part, sided)
            return lambda cell: not test(cell)
        case All(parts=parts) | Any(parts=parts):
            tests = [_test(part, sided) for part in parts]
            holds = all if isinstance(predicate, All) else any
            return lambda cell: holds(test(cell) for test in tests)
        case other:
            raise TypeError(f"{other!r} is not expanded")
