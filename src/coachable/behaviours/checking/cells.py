"""The cells that the comparisons of a behaviour cut the signal space into."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.solver import cells, cut_of, is_affine
from coachable.behaviours.expressions import Constant, Number, Variable, evaluate
from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate
from coachable.behaviours.rewriting import conjuncts, expanded
from coachable.behaviours.tree import walk

_MOST_CELLS = 1024


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
    for comparison in comparisons:
        cut, upper = cut_of(comparison, behaviour.signal_names)
        plain = Comparison(comparison.left, comparison.relation, comparison.right)
        cuts.setdefault(cut, plain if upper else _opposite(plain))
    found = cells(behaviour.signal_names, tuple(cuts.values()), _MOST_CELLS)
    if found is None:
        return None
    located = [dict(zip(cuts, cell, strict=True)) for cell in found]
    outside = tuple(
        tuple(cuts[cut] if upper else _opposite(cuts[cut]) for cut, upper in cell.items())
        for cell in located
        if not any(_holds(rule, cell, behaviour.signal_names) for rule in rules)
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


def _holds(predicate: Predicate, cell: Mapping[object, bool], signals: Sequence[str]) -> bool:
    match predicate:
        case Comparison():
            cut, upper = cut_of(predicate, signals)
            return cell[cut] == upper
        case Not(part):
            return not _holds(part, cell, signals)
        case All(parts=parts):
            return all(_holds(part, cell, signals) for part in parts)
        case Any(parts=parts):
            return any(_holds(part, cell, signals) for part in parts)
        case other:
            raise TypeError(f"{other!r} is not expanded")
