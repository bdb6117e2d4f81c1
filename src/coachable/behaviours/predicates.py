"""Predicates over named signals: comparisons of expressions, joined by and, or and not.

A predicate is a frozen value. It does not depend on the source of its signals, so one description serves a
plain mapping of floats, NumPy arrays and traced JAX arrays alike.
"""

from __future__ import annotations

import operator
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from coachable.behaviours.expressions import (
    Arithmetic,
    Constant,
    Expression,
    Floats,
    Number,
    Values,
    Variable,
    applied,
    compiled,
    expression_of,
)
from coachable.behaviours.names import flaw_of_name, flaw_of_unit, flaw_of_word
from coachable.behaviours.tree import Node, children, walk
from coachable.foundation.errors import BehaviourError

OPERATORS: Mapping[str, Callable] = MappingProxyType(
    {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
)
"""The function of each relation: the only such table in the library."""

MIRRORED: Mapping[str, str] = MappingProxyType({"<": ">", "<=": ">=", ">": "<", ">=": "<="})
"""The same relation with its sides exchanged."""


@dataclass(frozen=True)
class Signal:
    """A named number that a behaviour refers to.

    **Arguments:** `name`, a Python identifier; `unit`, such as `"rad/s"`; `description`, one line;
    `derivative_of`, the name of the signal whose derivative in time this one is, if it is one.

    **Raises:** `BehaviourError` for a name that could not be written in a predicate, or a unit that could not
    be written in brackets.
    """

    name: str
    unit: str = ""
    description: str = ""
    derivative_of: str | None = None

    def __post_init__(self):
        if flaw := flaw_of_name(self.name) or flaw_of_unit(self.unit):
            raise BehaviourError(f"signal {self.name!r}: {flaw}")

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, init=False)
class Comparison(Node):
    """`left relation right`, such as `theta_1 > 0`; both sides are in one unit.

    A `deadband`, in that unit, keeps a phase from flickering at the boundary: once in the phase, a
    trajectory leaves it only where the comparison fails by more than the deadband. That takes memory, so
    `holds` ignores it; see `widened`.

    **Arguments:** a name stands for a signal and a plain number for a `Number`.

    **Raises:** `BehaviourError` for an unknown relation, a number that is not finite, or a negative deadband.
    """

    CHILDREN = ("left", "right")

    left: Expression
    relation: str
    right: Expression
    deadband: Number | None

    def __init__(
        self,
        left: Expression | str | int | float,
        relation: str,
        right: Expression | str | int | float,
        deadband: Number | int | float | None = None,
    ):
        if relation not in OPERATORS:
            known = " ".join(OPERATORS)
            raise BehaviourError(f"{left}: unknown relation {relation!r}; use one of {known}")
        for field, value in (("left", left), ("right", right)):
            try:
                object.__setattr__(self, field, expression_of(value))
            except BehaviourError:
                raise BehaviourError(
                    f"{left} {relation} {right!r}: the bound must be a finite number"
                ) from None
        object.__setattr__(self, "relation", relation)
        object.__setattr__(self, "deadband", _deadband(deadband))

    def __str__(self) -> str:
        return f"{self.left} {self.relation} {self.right}{_deadband_text(self.deadband)}"


@dataclass(frozen=True, init=False)
class Between(Node):
    """`low relation middle relation high`, such as `0.1 < x <= 0.3`; both relations are < or <=.

    **Raises:** `BehaviourError` for another relation.
    """

    CHILDREN = ("low", "middle", "high")

    low: Expression
    low_relation: str
    middle: Expression
    high_relation: str
    high: Expression
    deadband: Number | None

    def __init__(
        self,
        low: Expression | str | int | float,
        low_relation: str,
        middle: Expression | str | int | float,
        high_relation: str,
        high: Expression | str | int | float,
        deadband: Number | int | float | None = None,
    ):
        for relation in (low_relation, high_relation):
            if relation not in ("<", "<="):
                raise BehaviourError(f"a range is written with < or <=, not with {relation!r}")
        object.__setattr__(self, "low", expression_of(low))
        object.__setattr__(self, "low_relation", low_relation)
        object.__setattr__(self, "middle", expression_of(middle))
        object.__setattr__(self, "high_relation", high_relation)
        object.__setattr__(self, "high", expression_of(high))
        object.__setattr__(self, "deadband", _deadband(deadband))

    def __str__(self) -> str:
        text = f"{self.low} {self.low_relation} {self.middle} {self.high_relation} {self.high}"
        return text + _deadband_text(self.deadband)


@dataclass(frozen=True, init=False)
class Near(Node):
    """`value = target within tolerance`: |value − target| ≤ tolerance."""

    CHILDREN = ("value", "target", "tolerance")

    value: Expression
    target: Expression
    tolerance: Expression

    def __init__(
        self,
        value: Expression | str | int | float,
        target: Expression | str | int | float,
        tolerance: Expression | str | int | float,
    ):
        object.__setattr__(self, "value", expression_of(value))
        object.__setattr__(self, "target", expression_of(target))
        object.__setattr__(self, "tolerance", expression_of(tolerance))

    def __str__(self) -> str:
        return f"{self.value} = {self.target} within {self.tolerance}"


@dataclass(frozen=True)
class Phrase(Node):
    """A predicate under a name of several words; it prints as the words.

    **Raises:** `BehaviourError` if `words` are not words with single spaces between them, or one of them is a
    word of the language, such as `and`.
    """

    CHILDREN = ("predicate",)

    words: str
    predicate: Predicate

    def __post_init__(self):
        if not self.words or self.words != " ".join(self.words.split()):
            raise BehaviourError(f"phrase {self.words!r}: write words with single spaces between them")
        for word in self.words.split(" "):
            if flaw := flaw_of_word(word):
                raise BehaviourError(f"phrase {self.words!r}: {flaw}")

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True, init=False)
class All(Node):
    """Holds where every part holds; without parts, everywhere."""

    CHILDREN = ("parts",)

    parts: tuple[Predicate, ...]

    def __init__(self, *parts: Predicate):
        object.__setattr__(self, "parts", parts)

    def __str__(self) -> str:
        return " and ".join(map(_operand, self.parts)) or "true"


@dataclass(frozen=True, init=False)
class Any(Node):
    """Holds where at least one part holds; without parts, nowhere."""

    CHILDREN = ("parts",)

    parts: tuple[Predicate, ...]

    def __init__(self, *parts: Predicate):
        object.__setattr__(self, "parts", parts)

    def __str__(self) -> str:
        return " or ".join(map(_operand, self.parts)) or "false"


@dataclass(frozen=True)
class Not(Node):
    """Holds where its part does not."""

    CHILDREN = ("part",)

    part: Predicate

    def __str__(self) -> str:
        return f"not {self.part}" if isinstance(self.part, Phrase) else f"not ({self.part})"


Predicate = Comparison | Between | Near | Phrase | All | Any | Not

Decision = Callable[[typing.Any], typing.Any]
"""From the signals' values, by name or in a row, to whether a predicate holds there."""


def _operand(predicate: Predicate) -> str:
    return f"({predicate})" if isinstance(predicate, All | Any) else str(predicate)


def _deadband(deadband: Number | int | float | None) -> Number | None:
    number = Number(deadband) if isinstance(deadband, int | float) else deadband
    if number is not None and number.value < 0:
        raise BehaviourError(f"a deadband of {number} is negative")
    return number


def _deadband_text(deadband: Number | None) -> str:
    return "" if deadband is None else f" deadband {deadband}"


def holds(predicate: Predicate, values: Values, functions: typing.Any = Floats) -> typing.Any:
    """Whether the predicate holds at the given signal values; deadbands play no part.

    The values may be floats or arrays of any library with elementwise `<`, `&`, `|` and `^`; for floats
    the answer is a `bool`, for arrays an array of booleans. Comparisons with NaN are false, as in IEEE
    754, and so a `Not` around one is true: callers that put a NaN outside all phases test for it, as
    `Behaviour.phase_at` does. `functions` is as in `evaluate`.

    **Raises:** `KeyError` for a signal without a value.
    """
    return decision(predicate, functions)({name: values[name] for name in signals_of(predicate)})


def decision(
    predicate: Predicate,
    functions: typing.Any = Floats,
    places: Mapping[str, int] = MappingProxyType({}),
) -> Decision:
    """A predicate as a function of the signals' values, for repeated evaluation.

    `functions` is as in `evaluate`, `places` as in `compiled`. For floats, evaluation stops once the result
    is decided, so a missing value need not raise.
    """
    match predicate:
        case Comparison(left=left, relation=relation, right=right):
            sides = (compiled(side, functions, places) for side in (left, right))
            answer = applied(OPERATORS[relation], *sides)
            return answer if callable(answer) else lambda values: answer
        case Between() | Near():
            return decision(All(*comparisons_of(predicate)), functions, places)
        case Phrase(predicate=inner):
            return decision(inner, functions, places)
        case All() | Any():
            parts = flattened(type(predicate), predicate)
            decisions = [decision(part, functions, places) for part in parts]
            return _in_turn(operator.and_ if isinstance(predicate, All) else operator.or_, decisions)
        case Not(part):
            # `~` would turn Python's True into −2; exclusive or negates Python's and every array's booleans.
            return applied(partial(operator.xor, True), decision(part, functions, places))


def flattened(kind: type[All | Any], predicate: Predicate) -> Iterator[Predicate]:
    """The parts of a conjunction, or of a disjunction, with those nested in it, also inside phrases."""
    if isinstance(predicate, (kind, Phrase)):
        for part in children(predicate):
            yield from flattened(kind, part)
    else:
        yield predicate


def _in_turn(join: Callable, decisions: Sequence[Decision]) -> Decision:
    """Decisions joined by `and` or `or`; for floats, the first decisive one ends the evaluation."""
    if len(decisions) == 1:
        return decisions[0]
    neutral = join is operator.and_
    # Only a Python boolean can be decisive: arrays are evaluated to the end.
    decisive = not neutral

    def decide(values: typing.Any) -> typing.Any:
        answer = neutral
        for one in decisions:
            answer = join(answer, one(values))
            if answer is decisive:
                break
        return answer

    return decide


def constants_of(predicate: Predicate) -> tuple[Constant, ...]:
    """The named constants in a predicate, each once, in the order of their first appearance."""
    return tuple(dict.fromkeys(walk(predicate, Constant)))


def phrases_of(predicate: Predicate) -> tuple[Phrase, ...]:
    """The phrases in a predicate, each once, every one after those that it is made of."""
    return tuple(dict.fromkeys(reversed(list(walk(predicate, Phrase)))))


def comparisons_of(predicate: Comparison | Between | Near) -> tuple[Comparison, ...]:
    """The comparisons that hold together where the predicate does."""
    match predicate:
        case Comparison():
            return (predicate,)
        case Between(low, low_relation, middle, high_relation, high, deadband):
            return (
                Comparison(middle, MIRRORED[low_relation], low, deadband),
                Comparison(middle, high_relation, high, deadband),
            )
        case Near(value, target, tolerance):
            return (
                Comparison(value, ">=", Arithmetic(target, "-", tolerance)),
                Comparison(value, "<=", Arithmetic(target, "+", tolerance)),
            )


def signals_of(predicate: Predicate) -> tuple[str, ...]:
    """The names of the signals a predicate reads, each once, in the order of their first appearance."""
    return tuple(dict.fromkeys(node.signal for node in walk(predicate, Variable)))
