"""Predicates in the language of Z3, and states that it finds, each confirmed in floating point.

This is the only file of the descriptions that needs Z3, which is imported when a question is asked.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce

from coachable.behaviours.expressions import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
)
from coachable.behaviours.predicates import OPERATORS, All, Any, Comparison, Not, Predicate, expanded

State = Mapping[str, float]
Confirm = Callable[[State], bool]
Formula = typing.Any
"""A formula or a term of Z3."""

_TIMEOUT_MS = 5_000
_ATTEMPTS = 12
_SMALL = 4


@dataclass(frozen=True)
class Answer:
    """Whether there is such a state: `state` if one was found, else `decided` tells whether none exists."""

    state: State | None
    decided: bool


@dataclass
class Terms:
    """What the names stand for in Z3, and what is known of them; it grows while predicates are translated.

    Z3 knows neither sine nor cosine. Each angle gets a pair (s, c) with s² + c² = 1 and some bounds that hold
    for the true functions, so that what is impossible for the pair is impossible. A divisor is not zero.
    """

    signals: dict[str, Formula] = field(default_factory=dict)
    angles: list[tuple[Expression, Formula, Formula]] = field(default_factory=list)
    conditions: list[Formula] = field(default_factory=list)

    @staticmethod
    def of(names: Iterable[str]) -> Terms:
        """The terms of signals that are all there from the beginning, in their order."""
        terms = Terms()
        for name in names:
            terms.signal(name)
        return terms

    def signal(self, name: str) -> Formula:
        """The real number that a signal is."""
        import z3

        return self.signals.setdefault(name, z3.Real(name))

    def circle(self, angle: Expression) -> tuple[Formula, Formula]:
        """The pair (s, c) that stands for the sine and the cosine of an angle."""
        import z3

        for known, s, c in self.angles:
            if known == angle:
                return s, c
        t = to_z3_term(angle, self)
        s: Formula = z3.Real(f"sin({angle})")
        c: Formula = z3.Real(f"cos({angle})")
        self.angles.append((angle, s, c))
        quarter = Fraction(math.pi / 2)
        self.conditions += [
            s * s + c * c == 1,
            z3.If(t >= 0, z3.And(s <= t, s >= t - t * t * t / 6), z3.And(s >= t, s <= t - t * t * t / 6)),
            2 * c >= 2 - t * t,
            z3.Implies(z3.And(t > 0, t < _real(2 * quarter)), s > 0),
            z3.Implies(z3.And(t < 0, t > _real(-2 * quarter)), s < 0),
            z3.Implies(z3.And(t < _real(quarter), t > _real(-quarter)), c > 0),
        ]
        return s, c


def to_z3(predicate: Predicate, terms: Terms) -> Formula:
    """The predicate as a formula; what it needs to know of its terms is left in `terms.conditions`."""
    import z3

    match expanded(predicate):
        case Comparison(left=left, relation=relation, right=right):
            return OPERATORS[relation](to_z3_term(left, terms), to_z3_term(right, terms))
        case All(parts=parts):
            return z3.And(*(to_z3(part, terms) for part in parts))
        case Any(parts=parts):
            return z3.Or(*(to_z3(part, terms) for part in parts))
        case Not(part):
            return z3.Not(to_z3(part, terms))
        case other:
            raise TypeError(f"{other!r} is not expanded")


def to_z3_term(expression: Expression, terms: Terms) -> Formula:
    """The expression as a real term; numbers are exactly the floats that the library computes with."""
    import z3

    match expression:
        case Number(value):
            return _real(Fraction(value))
        case Constant(number=number):
            return _real(Fraction(number.value))
        case Variable(signal):
            return terms.signal(signal)
        case Negative(operand):
            return -to_z3_term(operand, terms)
        case Arithmetic(left, symbol, right):
            a, b = to_z3_term(left, terms), to_z3_term(right, terms)
            if symbol == "/":
                terms.conditions.append(b != 0)
            return {"+": a + b, "-": a - b, "*": a * b}[symbol] if symbol != "/" else a / b
        case Call("sin", (angle,)):
            return terms.circle(angle)[0]
        case Call("cos", (angle,)):
            return terms.circle(angle)[1]
        case Call("abs", (operand,)):
            a = to_z3_term(operand, terms)
            return z3.If(a >= 0, a, -a)
        case Call(function, arguments):
            operands = [to_z3_term(argument, terms) for argument in arguments]
            return reduce(_smaller if function == "min" else _larger, operands)


def _smaller(a: Formula, b: Formula) -> Formula:
    import z3

    return z3.If(a <= b, a, b)


def _larger(a: Formula, b: Formula) -> Formula:
    import z3

    return z3.If(a >= b, a, b)


def find_state(claims: Sequence[Formula], terms: Terms, confirm: Confirm) -> Answer:
    """A state that fulfils all claims and that `confirm` agrees to when it is computed in floats.

    States with small numbers are preferred, and their digits are dropped as far as `confirm` allows.
    """
    import z3

    small = [z3.And(x <= _SMALL, x >= -_SMALL) for x in terms.signals.values()]
    everything = [*terms.conditions, *claims]
    undecided = False
    for bounds in (small, []):
        barred: list[Formula] = []
        for _ in range(_ATTEMPTS):
            model = _check([*everything, *bounds, *barred])
            if not model:
                undecided |= model is None or bool(barred)
                break
            for candidate in _candidates(model, [*everything, *bounds], terms):
                if confirm(candidate):
                    return Answer(_rounded(candidate, confirm), decided=True)
            barred.append(_elsewhere(model, terms))
            undecided = True
    return Answer(None, decided=not undecided)


def _check(claims: Sequence[Formula]) -> typing.Any:
    """A model, `False` if there is none, `None` if Z3 does not know."""
    import z3

    solver = z3.Solver()
    solver.set("timeout", _TIMEOUT_MS)
    solver.add(*claims)
    match solver.check():
        case z3.sat:
            return solver.model()
        case z3.unsat:
            return False
        case _:
            return None


def _candidates(model: typing.Any, claims: Sequence[Formula], terms: Terms) -> Iterator[State]:
    """The state of a model, and those that Z3 finds when the angles' pairs are held to true values."""
    import z3

    yield _state(model, terms)
    if not terms.angles:
        return
    free = [claim for claim in claims if not any(claim is condition for condition in terms.conditions)]
    for follow in (_angle_itself, _angle_of_sine, _angle_of_cosine):
        held = []
        for angle, s, c in terms.angles:
            term = to_z3_term(angle, terms)
            t = follow(*(_float(model, part) for part in (term, s, c)))
            held.append(term == _real(Fraction(t)))
            for part, true in ((s, math.sin(t)), (c, math.cos(t))):
                held.append(z3.And(part < _real(Fraction(true + 1e-9)), part > _real(Fraction(true - 1e-9))))
        if better := _check([*free, *held]):
            yield _state(better, terms)


def _angle_itself(t: float, s: float, c: float) -> float:
    return t


def _angle_of_sine(t: float, s: float, c: float) -> float:
    principal = math.asin(max(-1.0, min(1.0, s)))
    return min((_turned(principal, t), _turned(math.pi - principal, t)), key=lambda angle: abs(angle - t))


def _angle_of_cosine(t: float, s: float, c: float) -> float:
    principal = math.acos(max(-1.0, min(1.0, c)))
    return min((_turned(principal, t), _turned(-principal, t)), key=lambda angle: abs(angle - t))


def _turned(angle: float, near: float) -> float:
    """The angle after as many whole turns as bring it nearest to another."""
    return angle + 2 * math.pi * round((near - angle) / (2 * math.pi))


def _elsewhere(model: typing.Any, terms: Terms) -> Formula:
    """That the next state is not close to the model's: in its angles if it has any, else in its signals."""
    import z3

    places = [to_z3_term(angle, terms) for angle, _, _ in terms.angles] or list(terms.signals.values())
    values = [Fraction(_float(model, place)) for place in places]
    near = Fraction(1, 20)
    return z3.Or(
        *(
            z3.Or(place < _real(value - near), place > _real(value + near))
            for place, value in zip(places, values, strict=True)
        )
    )


def _state(model: typing.Any, terms: Terms) -> State:
    return {name: _float(model, x) for name, x in terms.signals.items()}


def _float(model: typing.Any, term: Formula) -> float:
    import z3

    value = model.eval(term, model_completion=True)
    if z3.is_algebraic_value(value):
        value = value.approx(20)
    return float(value.as_fraction()) + 0.0


def _rounded(state: State, confirm: Confirm) -> State:
    """The state with as few digits as it can do with."""
    for digits in range(1, 16):
        short = {name: float(f"{value:.{digits}g}") for name, value in state.items()}
        if confirm(short):
            return short
    return state


def _real(value: Fraction) -> Formula:
    import z3

    return z3.RealVal(str(value))
