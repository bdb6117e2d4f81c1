"""Violations of a behaviour by a trace, with their reasons in words."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from coachable.automata.latches import has_deadband
from coachable.automata.trace import seconds
from coachable.behaviours.behaviour import Behaviour, Dwell, Phase
from coachable.behaviours.expressions import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
    evaluate,
)
from coachable.behaviours.predicates import (
    All,
    Any,
    Between,
    Comparison,
    Near,
    Not,
    Phrase,
    Predicate,
    comparisons_of,
    holds,
)
from coachable.behaviours.rewriting import conjuncts, widened
from coachable.behaviours.tree import fold, walk


class Kind(enum.Enum):
    """The kind of a violation."""

    START_OUTSIDE = "starts in no phase"
    LEFT = "leaves all phases"
    NOT_AN_EDGE = "goes where no edge leads"
    TOO_SHORT = "leaves a phase before its time"
    TOO_LONG = "stays in a phase beyond its time"


@dataclass(frozen=True)
class Violation:
    """One moment at which a trace does not follow its behaviour."""

    kind: Kind
    time: float
    """[s]"""
    source: str | None
    """The phase at the sample before; `None` at the start."""
    target: str | None
    """The phase at this sample; `None` outside."""
    duration: float
    """How long the trace had been in `source` [s]."""
    values: Mapping[str, float]
    """The signals at this sample, by name."""
    behaviour: Behaviour = field(repr=False)
    absences: int = 0
    """How many short absences from `source` there were in that time."""

    @property
    def sentence(self) -> str:
        """The time, the violation and its reason in words."""
        return f"t = {seconds(self.time)} s: {self._what()}"

    def _what(self) -> str:
        outside = f"outside ({self.behaviour.outside})" if self.behaviour.outside else "outside"
        way = f"{self.source} → {self.target or outside}"
        match self.kind:
            case Kind.START_OUTSIDE:
                return f"it starts {outside}, in no phase. {self._nearest()}"
            case Kind.LEFT:
                return f"{way} leaves all phases. {self._reasons()}"
            case Kind.NOT_AN_EDGE:
                return f"{way} is not an edge. {self._reasons()}"
            case Kind.TOO_SHORT:
                least = self._dwell().at_least
                lasted = f"{self.source} lasted {seconds(self.duration)} s"
                return f"{way} comes too soon: {lasted} of at least {least:g} s."
            case Kind.TOO_LONG:
                most = self._dwell().at_most
                count = self.absences
                away = f", {count} short absence{'s' * (count > 1)} included," if count else ""
                return (
                    f"{self.source} lasts too long: {seconds(self.duration)} s{away} of at most {most:g} s."
                )

    def _phase(self, name: str) -> Phase:
        return next(phase for phase in self.behaviour.phases if phase.name == name)

    def _dwell(self) -> Dwell:
        dwell = self._phase(self.source or "").dwell
        assert dwell is not None, "a dwell time was violated, so there is one"
        return dwell

    def _reasons(self) -> str:
        """Why the trace is not where it could have been: still in its phase, or in one that may follow."""
        if unknown := self._unknown():
            return unknown
        assert self.source is not None, "a phase was left, so there is one"
        following = [edge.target for edge in self.behaviour.edges if edge.source == self.source]
        candidates = dict.fromkeys([self.source, *following])
        return " ".join(f"{name}: {self._reason(name)}." for name in candidates)

    def _reason(self, name: str) -> str:
        predicate = self._phase(name).predicate
        if name == self.source and has_deadband(predicate):
            predicate = widened(predicate)
        failures = list(self._failures(predicate))
        return ", ".join(failures) or f"it holds, but {self.target} comes before it"

    def _nearest(self) -> str:
        """What the phase needs that fails in the fewest ways."""
        if unknown := self._unknown():
            return unknown
        failures = {phase.name: list(self._failures(phase.predicate)) for phase in self.behaviour.phases}
        name = min(failures, key=lambda name: len(failures[name]))
        return f"{name}: {', '.join(failures[name])}."

    def _unknown(self) -> str:
        missing = [name for name, value in self.values.items() if math.isnan(value)]
        return f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} NaN." if missing else ""

    def _failures(self, predicate: Predicate) -> Iterator[str]:
        """What of a predicate fails, with the amount by which it does."""
        if holds(predicate, self.values):
            return
        match predicate:
            case Comparison():
                yield self._shortfall(predicate)
            case Between() | Near():
                yield from self._failures(All(*comparisons_of(predicate)))
            case Phrase(words, part):
                yield f"{words} ({', '.join(self._failures(part))})"
            case Not(Phrase(predicate=part)):
                yield f"{predicate} ({', '.join(self._failures(Not(part)))})"
            case All(parts=parts):
                for part in parts:
                    yield from self._failures(part)
            case Any(parts=parts):
                reasons = [" and ".join(self._failures(part)) for part in parts]
                yield " or ".join(reasons) or "it never holds"
            case Not():
                yield from self._failures(All(*conjuncts(predicate)))

    def _shortfall(self, comparison: Comparison) -> str:
        """`dtheta_1 exceeded its bound 0 by 0.07 rad/s`"""
        subject, bound = comparison.left, comparison.right
        above = comparison.relation in (">", ">=")
        if not _varies(subject) and _varies(bound):
            subject, bound, above = bound, subject, not above
        amount = abs(evaluate(subject, self.values) - evaluate(bound, self.values))
        if math.isnan(amount):
            return f"{comparison} has no value"
        if amount == 0:
            return f"{subject} is at its bound {bound} and not {'above' if above else 'below'} it"
        units = {signal.name: signal.unit for signal in self.behaviour.signals}
        unit = _unit(subject, units) or _unit(bound, units)
        verb = "fell short of" if above else "exceeded"
        return f"{subject} {verb} its bound {bound} by {amount:.3g} {unit}".rstrip()


def _varies(expression: Expression) -> bool:
    return any(walk(expression, Variable))


def _unit(expression: Expression, units: Mapping[str, str]) -> str:
    """The unit of an expression without products, which are left to the checker."""

    def unit_of(node: Expression, operands: list[str]) -> str:
        match node:
            case Variable(signal):
                return units[signal]
            case Number(unit=unit) | Constant(number=Number(unit=unit)):
                return unit
            case Negative() | Arithmetic(operator="+" | "-") | Call(function="abs" | "min" | "max"):
                return next(filter(None, operands), "")
            case _:
                return ""

    return fold(expression, unit_of)
