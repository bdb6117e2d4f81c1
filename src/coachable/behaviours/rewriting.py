"""Predicates in other forms that mean the same, and the wider one that deadbands mean."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from coachable.behaviours.expressions import Arithmetic, Constant, Number, Variable, rewritten
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

_OPPOSITE: Mapping[str, str] = MappingProxyType({"<": ">=", "<=": ">", ">": "<=", ">=": "<"})


def unwrapped(predicate: Predicate) -> Predicate:
    """The same predicate without `All` or `Any` around a single part, which no text tells from the part."""
    match predicate:
        case All(parts=(part,)) | Any(parts=(part,)):
            return unwrapped(part)
        case All(parts=parts) | Any(parts=parts):
            return type(predicate)(*map(unwrapped, parts))
        case Not(part):
            return Not(unwrapped(part))
        case Phrase(words, inner):
            return Phrase(words, unwrapped(inner))
        case _:
            return predicate


def expanded(predicate: Predicate) -> Predicate:
    """The same predicate in comparisons, `All`, `Any` and `Not` alone: phrases and ranges spelt out."""
    match predicate:
        case Comparison():
            return predicate
        case Between() | Near():
            return All(*comparisons_of(predicate))
        case Phrase(predicate=inner):
            return expanded(inner)
        case All(parts=parts) | Any(parts=parts):
            return type(predicate)(*map(expanded, parts))
        case Not(part):
            return Not(expanded(part))


def widened(predicate: Predicate) -> Predicate:
    """The predicate of staying: every comparison with a deadband holds that much farther.

    `x > 0 deadband 0.1` becomes `x > 0 - 0.1`; inside a `Not`, where holding farther means to fail farther,
    it becomes `x > 0 + 0.1`. A predicate without deadbands stays equal to its expanded self.
    """
    return _shifted(expanded(predicate), outwards=True)


def _shifted(predicate: Predicate, outwards: bool) -> Predicate:
    match predicate:
        case Comparison(left, relation, right, deadband):
            if deadband is None:
                return predicate
            down = (relation in (">", ">=")) == outwards
            return Comparison(left, relation, Arithmetic(right, "-" if down else "+", deadband))
        case Not(part):
            return Not(_shifted(part, not outwards))
        case All(parts=parts) | Any(parts=parts):
            return type(predicate)(*(_shifted(part, outwards) for part in parts))
        case _:
            raise TypeError(f"{predicate!r} is not expanded")


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
    return _sorted(expanded(predicate))


def _sorted(predicate: Predicate) -> Predicate:
    match predicate:
        case Comparison(left, relation, right, deadband):
            left, right = rewritten(left, _bare), rewritten(right, _bare)
            deadband = Number(deadband.value) if deadband is not None and deadband.value else None
            if isinstance(left, Number) and not isinstance(right, Number):
                left, relation, right = right, MIRRORED[relation], left
            return Comparison(left, relation, right, deadband)
        case Not(part):
            return _sorted(_opposite(part))
        case All(parts=parts) | Any(parts=parts):
            kind = type(predicate)
            flat = set()
            for part in map(_sorted, parts):
                flat.update(part.parts if isinstance(part, kind) else [part])
            return flat.pop() if len(flat) == 1 else kind(*sorted(flat, key=str))
        case _:
            raise TypeError(f"{predicate!r} is not expanded")


def _bare(leaf: Number | Variable | Constant) -> Number | Variable:
    match leaf:
        case Constant(number=number):
            return Number(number.value)
        case Number(value):
            return Number(value)
        case _:
            return leaf


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
