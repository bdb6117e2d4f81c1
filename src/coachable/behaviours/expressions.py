"""Expressions over named signals: numbers, signals, named constants and arithmetic.

An expression is a frozen value. Units are for the reader and the checker: evaluation is arithmetic on the
numbers as they are written, without conversion.
"""

from __future__ import annotations

import math
import operator
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial, reduce
from types import MappingProxyType

from coachable.behaviours.names import flaw_of_name, flaw_of_unit
from coachable.behaviours.tree import Node, fold
from coachable.foundation.errors import BehaviourError


@dataclass(frozen=True)
class Number(Node):
    """A number as it is written, with the unit behind it if there is one.

    **Raises:** `BehaviourError` if it is not finite, or if its unit cannot be written in brackets.
    """

    value: int | float
    unit: str = ""

    def __post_init__(self):
        if flaw := flaw_of_unit(self.unit):
            raise BehaviourError(f"unit {self.unit!r}: {flaw}")
        if not math.isfinite(self.value):
            raise BehaviourError(f"{self.value!r} is not a finite number")
        # Adding 0.0 turns −0.0 into 0.0: the two mean the same and must print, compare and hash the same.
        object.__setattr__(self, "value", float(self.value) + 0.0)

    def __str__(self) -> str:
        return repr(self.value).removesuffix(".0") + (f" [{self.unit}]" if self.unit else "")


@dataclass(frozen=True)
class Variable(Node):
    """The value of a signal."""

    signal: str

    def __str__(self) -> str:
        return self.signal


@dataclass(frozen=True)
class Constant(Node):
    """A number with a name, such as `max_lean = 0.3 [rad]`; it prints as its name.

    **Raises:** `BehaviourError` for a name that could not be written in an expression.
    """

    name: str
    number: Number
    description: str = ""

    def __post_init__(self):
        if flaw := flaw_of_name(self.name):
            raise BehaviourError(f"constant {self.name!r}: {flaw}")

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Negative(Node):
    """The negative of its operand."""

    CHILDREN = ("operand",)

    operand: Expression

    def __str__(self) -> str:
        # Parentheses keep −(0.5), an operation, apart from the number −0.5.
        plain = isinstance(self.operand, Variable | Constant | Call)
        return f"-{self.operand}" if plain else f"-({self.operand})"


@dataclass(frozen=True)
class Arithmetic(Node):
    """`left operator right`, with one of + - * /; division by zero gives an infinity or NaN, as in IEEE 754.

    **Raises:** `BehaviourError` for an unknown operator.
    """

    CHILDREN = ("left", "right")

    left: Expression
    operator: str
    right: Expression

    def __post_init__(self):
        if self.operator not in _ARITHMETIC:
            raise BehaviourError(f"unknown operator {self.operator!r}; use one of {' '.join(_ARITHMETIC)}")

    def __str__(self) -> str:
        left, right = str(self.left), str(self.right)
        if isinstance(self.left, Arithmetic) and _rank(self.left) < _rank(self):
            left = f"({left})"
        if isinstance(self.right, Arithmetic) and _rank(self.right) <= _rank(self):
            right = f"({right})"
        return f"{left} {self.operator} {right}"


@dataclass(frozen=True, init=False)
class Call(Node):
    """`function(arguments)`: sin, cos and abs of one argument, min and max of two or more.

    **Raises:** `BehaviourError` for an unknown function or the wrong number of arguments.
    """

    CHILDREN = ("arguments",)

    function: str
    arguments: tuple[Expression, ...]

    def __init__(self, function: str, *arguments: Expression):
        if function not in FUNCTIONS:
            raise BehaviourError(f"unknown function {function!r}; use one of {' '.join(FUNCTIONS)}")
        fewest, most = (2, math.inf) if function in ("min", "max") else (1, 1)
        if not fewest <= len(arguments) <= most:
            wanted = "two or more arguments" if fewest == 2 else "one argument"
            raise BehaviourError(f"{function} takes {wanted}, not {len(arguments)}")
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "arguments", arguments)

    def __str__(self) -> str:
        return f"{self.function}({', '.join(map(str, self.arguments))})"


Expression = Number | Variable | Constant | Negative | Arithmetic | Call


def _divide(left: typing.Any, right: typing.Any) -> typing.Any:
    if isinstance(left, float) and isinstance(right, float) and right == 0.0:
        # Python refuses where IEEE 754, and so every array library, answers.
        if left == 0.0 or math.isnan(left):
            return math.nan
        return math.copysign(math.inf, left) * math.copysign(1.0, right)
    return left / right


_ARITHMETIC: Mapping[str, Callable] = MappingProxyType(
    {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": _divide}
)

FUNCTIONS: Mapping[str, str] = MappingProxyType(
    {"sin": "sin", "cos": "cos", "abs": "abs", "min": "minimum", "max": "maximum"}
)
"""The name of each function in NumPy, JAX and torch: the only such table in the library."""


class Floats:
    """The functions on plain floats, under their names in the array libraries."""

    @staticmethod
    def sin(x: float) -> float:
        """Sine of x [rad]; NaN at an infinity."""
        return math.sin(x) if math.isfinite(x) else math.nan

    @staticmethod
    def cos(x: float) -> float:
        """Cosine of x [rad]; NaN at an infinity."""
        return math.cos(x) if math.isfinite(x) else math.nan

    @staticmethod
    def abs(x: float) -> float:
        """|x|."""
        return abs(x)

    @staticmethod
    def minimum(x: float, y: float) -> float:
        """The lesser of two numbers, y if they are equal as zeros are; NaN if either is."""
        return x if x < y or math.isnan(x) else y

    @staticmethod
    def maximum(x: float, y: float) -> float:
        """The greater of two numbers, y if they are equal as zeros are; NaN if either is."""
        return x if x > y or math.isnan(x) else y


Values = Mapping[str, typing.Any]
"""The signals by name: floats, or arrays of any one library."""


def evaluate(expression: Expression, values: Values, functions: typing.Any = Floats) -> typing.Any:
    """The value of an expression at the given signal values.

    **Arguments:** `values`: floats, or arrays of any one library; `functions`: the namespace with
    the functions of `FUNCTIONS`: `numpy`, `jax.numpy`, `torch`; for plain floats it can be left out.

    **Raises:** `KeyError` for a signal without a value.
    """
    value = compiled(expression, functions)
    return value(values) if callable(value) else value


def compiled(
    expression: Expression,
    functions: typing.Any = Floats,
    places: Mapping[str, int] = MappingProxyType({}),
) -> float | Callable[[typing.Any], typing.Any]:
    """An expression as a function of the signals' values, for repeated evaluation.

    **Arguments:** `places`: where in a row each signal's value is, for values that come in a row.

    **Returns:** a function of the signals' values; for an expression of numbers alone, its value, which does
    not depend on the library.
    """

    def call(function: str, *operands: typing.Any) -> typing.Any:
        numbers = not any(map(callable, operands))
        return applied(getattr(Floats if numbers else functions, FUNCTIONS[function]), *operands)

    def value(node: Expression, operands: list[typing.Any]) -> typing.Any:
        match node:
            case Number(number) | Constant(number=Number(number)):
                return number
            case Variable(signal):
                return operator.itemgetter(places.get(signal, signal))
            case Negative():
                return applied(operator.neg, *operands)
            case Arithmetic(operator=symbol):
                return applied(_ARITHMETIC[symbol], *operands)
            case Call(function) if len(operands) > 1:
                return reduce(partial(call, function), operands)
            case Call(function):
                return call(function, *operands)

    return fold(expression, value)


def applied(operation: Callable, *operands: typing.Any) -> typing.Any:
    """An operation of one or two operands, each of them a number or a function of the signals' values."""
    match [(operand, callable(operand)) for operand in operands]:
        case [(x, True)]:
            return lambda values: operation(x(values))
        case [(x, True), (y, True)]:
            return lambda values: operation(x(values), y(values))
        case [(x, True), (y, False)]:
            return lambda values: operation(x(values), y)
        case [(x, False), (y, True)]:
            return lambda values: operation(x, y(values))
        case _:
            return operation(*operands)


def expression_of(value: Expression | str | int | float) -> Expression:
    """A name as a `Variable`, a number as a `Number`, an expression as it is."""
    match value:
        case str():
            return Variable(value)
        case int() | float():
            return Number(value)
        case _:
            return value


def _rank(expression: Arithmetic) -> int:
    return 1 if expression.operator in "+-" else 2
