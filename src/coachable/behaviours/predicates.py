"""Predicates over named signals: comparisons with a constant, joined by and, or and not.

A predicate is a frozen value. It says nothing about where its signals come from, so one description serves a
plain mapping of floats, NumPy arrays and traced JAX arrays alike.
"""

from __future__ import annotations

import math
import operator
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from types import MappingProxyType

from coachable.errors import BehaviourError

OPERATORS: Mapping[str, Callable] = MappingProxyType(
    {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
)
"""What each relation means: the only such table in the library."""

_OPPOSITE: Mapping[str, str] = MappingProxyType({"<": ">=", "<=": ">", ">": "<=", ">=": "<"})


@dataclass(frozen=True)
class Signal:
    """A named number that a behaviour talks about.

    **Arguments:** `name`, a Python identifier; `unit`, such as `"rad/s"`; `description`, one line.

    **Raises:** `BehaviourError` if the name is not an identifier:
    it could not be written in a predicate.
    """

    name: str
    unit: str = ""
    description: str = ""

    def __post_init__(self):
        if not self.name.isidentifier():
            raise BehaviourError(
                f"signal {self.name!r}: a name is made of letters, digits and underscores, no digit first"
            )

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Comparison:
    """`signal relation bound`, such as `theta_1 > 0`; the bound is in the signal's unit.

    **Raises:** `BehaviourError` for an unknown relation or a bound that is not a finite number.
    """

    signal: str
    relation: str
    bound: int | float

    def __post_init__(self):
        if self.relation not in OPERATORS:
            known = " ".join(OPERATORS)
            raise BehaviourError(f"{self.signal}: unknown relation {self.relation!r}; use one of {known}")
        if not math.isfinite(self.bound):
            raise BehaviourError(
                f"{self.signal} {self.relation} {self.bound!r}: the bound must be a finite number"
            )
        # Adding 0.0 turns −0.0 into 0.0: the two mean the same and must print, compare and hash the same.
        object.__setattr__(self, "bound", float(self.bound) + 0.0)

    def __str__(self) -> str:
        return f"{self.signal} {self.relation} {repr(self.bound).removesuffix('.0')}"


@dataclass(frozen=True, init=False)
class All:
    """Holds where every part holds; without parts, everywhere."""

    parts: tuple[Predicate, ...]

    def __init__(self, *parts: Predicate):
        object.__setattr__(self, "parts", parts)

    def __str__(self) -> str:
        return " and ".join(map(_operand, self.parts)) or "true"


@dataclass(frozen=True, init=False)
class Any:
    """Holds where at least one part holds; without parts, nowhere."""

    parts: tuple[Predicate, ...]

    def __init__(self, *parts: Predicate):
        object.__setattr__(self, "parts", parts)

    def __str__(self) -> str:
        return " or ".join(map(_operand, self.parts)) or "false"


@dataclass(frozen=True)
class Not:
    """Holds where its part does not."""

    part: Predicate

    def __str__(self) -> str:
        return f"not ({self.part})"


Predicate = Comparison | All | Any | Not


def _operand(predicate: Predicate) -> str:
    return f"({predicate})" if isinstance(predicate, All | Any) else str(predicate)


def holds(predicate: Predicate, values: Mapping[str, typing.Any]) -> typing.Any:
    """Whether the predicate holds at the given signal values.

    The values may be floats or arrays of any library with elementwise `<`, `&`, `|` and `^`; for floats
    the answer is a `bool`, for arrays an array of booleans. Comparisons with NaN are false, as in IEEE
    754, and so a `Not` around one is true: whoever needs a NaN to mean "nowhere" says so, as
    `Behaviour.phase_at` does.

    **Raises:** `KeyError` for a signal without a value.
    """
    match predicate:
        case Comparison(signal, relation, bound):
            return OPERATORS[relation](values[signal], bound)
        case All(parts=parts):
            return reduce(operator.and_, (holds(part, values) for part in parts), True)
        case Any(parts=parts):
            return reduce(operator.or_, (holds(part, values) for part in parts), False)
        case Not(part):
            # `~` would turn Python's True into −2; exclusive or negates Python's and every array's booleans.
            return holds(part, values) ^ True


def signals_of(predicate: Predicate) -> tuple[str, ...]:
    """The names of the signals a predicate reads, each once, in the order of their first appearance."""
    match predicate:
        case Comparison(signal):
            return (signal,)
        case Not(part):
            return signals_of(part)
        case All(parts=parts) | Any(parts=parts):
            return tuple(dict.fromkeys(name for part in parts for name in signals_of(part)))


def normal_form(predicate: Predicate) -> Predicate:
    """An equivalent predicate that does not depend on the order, nesting or repetition of its parts.

    Negations are pushed into the comparisons (`not (x > 0)` becomes `x <= 0`, which is the same for every
    number but NaN), nested conjunctions and disjunctions are flattened, and parts are sorted and kept
    once. Equal normal forms mean equal predicates; the converse does not hold, for that is a question for
    a solver.
    """
    match predicate:
        case Comparison():
            return predicate
        case Not(part):
            return normal_form(_opposite(part))
        case All(parts=parts) | Any(parts=parts):
            kind = type(predicate)
            flat = set()
            for part in map(normal_form, parts):
                flat.update(part.parts if isinstance(part, kind) else [part])
            return flat.pop() if len(flat) == 1 else kind(*sorted(flat, key=str))


def _opposite(predicate: Predicate) -> Predicate:
    match predicate:
        case Comparison(signal, relation, bound):
            return Comparison(signal, _OPPOSITE[relation], bound)
        case Not(part):
            return part
        case All(parts=parts):
            return Any(*map(Not, parts))
        case Any(parts=parts):
            return All(*map(Not, parts))
