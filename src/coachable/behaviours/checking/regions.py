"""Phases as regions of the signal space: their closures, and where a trajectory can leave and enter them.

A trajectory is continuous between jumps, and a signal declared as a derivative is one. A
trajectory that leaves a phase in which g > 0 across g = 0 was, a moment before, in that phase with dg/dt < 0;
one that enters it is, a moment later, in it with dg/dt > 0. Where no such moment exists near a point of the
boundary, no trajectory crosses there. These conditions are necessary, so what they exclude is impossible.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour, Edge
from coachable.behaviours.checking.boxes import is_in_the_middle
from coachable.behaviours.checking.solver import Question, State, is_affine, refuted, without_corners
from coachable.behaviours.expressions import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
)
from coachable.behaviours.predicates import All, Any, Comparison, Predicate
from coachable.behaviours.rewriting import expanded, widened, without_negations
from coachable.behaviours.tree import Node, fold, rewritten, walk

_MOST_TERMS = 64
_NON_STRICT: Mapping[str, str] = {"<": "<=", ">": ">="}
_OUTWARDS: Mapping[bool, str] = {True: "<", False: ">"}

Refuted = Callable[[Predicate], bool | None]


@dataclass(frozen=True)
class Term:
    """Comparisons that hold together, their closure, and the strict ones among them."""

    predicate: Predicate
    closure: Predicate
    strict: tuple[Comparison, ...] = ()


@dataclass(frozen=True)
class RateCondition:
    """The necessary condition for crossing the boundary of a strict comparison: a sign of its `rate`."""

    comparison: Comparison
    rate: Expression
    relation: str

    def __str__(self) -> str:
        return f"{self.rate} {self.relation} 0"


@dataclass(frozen=True)
class Region:
    """A phase as a union of terms, the empty ones left out.

    If not `exact`, `closure` may be larger than the closure, so that only what it excludes is certain.
    """

    terms: tuple[Term, ...]
    exact: bool
    rate_condition: Callable[[Comparison, bool], RateCondition | None]
    refuted: Refuted

    @property
    def closure(self) -> Predicate:
        """The region with its boundary."""
        return Any(*(term.closure for term in self.terms))

    def passage(self, leaving: bool, only: Comparison | None = None) -> Predicate:
        """The part of the closure where a trajectory can leave, or enter; `only` looks at one comparison."""
        return Any(*(self._passage(term, leaving, only) for term in self.terms))

    def demands(self, leaving: bool) -> tuple[RateCondition, ...]:
        """The conditions on the derivatives for leaving, or entering."""
        found = (
            self.rate_condition(comparison, leaving) for term in self.terms for comparison in term.strict
        )
        return tuple(dict.fromkeys(condition for condition in found if condition is not None))

    def _passage(self, term: Term, leaving: bool, only: Comparison | None) -> Predicate:
        parts: list[Predicate] = [term.closure]
        for comparison in term.strict:
            condition = self.rate_condition(comparison, leaving)
            if condition is None or (only is not None and comparison != only):
                continue
            moving = Comparison(condition.rate, condition.relation, 0)
            if self.refuted(All(term.predicate, moving)):
                parts.append(comparison)
            else:
                parts.append(Any(comparison, relaxed(moving)))
        return All(*parts)


def rates_of(behaviour: Behaviour) -> dict[str, str]:
    """Signal → the signal that is declared to be its derivative."""
    return {
        signal.derivative_of: signal.name
        for signal in reversed(behaviour.signals)
        if signal.derivative_of is not None
    }


@dataclass(frozen=True)
class Regions:
    """Each phase as the region in which it lasts.

    It may be entered anywhere in it, for a comparison with a deadband remembers whatever the phase is.
    """

    lasting: Mapping[str, Region]
    region_of: Callable[[Predicate], Region]
    signals: tuple[str, ...]

    @staticmethod
    def of(behaviour: Behaviour) -> Regions:
        """The regions of all phases."""
        rates = rates_of(behaviour)

        @functools.cache
        def refuted_here(predicate: Predicate) -> bool | None:
            return False if is_in_the_middle(predicate) else refuted(behaviour.signal_names, predicate)

        @functools.cache
        def region_of(predicate: Predicate) -> Region:
            return region(predicate, rates, refuted_here)

        return Regions(
            {phase.name: region_of(widened(phase.predicate)) for phase in behaviour.phases},
            region_of,
            behaviour.signal_names,
        )

    def travel(self, edge: Edge, question: Question, before: State) -> State:
        """The state right after an edge: the same one, the reset one, or an unknown one."""
        if edge.reset:
            return question.after(before, edge.reset)
        return question.state() if edge.event is not None else before

    def touch(self, edge: Edge) -> bool | None:
        """Whether the edge's phases touch, across the reset if there is one; `None` if that is not known."""
        source, target = self.lasting[edge.source], self.lasting[edge.target]
        return self._possible(edge, source.closure, target.closure, source.exact and target.exact)

    def travelled(self, edge: Edge, only: Comparison | None = None) -> bool | None:
        """Whether the derivatives allow the edge; `only` looks at the condition of one comparison."""
        source, target = self.lasting[edge.source], self.lasting[edge.target]
        leave, enter = source.passage(True, only), target.passage(False, only)
        return self._possible(edge, leave, enter, source.exact and target.exact)

    def _possible(self, edge: Edge, leave: Predicate, enter: Predicate, exact: bool) -> bool | None:
        question = Question(self.signals)
        before = question.state()
        question.require(leave, before)
        question.require(enter, self.travel(edge, question, before))
        match question.refuted():
            case True:
                return False
            case False if exact or question.shown:
                return True
            case _:
                return None


def region(predicate: Predicate, rates: Mapping[str, str], refuted: Refuted) -> Region:
    """The region of a predicate.

    **Arguments:** `rates`: signal → the signal that is its derivative; `refuted` proves that a predicate
    holds nowhere.
    """

    def rate_condition(comparison: Comparison, leaving: bool) -> RateCondition | None:
        rate = rate_of(Arithmetic(comparison.left, "-", comparison.right), rates)
        if rate is None:
            return None
        return RateCondition(comparison, rate, _OUTWARDS[leaving == (comparison.relation == ">")])

    spelt_out = without_negations(without_corners(expanded(predicate)))
    if _count(spelt_out) > _MOST_TERMS:
        return Region((Term(predicate, relaxed(predicate)),), False, rate_condition, refuted)
    terms = []
    for comparisons in map(tuple, map(dict.fromkeys, _alternatives(spelt_out))):
        whole = All(*comparisons)
        if not refuted(whole):
            strict = tuple(comparison for comparison in comparisons if comparison.relation in _NON_STRICT)
            terms.append(Term(whole, relaxed(whole), strict))
    exact = all(
        is_affine(side)
        for term in terms
        for comparison in walk(term.predicate, Comparison)
        for side in (comparison.left, comparison.right)
    )
    return Region(tuple(dict.fromkeys(terms)), exact, rate_condition, refuted)


def relaxed(predicate: Predicate) -> Predicate:
    """The predicate with < and > read as <= and >=: it holds at least on the closure."""

    def non_strict(node: Node) -> Predicate | None:
        match node:
            case Comparison(left, relation, right):
                return Comparison(left, _NON_STRICT.get(relation, relation), right)

    return rewritten(without_negations(expanded(predicate)), non_strict)


def _count(predicate: Predicate) -> int:
    """How many conjunctions the disjunctive normal form has."""
    match predicate:
        case All(parts=parts):
            return math.prod(map(_count, parts))
        case Any(parts=parts):
            return sum(map(_count, parts))
        case _:
            return 1


def _alternatives(predicate: Predicate) -> list[tuple[Comparison, ...]]:
    """The disjunctive normal form: conjunctions, one of which holds where the predicate does."""
    if _count(predicate) == 0:
        return []
    match predicate:
        case Comparison():
            return [(predicate,)]
        case Any(parts=parts):
            return [alternative for part in parts for alternative in _alternatives(part)]
        case All(parts=parts):
            return [
                tuple(itertools.chain(*chosen)) for chosen in itertools.product(*map(_alternatives, parts))
            ]
        case other:
            raise TypeError(f"{other!r} has negations")


def rate_of(expression: Expression, rates: Mapping[str, str]) -> Expression | None:
    """The derivative in time, in declared derivatives; `None` where one is missing or there is a corner.

    **Arguments:** `rates`: signal → the signal that is its derivative.
    """

    def rate(node: Expression, inner: list[Expression | None]) -> Expression | None:
        known = [one for one in inner if one is not None]
        if len(known) < len(inner):
            return None
        match node:
            case Number() | Constant():
                return Number(0)
            case Variable(signal):
                return Variable(rates[signal]) if signal in rates else None
            case Negative():
                return _minus(Number(0), *known)
            case Arithmetic(operator="+"):
                return _plus(*known)
            case Arithmetic(operator="-"):
                return _minus(*known)
            case Arithmetic(left, "*", right):
                return _plus(_times(known[0], right), _times(left, known[1]))
            case Arithmetic(left, _, right):
                over = _minus(_times(known[0], right), _times(left, known[1]))
                return over if over == Number(0) else Arithmetic(over, "/", _times(right, right))
            case Call("sin", (angle,)):
                return _times(Call("cos", angle), *known)
            case Call("cos", (angle,)):
                return _minus(Number(0), _times(Call("sin", angle), *known))

    return fold(expression, rate)


def _plus(one: Expression, other: Expression) -> Expression:
    if one == Number(0):
        return other
    return one if other == Number(0) else Arithmetic(one, "+", other)


def _minus(one: Expression, other: Expression) -> Expression:
    if other == Number(0):
        return one
    return Negative(other) if one == Number(0) else Arithmetic(one, "-", other)


def _times(one: Expression, other: Expression) -> Expression:
    if Number(0) in (one, other):
        return Number(0)
    if Number(1) in (one, other):
        return other if one == Number(1) else one
    return Arithmetic(one, "*", other)
