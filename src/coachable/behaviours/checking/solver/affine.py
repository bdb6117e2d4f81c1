"""Sums of multiples of signals: the expressions whose comparisons cut a space along planes."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

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
from coachable.behaviours.predicates import Comparison, Predicate
from coachable.behaviours.tree import fold, walk

Affine = tuple[dict[str, Fraction], Fraction]
"""Signal → its multiple, and the number that is added."""


def decimal(value: float) -> Fraction:
    """The number that was written, not the float beside it: 0.1 is one tenth."""
    return Fraction(repr(value))


def nearest_float(fraction: Fraction) -> float:
    """The nearest float; for what is beyond them all, the last one."""
    try:
        return float(fraction)
    except OverflowError:
        return sys.float_info.max if fraction > 0 else -sys.float_info.max


def is_affine(expression: Expression, with_corners: bool = False) -> bool:
    """Whether an expression is a sum of multiples of signals and a number, by the way it is written.

    **Arguments:** `with_corners`: abs, min and max of such sums will do, too.
    """
    match expression:
        case Call("abs" | "min" | "max", arguments) if with_corners:
            return all(is_affine(argument, True) for argument in arguments)
        case Number() | Constant() | Variable():
            return True
        case Negative(operand):
            return is_affine(operand, with_corners)
        case Arithmetic(left, "+" | "-", right):
            return is_affine(left, with_corners) and is_affine(right, with_corners)
        case Arithmetic(left, "*", right):
            sides = is_affine(left, with_corners) and is_affine(right, with_corners)
            return sides and (_is_number(left) or _is_number(right))
        case Arithmetic(left, _, right):
            return is_affine(left, with_corners) and _is_number(right) and evaluate(right, {}) != 0.0
        case _:
            return False


def _is_number(expression: Expression) -> bool:
    return not any(walk(expression, Variable, Call))


def affine(expression: Expression) -> Affine:
    """The multiples of signals and the number whose sum an affine expression is."""
    return fold(expression, _affine)


def _affine(node: Expression, operands: Sequence[Affine]) -> Affine:
    match node, operands:
        case Number(value) | Constant(number=Number(value)), _:
            return {}, decimal(value)
        case Variable(signal), _:
            return {signal: Fraction(1)}, Fraction(0)
        case Negative(), (operand,):
            return _scaled(operand, Fraction(-1))
        case Arithmetic(operator="*"), (one, other):
            return _scaled(one, other[1]) if not other[0] else _scaled(other, one[1])
        case Arithmetic(operator="/"), (one, (_, divisor)):
            return _scaled(one, 1 / divisor if divisor else Fraction(0))
        case Arithmetic(operator=symbol), (one, other):
            other = _scaled(other, Fraction(1 if symbol == "+" else -1))
            names = {*one[0], *other[0]}
            multiples = {
                name: one[0].get(name, Fraction(0)) + other[0].get(name, Fraction(0)) for name in names
            }
            return multiples, one[1] + other[1]
        case _:
            raise TypeError(f"{node} is not affine")


def _scaled(terms: Affine, by: Fraction) -> Affine:
    return {signal: by * multiple for signal, multiple in terms[0].items()}, by * terms[1]


def cut_of(comparison: Comparison, signals: Sequence[str]) -> tuple[object, bool]:
    """A name for the cut that a comparison makes, equal for `x > 0`, `0 >= x` and `2 * x > 0`; and its side.

    The cut is `sum of multiples of signals > number` or the same with `>=`, the first multiple being 1, and
    `x <= 0` is the other side of `x > 0`. With abs, min or max in it, a comparison shares its cut only with
    those of the same two sides.
    """
    if not (is_affine(comparison.left) and is_affine(comparison.right)):
        upper = comparison.relation in (">", ">=")
        return (str(comparison.left), str(comparison.right), upper == (comparison.relation in "<>")), upper
    multiples, number = affine(Arithmetic(comparison.left, "-", comparison.right))
    ordered = [(signal, multiples[signal]) for signal in signals if multiples.get(signal)]
    scale = ordered[0][1] if ordered else Fraction(1)
    upwards = (comparison.relation in (">", ">=")) == (scale > 0)
    plane = (tuple((signal, multiple / scale) for signal, multiple in ordered), number / scale)
    # The plane itself is on one of its sides: > and <= leave it below, >= and < above.
    plane_is_below = (comparison.relation in (">", "<")) == upwards
    return (plane, plane_is_below), upwards


class Bound(NamedTuple):
    """A comparison that bounds a single signal."""

    signal: str
    upwards: bool
    """Whether it holds from its place on, or up to there."""
    place: tuple[Fraction, bool]
    """A number, and whether the place is just beyond it: `x > 1` and `x <= 1` have their place beyond 1."""


def bound_of(predicate: Predicate) -> Bound | None:
    """A predicate as a bound; `None` for one that is not an affine comparison of one signal."""
    if not (isinstance(predicate, Comparison) and is_affine(predicate.left) and is_affine(predicate.right)):
        return None
    multiples, number = affine(Arithmetic(predicate.left, "-", predicate.right))
    used = [(signal, multiple) for signal, multiple in multiples.items() if multiple]
    if len(used) != 1:
        return None
    signal, multiple = used[0]
    upwards = (predicate.relation in (">", ">=")) == (multiple > 0)
    return Bound(signal, upwards, (-number / multiple, (predicate.relation in "<>") == upwards))


def tightest(predicates: Sequence[Predicate]) -> list[Predicate]:
    """The predicates without the bounds of signals that a tighter one among them implies."""
    best: dict[tuple[str, bool], tuple[tuple[Fraction, bool], int]] = {}
    implied = set()
    for number, predicate in enumerate(predicates):
        if (bound := bound_of(predicate)) is None:
            continue
        place, other = best.get(bound[:2], (bound.place, number))
        if place != bound.place and (bound.place > place) == bound.upwards:
            place, other, number = bound.place, number, other
        best[bound[:2]] = place, other
        if number != other:
            implied.add(number)
    return [predicate for number, predicate in enumerate(predicates) if number not in implied]


def cells_of_bounds(bounds: Sequence[Bound]) -> Iterator[tuple[bool, ...]]:
    """For which sides of different bounds there is a state: the products of the intervals of the signals."""
    along: dict[str, list[int]] = {}
    for number in sorted(range(len(bounds)), key=lambda number: bounds[number].place):
        along.setdefault(bounds[number].signal, []).append(number)
    for passed in itertools.product(*(range(len(numbers) + 1) for numbers in along.values())):
        beyond = {one for numbers, many in zip(along.values(), passed, strict=True) for one in numbers[:many]}
        yield tuple((number in beyond) == bound.upwards for number, bound in enumerate(bounds))
