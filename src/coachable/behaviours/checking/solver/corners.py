"""abs, min and max, taken apart into the cases that they stand for."""

from __future__ import annotations

from coachable.behaviours.expressions import Arithmetic, Call, Expression, Negative, subexpressions
from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate

_SMOOTH = ("sin", "cos")
_MOST = 6
"""How many cases are told apart in one comparison; their number doubles with each."""


def without_corners(predicate: Predicate) -> Predicate:
    """The same predicate without abs, min and max: `abs(x) > 1` is `x >= 0 and x > 1 or x < 0 and -x > 1`.

    A comparison with very many of them is left as it is.

    **Arguments:** `predicate`: spelt out by `expanded`.
    """
    match predicate:
        case Comparison(left, relation, right):
            parts = subexpressions(Arithmetic(left, "-", right))
            corners = [part for part in parts if isinstance(part, Call) and part.function not in _SMOOTH]
            if not corners or sum(max(1, len(part.arguments) - 1) for part in corners) > _MOST:
                return predicate
            corner = corners[0]
            one, other, decides = _cases(corner)
            cases = [
                Comparison(_replaced(left, corner, value), relation, _replaced(right, corner, value))
                for value in (one, other)
            ]
            is_first = without_corners(Comparison(one, decides, other))
            return Any(
                All(is_first, without_corners(cases[0])), All(Not(is_first), without_corners(cases[1]))
            )
        case Not(part):
            return Not(without_corners(part))
        case All(parts=parts) | Any(parts=parts):
            return type(predicate)(*map(without_corners, parts))
        case _:
            raise TypeError(f"{predicate!r} is not expanded")


def _cases(corner: Call) -> tuple[Expression, Expression, str]:
    """The two values that a corner may have, and how the first compares with the second where it has it."""
    first, *rest = corner.arguments
    if corner.function == "abs":
        return first, Negative(first), ">="
    other = rest[0] if len(rest) == 1 else Call(corner.function, *rest)
    return first, other, "<=" if corner.function == "min" else ">="


def _replaced(expression: Expression, old: Expression, new: Expression) -> Expression:
    if expression == old:
        return new
    match expression:
        case Negative(operand):
            return Negative(_replaced(operand, old, new))
        case Arithmetic(left, symbol, right):
            return Arithmetic(_replaced(left, old, new), symbol, _replaced(right, old, new))
        case Call(function, arguments):
            return Call(function, *(_replaced(argument, old, new) for argument in arguments))
        case _:
            return expression
