"""Predicates and signals in the letters of a paper: `dtheta_1 <= 0` becomes θ̇₁ ≤ 0."""

from __future__ import annotations

import re

from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate

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


def pretty_predicate(predicate: Predicate) -> str:
    """A predicate with ∧, ∨ and ¬ and the signals' pretty names."""
    match predicate:
        case Comparison(signal, relation, bound):
            return f"{pretty_name(signal)} {_RELATIONS[relation]} {bound:g}".replace("-", "−")
        case All(parts=parts):
            return " ∧ ".join(map(_operand, parts)) or "true"
        case Any(parts=parts):
            return " ∨ ".join(map(_operand, parts)) or "false"
        case Not(part):
            return f"¬({pretty_predicate(part)})"


def _operand(predicate: Predicate) -> str:
    text = pretty_predicate(predicate)
    return f"({text})" if isinstance(predicate, All | Any) and len(predicate.parts) > 1 else text
