"""abs, min and max as case distinctions."""

from __future__ import annotations

from coachable.behaviours.expressions import Call, Expression, Negative
from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate
from coachable.behaviours.tree import rewritten, walk

_SMOOTH = ("sin", "cos")
_MOST = 6
"""The most case distinctions in one comparison; each doubles the number of cases."""


def without_corners(predicate: Predicate) -> Predicate:
    """The same predicate without abs, min and max: `abs(x) > 1` is `x >= 0 and x > 1 or x < 0 and -x > 1`.

    A comparison with more than `_MOST` of them is left as it is.

    **Arguments:** `predicate`: without phrases and ranges, as from `expanded`.
    """
    return rewritten(predicate, lambda node: _taken_apart(node) if isinstance(node, Comparison) else None)


def _taken_apart(comparison: Comparison) -> Predicate:
    corners = [call for call in walk(comparison, Call) if call.function not in _SMOOTH]
    if not corners or sum(max(1, len(call.arguments) - 1) for call in corners) > _MOST:
        return comparison
    corner = corners[0]
    one, other, decides = _cases(corner)
    sides = comparison.left, comparison.right

    def where(value: Expression) -> Predicate:
        left, right = (rewritten(side, lambda node: value if node == corner else None) for side in sides)
        return _taken_apart(Comparison(left, comparison.relation, right))

    is_first = _taken_apart(Comparison(one, decides, other))
    return Any(All(is_first, where(one)), All(Not(is_first), where(other)))


def _cases(corner: Call) -> tuple[Expression, Expression, str]:
    """The two values that a corner may have, and how the first compares with the second where it has it."""
    first, *rest = corner.arguments
    if corner.function == "abs":
        return first, Negative(first), ">="
    other = rest[0] if len(rest) == 1 else Call(corner.function, *rest)
    return first, other, "<=" if corner.function == "min" else ">="
