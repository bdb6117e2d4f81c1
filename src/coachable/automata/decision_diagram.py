"""Where one run is, sample by sample in plain floats: what `Tracker` gives, without the cost of arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coachable.automata.tracker import Tracker
from coachable.behaviours.expressions import Constant, Floats, Number, Variable
from coachable.behaviours.predicates import OPERATORS, All, Comparison, Not, Predicate, decision, flattened
from coachable.behaviours.rewriting import expanded

Holds = Callable[[Any, float], bool]
"""From a signal's value and a bound, or all values in a row and nothing, to whether a predicate holds."""

Candidates = tuple[tuple[tuple[Predicate, ...], int], ...]
"""Locations in their order, each after what is not known yet and must hold there."""


class DecisionDiagram:
    """Finds the location of one run whose signals come as plain floats in a row.

    It asks whether a predicate holds, and by the answer what to ask next, until one location is left. No
    predicate is asked twice, however many phases it is a part of. What to ask after which answers is worked
    out when it first happens, so there are no more questions than a run needs. The locations are those of
    `Tracker.locate` to the last bit.
    """

    def __init__(self, tracker: Tracker):
        self._places = {signal: place for place, signal in enumerate(tracker.classifier.signals)}
        self._outside = tracker.classifier.outside
        self._questions: dict[Candidates, _Question] = {}
        phases = tuple(
            (tuple(flattened(All, expanded(predicate))), index)
            for index, predicate in enumerate(tracker.classifier.predicates)
        )
        self._first = [
            self._question(phases if stays is None else ((tuple(flattened(All, stays)), index), *phases))
            # Nobody stays outside, or where nothing was seen yet.
            for index, stays in enumerate((*tracker.staying, None, None))
        ]

    def locate(self, values: Sequence[float], previous: int) -> int:
        """Where the run is, which was at the location `previous`, or *none yet*, one sample ago.

        **Arguments:** `values`: the behaviour's signals in its order.
        """
        # A sum with a NaN in it is NaN. Infinities can make it that, too.
        total = sum(values)
        if total != total and any(map(math.isnan, values)):
            return self._outside
        question = self._first[previous]
        while (holds := question.holds) is not None:
            signal = question.signal
            answer = holds(values if signal is None else values[signal], question.bound)
            question = question.after[answer] or self._follow(question, answer)
        return question.location

    def _follow(self, question: _Question, answer: bool) -> _Question:
        """What to ask after an answer that nobody gave before."""
        asked, left = _asked(question.candidates), []
        fulfilled, refuted = (asked, Not(asked)) if answer else (Not(asked), asked)
        for conditions, location in question.candidates:
            if refuted not in conditions:
                left.append((tuple(one for one in conditions if one != fulfilled), location))
        following = question.after[answer] = self._question(tuple(left))
        return following

    def _question(self, candidates: Candidates) -> _Question:
        """The question about the first candidate, or the answer that it is the one."""
        if candidates not in self._questions:
            conditions, location = candidates[0] if candidates else ((), self._outside)
            asked = self._asking(_asked(candidates)) if conditions else (None, None, 0.0)
            self._questions[candidates] = _Question(candidates, location, *asked)
        return self._questions[candidates]

    def _asking(self, predicate: Predicate) -> tuple[Holds, int | None, float]:
        """How a predicate is asked; see `_Question`."""
        match predicate:
            case Comparison(Variable(signal), relation, Number(bound)) | Comparison(
                Variable(signal), relation, Constant(number=Number(bound))
            ):
                return OPERATORS[relation], self._places[signal], bound
        decide = decision(predicate, _AsInColumns, self._places)
        return lambda values, _: decide(values), None, 0.0


@dataclass(slots=True, eq=False)
class _Question:
    candidates: Candidates
    location: int
    """Where the run is, if there is nothing to ask."""
    holds: Holds | None
    """Most predicates are a relation of a `signal` to a `bound`; any other is asked of all signals."""
    signal: int | None
    bound: float
    after: list[_Question | None] = field(default_factory=lambda: [None, None])
    """What to ask after a no and after a yes, as far as that was ever needed."""


def _asked(candidates: Candidates) -> Predicate:
    """The first predicate that the first candidate depends on; a `Not` is the answer to its part."""
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
