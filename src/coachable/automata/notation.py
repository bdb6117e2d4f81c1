"""Predicates and signals in the letters of a paper: `dtheta_1 <= 0` becomes θ̇₁ ≤ 0."""

from __future__ import annotations

import re

from coachable.behaviours.expressions import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
)
from coachable.behaviours.predicates import All, Any, Between, Comparison, Near, Not, Phrase, Predicate

_LETTERS = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "theta": "θ",
    "phi": "φ",
    "psi": "ψ",
    "omega": "ω",
}
_NAME = re.compile(rf"(?P<dot>d?)(?P<letter>{'|'.join(_LETTERS)})(?:_(?P<index>\d+))?")
_RELATIONS = {"<": "<", "<=": "≤", ">": ">", ">=": "≥"}
DOT_ABOVE = "\u0307"
"""The combining character that makes θ̇ of θ."""

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def pretty_name(name: str) -> str:
    """`theta_1` as θ₁ and `dtheta_1` as θ̇₁; any other name as it is."""
    if not (match := _NAME.fullmatch(name)):
        return name
    dot = DOT_ABOVE if match["dot"] else ""
    return _LETTERS[match["letter"]] + dot + (match["index"] or "").translate(_SUBSCRIPTS)


def pretty_expression(expression: Expression) -> str:
    """An expression with pretty names and the signs of print; units are left out."""
    match expression:
        case Number(value):
            return f"{value:g}".replace("-", "−")
        case Variable(name) | Constant(name):
            return pretty_name(name)
        case Negative(operand):
            return f"−{_factor(operand)}"
        case Arithmetic(left, "*", right):
            return f"{_factor(left)} {_factor(right)}"
        case Arithmetic(left, "/", right):
            return f"{_factor(left)} / {_factor(right)}"
        case Arithmetic(left, "-", right):
            subtrahend = _factor(right) if _is_sum(right) else pretty_expression(right)
            return f"{pretty_expression(left)} − {subtrahend}"
        case Arithmetic(left, symbol, right):
            return f"{pretty_expression(left)} {symbol} {pretty_expression(right)}"
        case Call("abs", (argument,)):
            return f"|{pretty_expression(argument)}|"
        case Call(function, arguments):
            return f"{function}({', '.join(map(pretty_expression, arguments))})"


def pretty_predicate(predicate: Predicate) -> str:
    """A predicate with ∧, ∨ and ¬ and the signals' pretty names; phrases are spelt out."""
    match predicate:
        case Comparison(left, relation, right):
            return f"{pretty_expression(left)} {_RELATIONS[relation]} {pretty_expression(right)}"
        case Between(low, low_relation, middle, high_relation, high):
            ends = pretty_expression(low), pretty_expression(high)
            relations = _RELATIONS[low_relation], _RELATIONS[high_relation]
            return f"{ends[0]} {relations[0]} {pretty_expression(middle)} {relations[1]} {ends[1]}"
        case Near(value, target, tolerance):
            ends = pretty_expression(target), pretty_expression(tolerance)
            return f"{pretty_expression(value)} = {ends[0]} ± {ends[1]}"
        case Phrase(predicate=inner):
            return pretty_predicate(inner)
        case All(parts=parts):
            return " ∧ ".join(map(_operand, parts)) or "true"
        case Any(parts=parts):
            return " ∨ ".join(map(_operand, parts)) or "false"
        case Not(part):
            return f"¬({pretty_predicate(part)})"


def _operand(predicate: Predicate) -> str:
    while isinstance(predicate, Phrase):
        predicate = predicate.predicate
    text = pretty_predicate(predicate)
    return f"({text})" if isinstance(predicate, All | Any) and len(predicate.parts) > 1 else text


def _factor(expression: Expression) -> str:
    text = pretty_expression(expression)
    return f"({text})" if isinstance(expression, Arithmetic | Negative) else text


def _is_sum(expression: Expression) -> bool:
    return isinstance(expression, Arithmetic) and expression.operator in "+-"
