"""Expressions as polynomials in signals and in sines and cosines of sums of them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from fractions import Fraction

from coachable.behaviours.checking.solver.affine import decimal
from coachable.behaviours.expressions import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
)
from coachable.behaviours.tree import fold

Atom = tuple[str, tuple[tuple[str, Fraction], ...], Fraction]
"""`var`, `sin` or `cos`, of a sum of multiples of signals and a number."""
Polynomial = Mapping[tuple[Atom, ...], Fraction]

_MOST_WAVES = 6


class BeyondReach(Exception):
    """A predicate is not of the form that is decided here."""


def polynomial(expression: Expression) -> Polynomial:
    """The polynomial that an expression is, in sums of angles where that has no more terms.

    **Raises:** `BeyondReach` for an expression that is none.
    """

    def of(node: Expression, operands: list[Polynomial]) -> Polynomial:
        match node:
            case Number(value) | Constant(number=Number(value)):
                return {(): decimal(value)}
            case Variable(name):
                return {(("var", ((name, Fraction(1)),), Fraction(0)),): Fraction(1)}
            case Negative():
                return _product(operands[0], {(): Fraction(-1)})
            case Arithmetic(operator="+"):
                return _total(*operands)
            case Arithmetic(operator="-"):
                return _total(operands[0], _product(operands[1], {(): Fraction(-1)}))
            case Arithmetic(operator="*"):
                return _product(*operands)
            case Arithmetic(operator="/") if set(operands[1]) == {()} and operands[1][()]:
                return _product(operands[0], {(): 1 / operands[1][()]})
            case Call("sin" | "cos" as function):
                return _wave_of(function, operands[0])
        raise BeyondReach

    given = _without_zeros(fold(expression, of))
    summed = _with_few_products(given)
    return summed if len(summed) <= len(given) else given


def _without_zeros(polynomial: Polynomial) -> Polynomial:
    return {powers: number for powers, number in polynomial.items() if number}


def _with_few_products(polynomial: Polynomial) -> Polynomial:
    """The polynomial with sums of angles in place of products of waves, as in 2 sin a cos b.

    Squares of distances lose most of their terms by that, and those that cancel drop out. A product of many
    waves would become too many sums, and is left.
    """
    found: Polynomial = {}
    for powers, number in polynomial.items():
        waves = [atom for atom in powers if atom[0] != "var"]
        others = tuple(atom for atom in powers if atom[0] == "var")
        if len(waves) > _MOST_WAVES:
            found = _total(found, {powers: number})
            continue
        sums: Polynomial = {(): number}
        for wave in waves:
            sums = _times_wave(sums, wave)
        found = _total(found, {tuple(sorted((*others, *sum_))): x for sum_, x in sums.items()})
    return _without_zeros(found)


def _times_wave(sums: Polynomial, wave: Atom) -> Polynomial:
    """Multiples of single waves, times another one, as such again."""
    found: Polynomial = {}
    for powers, number in sums.items():
        if not powers:
            found = _total(found, _wave(wave[0], wave[1], wave[2], number))
            continue
        (first,) = powers
        sines = (first[0] == "sin") + (wave[0] == "sin")
        one, other = (wave, first) if first[0] == "cos" else (first, wave)  # a sine first, if there is any
        for sign in (1, -1):
            angle = dict(one[1])
            for name, multiple in other[1]:
                angle[name] = angle.get(name, Fraction(0)) + sign * multiple
            half = number / (-2 if sines == 2 and sign == 1 else 2)
            kind = "sin" if sines == 1 else "cos"
            found = _total(found, _wave(kind, angle.items(), one[2] + sign * other[2], half))
    return found


def _total(one: Polynomial, other: Polynomial) -> Polynomial:
    return {
        powers: one.get(powers, Fraction(0)) + other.get(powers, Fraction(0)) for powers in {**one, **other}
    }


def _product(one: Polynomial, other: Polynomial) -> Polynomial:
    found: dict[tuple[Atom, ...], Fraction] = {}
    for (a, x), (b, y) in itertools.product(one.items(), other.items()):
        powers = tuple(sorted((*a, *b)))
        found[powers] = found.get(powers, Fraction(0)) + x * y
    return found


def _wave_of(function: str, angle: Polynomial) -> Polynomial:
    multiples, offset = {}, Fraction(0)
    for powers, number in angle.items():
        if not powers:
            offset = number
        elif len(powers) == 1 and powers[0][0] == "var":
            multiples[powers[0][1][0][0]] = number
        else:
            raise BeyondReach
    return _wave(function, multiples.items(), offset, Fraction(1))


def _wave(
    function: str, multiples: Iterable[tuple[str, Fraction]], offset: Fraction, factor: Fraction
) -> Polynomial:
    used = sorted((name, number) for name, number in multiples if number)
    if not used and not offset:
        return {(): factor} if function == "cos" else {}
    sign = -1 if (used[0][1] if used else offset) < 0 else 1
    atom = (function, tuple((name, sign * number) for name, number in used), sign * offset)
    return {(atom,): factor * (sign if function == "sin" else 1)}
