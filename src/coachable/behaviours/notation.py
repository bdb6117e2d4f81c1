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
from coachable.behaviours.rewriting import conjuncts

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
        case Arithmetic(left, "*", right) if left == right and isinstance(left, Variable | Constant):
            return f"{_factor(left)}²"
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
    """A predicate with ∧, ∨ and ¬ and the signals' pretty names; phrases are expanded."""
    match predicate:
        case Comparison(left, relation, right):
            right_side = pretty_expression(right) + pretty_deadband(predicate.deadband)
            return f"{pretty_expression(left)} {_RELATIONS[relation]} {right_side}"
        case Between(low, low_relation, middle, high_relation, high):
            ends = pretty_expression(low), pretty_expression(high) + pretty_deadband(predicate.deadband)
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
            opposite = conjuncts(predicate)
            simple = len(opposite) == 1 and isinstance(opposite[0], Comparison)
            return pretty_predicate(opposite[0]) if simple else f"¬({pretty_predicate(part)})"


def conditions(predicate: Predicate) -> tuple[Predicate, ...]:
    """The parts that must all hold, in their order, ranges left whole: one line each in a picture."""
    match predicate:
        case Phrase(predicate=inner):
            return conditions(inner)
        case All(parts=parts):
            return tuple(dict.fromkeys(inner for part in parts for inner in conditions(part)))
        case Not():
            opposite = conjuncts(predicate)
            return opposite if opposite and not isinstance(opposite[0], Any) else (predicate,)
        case _:
            return (predicate,)


def phrases(predicate: Predicate) -> tuple[str, ...]:
    """The same as phrases, where the predicate is written in phrases."""
    match predicate:
        case All(parts=parts):
            return tuple(dict.fromkeys(inner for part in parts for inner in phrases(part)))
        case Phrase(words) | Not(Phrase(words)):
            return (words if isinstance(predicate, Phrase) else f"not {words}",)
        case Any(parts=parts) if all(isinstance(part, Phrase | Not) for part in parts):
            return (" or ".join(words for part in parts for words in phrases(part)),)
        case _:
            return tuple(map(pretty_predicate, conditions(predicate)))


def pretty_deadband(deadband: Number | None) -> str:
    """A deadband, behind the bound that it softens: `(±0.01)`."""
    return "" if deadband is None else f" (±{pretty_expression(deadband)})"


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
