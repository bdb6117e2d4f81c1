"""Units that differ where two numbers are compared, added or assigned, and units that cannot be parsed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.findings import Finding, Proven, Result, Subject
from coachable.behaviours.checking.units import NONE, SECOND, Unit, parse_unit, unfamiliar
from coachable.behaviours.expressions import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
)
from coachable.behaviours.predicates import (
    All,
    Any,
    Between,
    Comparison,
    Near,
    Not,
    Predicate,
)
from coachable.behaviours.tree import children, walk
from coachable.foundation.errors import BehaviourError

Measure = Unit | None
"""The unit of an expression; `None` for a number without one, which takes that of the other side."""


def unit_mismatches(behaviour: Behaviour) -> Iterator[Result]:
    """Places where a number in one unit meets one in another, and units that cannot be read."""
    unreadable = list(_unreadable(behaviour))
    yield from unreadable
    if any(finding.severity == "error" for finding in unreadable):
        return
    units = {signal.name: parse_unit(signal.unit) for signal in behaviour.signals}
    found: list[Finding] = []
    for signal in behaviour.signals:
        if signal.derivative_of is not None:
            found += _of_derivative(behaviour, signal.name, signal.derivative_of, units)
    places = [(Subject("phrase", phrase.words), phrase.predicate) for phrase in behaviour.vocabulary]
    places += [(Subject("phase", phase.name), phase.predicate) for phase in behaviour.phases]
    for subject, predicate in places:
        ledger = Ledger(subject, units, [])
        ledger.check(predicate)
        found += ledger.findings
    for edge in behaviour.edges:
        ledger = Ledger(Subject("edge", str(edge)), units, [])
        for jump in edge.reset:
            ledger.meet(Variable(jump.signal), jump.expression, str(jump))
        found += ledger.findings
    yield from found
    if not found and any(signal.unit for signal in behaviour.signals):
        yield Proven("units agree")


@dataclass(frozen=True)
class Ledger:
    """The units in the predicates at one place, and the findings where they differ."""

    subject: Subject
    units: Mapping[str, Unit]
    findings: list[Finding]

    def check(self, predicate: Predicate) -> None:
        """Checks a predicate; the phrases in it are places of their own."""
        match predicate:
            case Comparison(left, _, right, deadband):
                self.meet(left, right, str(predicate))
                if deadband is not None:
                    self.meet(left if self.of(left, "") else right, deadband, str(predicate))
            case Between(low=low, middle=middle, high=high, deadband=deadband):
                for other in (low, high, *([] if deadband is None else [deadband])):
                    self.meet(middle, other, str(predicate))
            case Near(value, target, tolerance):
                self.meet(value, target, str(predicate))
                self.meet(value, tolerance, str(predicate))
            case Not() | All() | Any():
                for part in children(predicate):
                    self.check(part)

    def meet(self, one: Expression, other: Expression, where: str) -> Measure:
        """The common unit of two expressions; a finding if they have two."""
        first, second = self.of(one, where), self.of(other, where)
        if first is None or second is None:
            return second if first is None else first
        if not first.equals(second):
            self._note(
                f"{_in(one, first)}, and {_in(other, second)}. {_conversion(one, first, other, second)}",
                where,
            )
        return first

    def of(self, expression: Expression, where: str) -> Measure:
        """The unit of an expression; unless `where` is empty, units that differ inside it make a finding."""
        match expression:
            case Number(unit=unit) | Constant(number=Number(unit=unit)):
                return parse_unit(unit) if unit else None
            case Variable(signal):
                return self.units[signal]
            case Negative(operand) | Call("abs", (operand,)):
                return self.of(operand, where)
            case Arithmetic(left, "+" | "-", right):
                return (
                    self.meet(left, right, where) if where else self.of(left, where) or self.of(right, where)
                )
            case Arithmetic(left, symbol, right):
                one, other = self.of(left, where), self.of(right, where)
                if one is None and other is None:
                    return None
                return (one or NONE).times(other or NONE, 1 if symbol == "*" else -1)
            case Call("sin" | "cos" as function, (angle,)):
                unit = self.of(angle, where)
                if where and unit is not None and not unit.equals(NONE):
                    advice = _conversion(Number(0), Unit(1.0, (("rad", 1),)), angle, unit)
                    self._note(f"{function} takes radians, and {_in(angle, unit)}. {advice}", where)
                return NONE
            case Call(arguments=arguments):
                measures = [self.of(arguments[0], where)]
                for argument in arguments[1:]:
                    measures.append(
                        self.meet(arguments[0], argument, where) if where else self.of(argument, where)
                    )
                return next((measure for measure in measures if measure is not None), None)

    def _note(self, message: str, where: str) -> None:
        self.findings.append(
            Finding(
                "unit-mismatch",
                "error",
                (self.subject,),
                f"In `{where}`, {message}".rstrip(),
                "Units are never converted: write both in one unit.",
            )
        )


def _in(expression: Expression, unit: Unit) -> str:
    match expression:
        case Number(value, text):
            return f"{value:g} is in {text}"
        case _:
            return f"{expression} " + ("has no unit" if unit == NONE else f"is in {unit}")


def _conversion(one: Expression, first: Unit, other: Expression, second: Unit) -> str:
    """The number in the other unit, if the dimensions agree."""
    if not first.same_dimension(second):
        return ""
    for expression, own, wanted in ((other, second, first), (one, first, second)):
        number = expression.number if isinstance(expression, Constant) else expression
        if isinstance(number, Number) and number.unit:
            return f"{number} is {float(number.value * own.scale / wanted.scale):.4g} [{wanted}]."
    return f"Multiply {other} by {float(second.scale / first.scale):.4g}."


def _unreadable(behaviour: Behaviour) -> Iterator[Finding]:
    named = [(Subject("signal", signal.name), signal.unit) for signal in behaviour.signals]
    named += [(Subject("constant", constant.name), constant.number.unit) for constant in behaviour.constants]
    places = [(Subject("phrase", phrase.words), phrase.predicate) for phrase in behaviour.vocabulary]
    places += [(Subject("phase", phase.name), phase.predicate) for phase in behaviour.phases]
    for subject, predicate in places:
        named += [(subject, number.unit) for number in _numbers_in(predicate)]
    for edge in behaviour.edges:
        for jump in edge.reset:
            named += [(Subject("edge", str(edge)), number.unit) for number in walk(jump.expression, Number)]
    seen = set()
    for subject, unit in named:
        if unit in seen:
            continue
        seen.add(unit)
        try:
            parse_unit(unit)
        except BehaviourError as error:
            yield Finding("unreadable-unit", "error", (subject,), f"{subject}: {error}.", "Correct the unit.")
            continue
        for word, near in unfamiliar(unit).items():
            if near is not None:
                yield Finding(
                    "unfamiliar-unit",
                    "note",
                    (subject,),
                    f"{subject} is in {unit}, and {word} counts as a unit of its own.",
                    f"Did you mean {near}?",
                )


def _numbers_in(predicate: Predicate) -> Iterator[Number]:
    yield from walk(predicate, Number)
    yield from (part.deadband for part in walk(predicate, Comparison, Between) if part.deadband is not None)


def _of_derivative(
    behaviour: Behaviour, signal: str, derivative_of: str, units: Mapping[str, Unit]
) -> Iterator[Finding]:
    texts = {one.name: one.unit for one in behaviour.signals}
    wanted = units[derivative_of].times(SECOND, -1)
    if (texts[signal] or texts[derivative_of]) and not units[signal].equals(wanted):
        yield Finding(
            "unit-mismatch",
            "error",
            (Subject("signal", signal),),
            f"{signal} = d/dt {derivative_of} must be in [{texts[derivative_of] or '1'}/s], "
            + (f"and is in [{texts[signal]}]." if texts[signal] else "and has no unit."),
            f"Write {signal} [{texts[derivative_of] or '1'}/s], or remove `d/dt {derivative_of}`.",
        )
