"""The memories of comparisons with a deadband: once one holds, it holds until it fails by more than that."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Any

import numpy as np
from jaxtyping import Float

from coachable.automata.classifier import array_library, holds_at
from coachable.behaviours.expressions import Variable
from coachable.behaviours.predicates import Comparison, Predicate
from coachable.behaviours.rewriting import expanded, normal_form, widened, without_negations
from coachable.behaviours.tree import rewritten, walk

Held = tuple[Any, ...]
"""For each comparison with a deadband, whether it holds at a sample: booleans, in any batch shape."""


@dataclass(frozen=True)
class Latches:
    """Comparisons with a deadband, each with a memory of its own, whatever phase a trajectory is in.

    `x > 0 deadband 0.1` begins to hold where x > 0 and holds until x > −0.1 fails. Where the behaviour has
    its opposite, too, `x <= 0 deadband 0.1`, written so or as a `not`, only one of the two holds: it changes
    at 0.1 on the way up and at −0.1 on the way down, as a Schmitt trigger does. At the first sample, and
    after one with a NaN in it, the plain comparison decides.
    """

    comparisons: tuple[Comparison, ...]
    opposites: tuple[int | None, ...]
    """For each comparison, which one is its opposite."""
    predicates: tuple[Predicate, ...]
    """The phases' predicates, a variable for each comparison with a deadband."""
    phases: tuple[frozenset[int], ...]
    """The comparisons that each phase reads."""

    @staticmethod
    def of(predicates: Sequence[Predicate]) -> Latches:
        """The latches of phases."""
        plain = [
            without_negations(expanded(predicate)) if has_deadband(predicate) else predicate
            for predicate in predicates
        ]
        found: dict[Comparison, int] = {}
        for predicate in plain:
            for comparison in _with_deadband(predicate):
                found.setdefault(comparison, len(found))
        cuts = {_cut(comparison): number for comparison, number in found.items()}
        latched = {one: Comparison(Variable(latch(number)), ">", 0.5) for one, number in found.items()}
        return Latches(
            tuple(found),
            tuple(cuts.get(_cut(comparison, opposite=True)) for comparison in found),
            tuple(rewritten(predicate, latched.get) for predicate in plain),
            tuple(frozenset(found[comparison] for comparison in _with_deadband(part)) for part in plain),
        )

    def __bool__(self) -> bool:
        return bool(self.comparisons)

    @property
    def keeps(self) -> tuple[bool, ...]:
        """For each phase, whether it has a deadband, so that a trajectory in it stays as long as it holds."""
        return tuple(map(bool, self.phases))

    def none(self, location: Any) -> Held:
        """That none holds, for as many trajectories as there are locations."""
        return tuple(location != location for _ in self.comparisons)

    def of_phase(self, location: Any) -> Held:
        """That those of a phase hold, for trajectories of which only their location is known."""
        no = location != location
        return tuple(
            reduce(or_, (location == i for i, read in enumerate(self.phases) if number in read), no)
            for number in range(len(self.comparisons))
        )

    def after(self, held: Held, values: Mapping[str, Float[Any, "*batch"]]) -> Held:
        """Which comparisons hold at a sample, after those that held at the one before."""
        begin = [holds_at(comparison, values) for comparison in self.comparisons]
        last = [holds_at(widened(comparison), values) for comparison in self.comparisons]
        return self.following(held, begin, last)

    def following(self, held: Held, begin: Sequence[Any], last: Sequence[Any]) -> Held:
        """The same, given where each comparison holds, and where it fails by no more than its deadband."""
        kept = [was & can_last for was, can_last in zip(held, last, strict=True)]
        return tuple(
            kept[number] | (begin[number] if other is None else begin[number] & (kept[other] ^ True))
            for number, other in enumerate(self.opposites)
        )

    def along(self, held: Held, values: Mapping[str, Float[np.ndarray, " samples"]]) -> Held:
        """The same at many consecutive samples: a column for each comparison."""
        wide = map(widened, self.comparisons)
        count = len(next(iter(values.values())))
        truths = np.array(
            [np.broadcast_to(holds_at(one, values), count) for one in (*self.comparisons, *wide)]
        )
        # Nothing changes as long as the same comparisons hold and can last.
        changes = np.flatnonzero((truths[:, 1:] != truths[:, :-1]).any(axis=0)) + 1
        starts, number = np.concatenate([[0], changes]) if count else changes, len(self.comparisons)
        states = []
        for truth in truths[:, starts].T.tolist():
            held = self.following(held, truth[:number], truth[number:])
            states.append(held)
        table = np.array(states, bool).reshape(-1, number)
        return tuple(np.repeat(table, np.diff(np.append(starts, count)), axis=0).T)

    def holding(self, values: Mapping[str, Float[Any, "*batch"]], held: Held) -> list[Any]:
        """For each phase, whether it holds where these comparisons do."""
        first = next(iter(values.values()))
        xp = array_library(first)
        yes, no = xp.ones_like(first), xp.zeros_like(first)
        numbers = {latch(number): xp.where(one, yes, no) for number, one in enumerate(held)}
        return [holds_at(predicate, {**values, **numbers}) for predicate in self.predicates]


def latch(number: int) -> str:
    """The variable that is 1 where a comparison with a deadband holds, and else 0; no signal is called so."""
    return f"latch {number}"


def has_deadband(predicate: Predicate) -> bool:
    """Whether any comparison in it has a deadband."""
    return any(_with_deadband(expanded(predicate)))


def _with_deadband(predicate: Predicate) -> Iterator[Comparison]:
    """The comparisons with a deadband in a predicate whose ranges are spelt out."""
    for comparison in walk(predicate, Comparison):
        if comparison.deadband is not None and comparison.deadband.value > 0:
            yield comparison


def _cut(comparison: Comparison, opposite: bool = False) -> tuple[str, str, bool, float]:
    """What two comparisons have in common whose sides, direction and deadband are the same."""
    plain = normal_form(comparison)
    assert isinstance(plain, Comparison), "the normal form of a comparison is one"
    left, right, above = str(plain.left), str(plain.right), plain.relation in (">", ">=")
    if left > right:
        left, right, above = right, left, not above
    assert plain.deadband is not None, "it has a deadband"
    return left, right, above != opposite, plain.deadband.value
