"""Equivalent forms of predicates, and the wider predicate that deadbands denote."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from coachable.behaviours.expressions import Arithmetic, Constant, Number
from coachable.behaviours.predicates import (
    MIRRORED,
    All,
    Any,
    Between,
    Comparison,
    Near,
    Not,
    Phrase,
    Predicate,
    comparisons_of,
)
from coachable.behaviours.tree import Node, children, rebuilt, rewritten

_OPPOSITE: Mapping[str, str] = MappingProxyType({"<": ">=", "<=": ">", ">": "<=", ">=": "<"})


def unwrapped(predicate: Predicate) -> Predicate:
    """The same predicate without `All` or `Any` around a single part, which has the same text as the part."""

    def single_part(node: Node) -> Predicate | None:
        match node:
            case All(parts=(part,)) | Any(parts=(part,)):
                return unwrapped(part)

    return rewritten(predicate, single_part)


def expanded(predicate: Predicate) -> Predicate:
    """The same predicate in comparisons, `All`, `Any` and `Not` alone: phrases and ranges spelt out."""

    def spelt_out(node: Node) -> Predicate | None:
        match node:
            case Comparison():
                return node
            case Between() | Near():
                return All(*comparisons_of(node))
            case Phrase(predicate=inner):
                return expanded(inner)

    return rewritten(predicate, spelt_out)


def widened(predicate: Predicate) -> Predicate:
    """The predicate of staying: every comparison with a deadband holds that much farther.

    `x > 0 deadband 0.1` becomes `x > 0 - 0.1`; inside a `Not`, where holding farther means to fail farther,
    it becomes `x > 0 + 0.1`. A predicate without deadbands stays equal to its expanded self.
    """
    return _shifted(expanded(predicate), outwards=True)


def _shifted(predicate: Predicate, outwards: bool) -> Predicate:
    if isinstance(predicate, Comparison):
        if predicate.deadband is None:
            return predicate
        symbol = "-" if (predicate.relation in (">", ">=")) == outwards else "+"
        return Comparison(
            predicate.left, predicate.relation, Arithmetic(predicate.right, symbol, predicate.deadband)
        )
    inner = outwards != isinstance(predicate, Not)
    return rebuilt(predicate, [_shifted(part, inner) for part in children(predicate)])


def without_negations(predicate: Predicate) -> Predicate:
    """The same predicate without `Not`, except where a comparison with NaN is neither true nor false.

    **Arguments:** `predicate`: without phrases and ranges, as from `expanded`.
    """

    def pushed_inwards(node: Node) -> Predicate | None:
        return without_negations(_opposite(node.part)) if isinstance(node, Not) else None

    return rewritten(predicate, pushed_inwards)


def conjuncts(predicate: Predicate) -> tuple[Predicate, ...]:
    """The parts that must all hold, in their order; phrases and ranges spelt out, negations inwards."""
    match expanded(predicate):
        case All(parts=parts):
            return tuple(dict.fromkeys(inner for part in parts for inner in conjuncts(part)))
        case Not(part):
            opposite = _opposite(part)
            return conjuncts(opposite) if isinstance(opposite, All | Not) else (opposite,)
        case other:
            return (other,)


def normal_form(predicate: Predicate) -> Predicate:
    """An equivalent predicate that does not depend on the order, nesting or repetition of its parts.

    Phrases, ranges and named constants are spelt out, units dropped, negations are pushed into the
    comparisons (`not (x > 0)` becomes `x <= 0`, which is the same for every number but NaN), a number on the
    left goes to the right, nested conjunctions and disjunctions are flattened, and parts are sorted and kept
    once. Equal normal forms mean equal predicates; the converse does not hold, for that is a question for a
    solver.
    """
    return _sorted(without_negations(expanded(predicate)))


def _sorted(predicate: Predicate) -> Predicate:
    match predicate:
        case Comparison(left, relation, right, deadband):
            left, right = rewritten(left, _bare), rewritten(right, _bare)
            deadband = Number(deadband.value) if deadband is not None and deadband.value else None
            if isinstance(left, Number) and not isinstance(right, Number):
                left, relation, right = right, MIRRORED[relation], left
            return Comparison(left, relation, right, deadband)
        case All(parts=parts) | Any(parts=parts):
            kind = type(predicate)
            flat = set()
            for part in map(_sorted, parts):
                flat.update(part.parts if isinstance(part, kind) else [part])
            return flat.pop() if len(flat) == 1 else kind(*sorted(flat, key=str))
        case _:
            raise TypeError(f"{predicate!r} is not expanded")


def _bare(node: Node) -> Number | None:
    match node:
        case Number(value) | Constant(number=Number(value)):
            return Number(value)


def _opposite(predicate: Predicate) -> Predicate:
    match predicate:
        case Comparison(left, relation, right, deadband):
            return Comparison(left, _OPPOSITE[relation], right, deadband)
        case Not(part):
            return part
        case All(parts=parts):
            return Any(*map(Not, parts))
        case Any(parts=parts):
            return All(*map(Not, parts))
        case _:
            raise TypeError(f"{predicate!r} is not expanded")
