"""The location of one trajectory, sample by sample in plain floats: `Tracker` without the cost of arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coachable.automata.latches import Held, latch
from coachable.automata.tracker import Tracker
from coachable.behaviours.expressions import Constant, Floats, Number, Variable
from coachable.behaviours.predicates import (
    OPERATORS,
    All,
    Comparison,
    Decision,
    Not,
    Predicate,
    decision,
    flattened,
)
from coachable.behaviours.rewriting import expanded, widened

Holds = Callable[[Any, float], bool]
"""From a signal's value and a bound, or from all values in order, to whether a predicate holds."""

Candidates = tuple[tuple[tuple[Predicate, ...], int], ...]
"""Locations in their order, each after the conditions for it that are still undecided."""


class DecisionDiagram:
    """The location of one trajectory whose signals come as plain floats.

    Each node tests a predicate, and the result selects the next node, until one location is left. No
    predicate is tested twice, however many phases it is a part of. Nodes are built when they are first
    reached, so there are no more of them than a trajectory needs. The locations are those of
    `Tracker.locate` to the last bit. A comparison with a deadband comes as one more value, whether it holds.
    """

    def __init__(self, tracker: Tracker):
        signals, latches = tracker.classifier.signals, tracker.latches
        numbers = (latch(number) for number in range(len(latches.comparisons)))
        self._places = {name: place for place, name in enumerate((*signals, *numbers))}
        self._outside = tracker.classifier.outside
        self._nodes: dict[Candidates, _Node] = {}
        self._latches = latches
        self._begin = [self._decision(one) for one in latches.comparisons]
        self._last = [self._decision(widened(one)) for one in latches.comparisons]
        phases = tuple(
            (tuple(flattened(All, expanded(predicate))), index)
            for index, predicate in enumerate(latches.predicates)
        )
        self._roots = [
            self._node((phases[index], *phases) if keeps else phases)
            # There is no staying outside, or before the first sample.
            for index, keeps in enumerate((*latches.keeps, False, False))
        ]

    def locate(self, values: Sequence[float], previous: int, held: Held | None = None) -> int:
        """The location at a sample, after the location `previous`, or *none yet*, at the one before.

        **Arguments:** `values`: the behaviour's signals in its order; `held`: which comparisons with a
        deadband held there, by default those of `previous`.
        """
        if not self._begin:
            return self._located(values, previous)
        return self.step(values, previous, self._latches.of_phase(previous) if held is None else held)[0]

    def step(self, values: Sequence[float], previous: int, held: Held) -> tuple[int, Held]:
        """The same, and which comparisons with a deadband hold at the sample."""
        if not self._begin:
            return self._located(values, previous), held
        begin, last = ([decide(values) for decide in decisions] for decisions in (self._begin, self._last))
        held = self._latches.following(held, begin, last)
        return self._located((*values, *held), previous), held

    def _located(self, values: Sequence[float], previous: int) -> int:
        # A sum with a NaN in it is NaN. Infinities can make it that, too.
        total = sum(values)
        if total != total and any(map(math.isnan, values)):
            return self._outside
        node = self._roots[previous]
        while (holds := node.holds) is not None:
            signal = node.signal
            result = holds(values if signal is None else values[signal], node.bound)
            node = node.after[result] or self._follow(node, result)
        return node.location

    def _follow(self, node: _Node, result: bool) -> _Node:
        """The next node, built at its first use."""
        tested, left = _tested(node.candidates), []
        fulfilled, refuted = (tested, Not(tested)) if result else (Not(tested), tested)
        for conditions, location in node.candidates:
            if refuted not in conditions:
                left.append((tuple(one for one in conditions if one != fulfilled), location))
        following = node.after[result] = self._node(tuple(left))
        return following

    def _node(self, candidates: Candidates) -> _Node:
        """The node that tests the first candidate, or the leaf that it is the one."""
        if candidates not in self._nodes:
            conditions, location = candidates[0] if candidates else ((), self._outside)
            tested = self._test(_tested(candidates)) if conditions else (None, None, 0.0)
            self._nodes[candidates] = _Node(candidates, location, *tested)
        return self._nodes[candidates]

    def _decision(self, predicate: Predicate) -> Decision:
        return decision(predicate, _AsInColumns, self._places)

    def _test(self, predicate: Predicate) -> tuple[Holds, int | None, float]:
        """The test of a predicate; see `_Node`."""
        match predicate:
            case Comparison(Variable(signal), relation, Number(bound)) | Comparison(
                Variable(signal), relation, Constant(number=Number(bound))
            ):
                return OPERATORS[relation], self._places[signal], bound
        decide = self._decision(predicate)
        return lambda values, _: decide(values), None, 0.0


@dataclass(slots=True, eq=False)
class _Node:
    candidates: Candidates
    location: int
    """The result at a leaf."""
    holds: Holds | None
    """The test, `None` at a leaf: mostly a relation of a `signal` to a `bound`, otherwise of all signals."""
    signal: int | None
    bound: float
    after: list[_Node | None] = field(default_factory=lambda: [None, None])
    """The nodes after failing and after holding, as far as they have been reached."""


def _tested(candidates: Candidates) -> Predicate:
    """The first predicate that the first candidate depends on; a `Not` is decided by its part."""
    condition = candidates[0][0][0]
    return condition.part if isinstance(condition, Not) else condition


class _AsInColumns:
    """The functions on plain floats as NumPy has them on columns; its sines may differ from Python's."""

    @staticmethod
    def sin(x: float) -> float:
        return float(np.sin(x)) if math.isfinite(x) else math.nan

    @staticmethod
    def cos(x: float) -> float:
        return float(np.cos(x)) if math.isfinite(x) else math.nan

    abs, minimum, maximum = Floats.abs, Floats.minimum, Floats.maximum
