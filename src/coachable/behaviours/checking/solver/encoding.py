"""Expressions and predicates as the terms and formulas of the solver Z3.

The solver has exact numbers and no sine. The sine and cosine of an angle become two unknowns on the unit
circle, constrained by facts that are true of every sine, so that what follows for them follows for sines.
"""

from __future__ import annotations

import itertools
import operator
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

import z3

from coachable.behaviours.behaviour import Assignment
from coachable.behaviours.checking.solver import sines
from coachable.behaviours.checking.solver.affine import decimal
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
from coachable.behaviours.predicates import OPERATORS, All, Any, Comparison, Not, Predicate
from coachable.behaviours.rewriting import expanded
from coachable.behaviours.tree import fold

# The solver's own annotations do not know its operators, so its terms are typed by name only.
Formula = typing.Any
Real = typing.Any
Witness = Mapping[str, float]

_ARITHMETIC = {"+": operator.add, "-": operator.sub, "*": operator.mul}


@dataclass(frozen=True, eq=False)
class State:
    """The signals at one moment as solver terms, and their floats, given those of the free ones."""

    symbols: Mapping[str, Real]
    floats: Callable[[Witness], Witness]


def exact(number: Fraction) -> Real:
    """A number as a solver term."""
    return z3.RealVal(number)


class Encoding:
    """States of a behaviour, and predicates on them, as solver terms.

    `facts` is what is true of every state; `free` are the signals of all states by the solver's names, and
    `sines` the angles whose sine is taken, each with the unknowns that stand for its sine and cosine;
    `divisors` is what is divided by.
    """

    def __init__(self, signals: Sequence[str]):
        self.facts: list[Formula] = []
        self.free: dict[str, Real] = {}
        self.sines: dict[str, tuple[Real, Real, Real]] = {}
        self.divisors: list[Real] = []
        self._signals = tuple(signals)
        self._quotients: dict[str, Real] = {}
        self._fresh = itertools.count()

    def state(self) -> State:
        """A new state without constraints; a witness is a value of the first one."""
        moment = next(self._fresh)
        symbols = {signal: z3.Real(f"{signal}@{moment}") for signal in self._signals}
        self.free.update({str(symbol): symbol for symbol in symbols.values()})
        return State(symbols, lambda free: {signal: free[str(symbol)] for signal, symbol in symbols.items()})

    def after(self, state: State, reset: Sequence[Assignment]) -> State:
        """The state right after the signals have jumped."""
        jumped = {jump.signal: self.value(jump.expression, state, []) for jump in reset}

        def floats(free: Witness) -> Witness:
            before = state.floats(free)
            return {**before, **{jump.signal: evaluate(jump.expression, before) for jump in reset}}

        return State({**state.symbols, **jumped}, floats)

    def unknown_number(self) -> Real:
        """A new number without constraints, such as a time."""
        return z3.Real(f"number@{next(self._fresh)}")

    def truth(self, predicate: Predicate, state: State) -> Formula:
        """The predicate as a formula.

        Division by zero gives infinities, which the solver does not have: there a comparison may be either
        true or false, so that a proof of impossibility includes this case.
        """
        match expanded(predicate):
            case Comparison(left, relation, right):
                divisors: list[Real] = []
                plain = OPERATORS[relation](
                    self.value(left, state, divisors), self.value(right, state, divisors)
                )
                if not divisors:
                    return plain
                either = z3.Bool(f"either@{next(self._fresh)}")
                return z3.If(z3.Or([divisor == 0 for divisor in divisors]), either, plain)
            case All(parts=parts):
                return z3.And([self.truth(part, state) for part in parts])
            case Any(parts=parts):
                return z3.Or([self.truth(part, state) for part in parts])
            case Not(part):
                return z3.Not(self.truth(part, state))
            case other:
                raise TypeError(f"{other!r} is not expanded")

    def value(self, expression: Expression, state: State, divisors: list[Real]) -> Real:
        """The expression as a term; what it divides by is added to `divisors`."""

        def term(node: Expression, operands: list[Real]) -> Real:
            match node:
                case Number(value) | Constant(number=Number(value)):
                    return exact(decimal(value))
                case Variable(signal):
                    return state.symbols[signal]
                case Negative():
                    return -operands[0]
                case Arithmetic(operator="/"):
                    divisors.append(operands[1])
                    return self._quotient(*operands)
                case Arithmetic(operator=symbol):
                    return _ARITHMETIC[symbol](*operands)
                case Call("sin" | "cos" as function):
                    return self._sine_and_cosine(operands[0])[function == "cos"]
                case Call("abs"):
                    return z3.If(operands[0] < 0, -operands[0], operands[0])
                case Call(function):
                    relation = OPERATORS["<" if function == "min" else ">"]
                    return reduce(lambda best, other: z3.If(relation(other, best), other, best), operands)

        return fold(expression, term)

    def _quotient(self, one: Real, other: Real) -> Real:
        divisor: typing.Any = z3.simplify(other)
        if z3.is_rational_value(divisor):
            return one / divisor if divisor.as_fraction() else one
        key = f"{one.sexpr()} / {other.sexpr()}"
        if key not in self._quotients:
            self._quotients[key] = quotient = z3.Real(f"quotient@{next(self._fresh)}")
            self.facts.append(z3.Implies(other != 0, quotient * other == one))
            self.divisors.append(other)
        return self._quotients[key]

    def _sine_and_cosine(self, angle: Real) -> tuple[Real, Real]:
        angle = z3.simplify(angle, som=True)
        for known, sine, cosine in self.sines.values():
            # Terms of one sum come in any order, so angles are compared by what is left of them.
            if _is_zero(angle - known):
                return sine, cosine
            if _is_zero(angle + known):
                return -sine, cosine
        moment = next(self._fresh)
        new = (angle, z3.Real(f"sin@{moment}"), z3.Real(f"cos@{moment}"))
        self.facts += sines.facts_of(*new)
        for other in self.sines.values():
            self.facts += sines.order_of(new, other)
        self.sines[angle.sexpr()] = new
        return new[1:]


def _is_zero(term: Real) -> bool:
    left: typing.Any = z3.simplify(term, som=True)
    return z3.is_rational_value(left) and left.as_fraction() == 0
