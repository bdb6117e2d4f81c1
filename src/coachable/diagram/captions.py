"""The text of a drawn automaton: in its nodes, beside its edges, and below it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from coachable.behaviours.behaviour import Behaviour, Dwell, Edge, Phase
from coachable.behaviours.expressions import Constant
from coachable.behaviours.notation import (
    conditions,
    phrases,
    pretty_expression,
    pretty_name,
    pretty_predicate,
)
from coachable.behaviours.predicates import Between, Comparison, Phrase, Predicate
from coachable.behaviours.tree import walk
from coachable.diagram.lettering import Line, text_width

RESETS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "touchdown": MappingProxyType(
            {"theta_1": "theta_2", "theta_2": "theta_1", "dtheta_1": "dtheta_1⁺", "dtheta_2": "dtheta_2⁺"}
        )
    }
)
"""The reset of each event: μ₃ of the compass walker; ⁺ marks values from the impact's equation."""

_NAME, _TITLE, _FORMULA, _WORDS, _NOTE = 24, 24, 34, 32, 96
_COLUMNS = 18.0
"""The widest that two columns of comparisons may be, in letter sizes."""

_MOST_LINES, _WIDEST = 5, 19.0
"""The most lines, and the greatest width in letter sizes, of a formula shown in place of its phrases."""

_MOST_ASSIGNMENTS = 6


def node_lines(phase: Phase, as_phrases: bool) -> list[Line]:
    """A phase: its name, its title, and its invariant as a formula or as phrases."""
    return [
        *(Line.plain("name", line) for line in balanced(phase.name, _NAME)),
        *(Line.plain("title", line) for line in balanced(phase.title, _TITLE)),
        *(_as_phrases(phase.predicate) if as_phrases else _formula(phase.predicate)),
    ]


def uses_phrases(behaviour: Behaviour) -> bool:
    """Whether the invariants are shown as phrases: all have some, and formulas would not fit."""
    predicates = [phase.predicate for phase in behaviour.phases]
    written = all(any(walk(predicate, Phrase)) for predicate in predicates)
    return written and any(
        len(_formula(predicate)) > _MOST_LINES
        or any(text_width(pretty_predicate(part)) > _WIDEST for part in conditions(predicate))
        for predicate in predicates
    )


def dwell_text(dwell: Dwell | None) -> str:
    """The dwell time of a phase, abbreviated; empty without limits."""
    if dwell is None or dwell == Dwell():
        return ""
    if math.isinf(dwell.at_most):
        return f"≥ {dwell.at_least:g} s"
    return f"{dwell.at_least:g}–{dwell.at_most:g} s" if dwell.at_least else f"≤ {dwell.at_most:g} s"


def edge_lines(
    edges: Sequence[Edge], behaviour: Behaviour, resets: Mapping[str, Mapping[str, str]]
) -> list[Line]:
    """The events of the edges that share an arrow, each with its reset."""
    lines: list[Line] = []
    for edge in sorted(edges, key=lambda edge: edge.event is None):
        changes = reset_of(edge, behaviour, resets)
        if edge.event is not None:
            lines += [Line.plain("event", line) for line in balanced(edge.event, _NAME)]
        elif len(edges) > 1:
            lines.append(Line.plain("note", "or without an event"))
        lines += _reset_lines(changes)
        if any(value.endswith("⁺") for _, value in changes):
            lines.append(Line.plain("note", "⁺ right after the impact"))
    return lines


def reset_of(
    edge: Edge, behaviour: Behaviour, resets: Mapping[str, Mapping[str, str]] = RESETS
) -> list[tuple[str, str]]:
    """The assignments on an edge in pretty letters: its own, or those of its event."""
    if edge.reset:
        return [(pretty_name(jump.signal), pretty_expression(jump.expression)) for jump in edge.reset]
    known = resets.get(edge.event, {}) if edge.event is not None else {}
    return [
        (pretty_name(name), pretty_name(value.removesuffix("⁺")) + "⁺" * value.endswith("⁺"))
        for name, value in known.items()
        if name in behaviour.signal_names
    ]


def notes(behaviour: Behaviour) -> list[Line]:
    """The notes below the picture: constants, deadbands, and the name of being outside."""
    return [Line.plain("note", line) for note in _notes(behaviour) for line in textwrap.wrap(note, _NOTE)]


def balanced(text: str, num_letters: int) -> list[str]:
    """The text in as few lines as fit, and no line longer than it must be."""
    count = len(textwrap.wrap(text, num_letters))
    widths = (width for width in range(1, num_letters) if len(textwrap.wrap(text, width)) == count)
    return textwrap.wrap(text, next(widths, num_letters))


def _notes(behaviour: Behaviour) -> Iterator[str]:
    predicates = [phase.predicate for phase in behaviour.phases]
    constants = dict.fromkeys(constant for predicate in predicates for constant in walk(predicate, Constant))
    if constants:
        values = (
            f"{pretty_name(constant.name)} = {pretty_expression(constant.number)}"
            + (f" {constant.number.unit}" if constant.number.unit else "")
            for constant in constants
        )
        yield ", ".join(values)
    compared = (part for predicate in predicates for part in walk(predicate, Comparison, Between))
    if any(part.deadband is not None for part in compared):
        yield "(±…) is a deadband: the phase is left only where its boundary is passed by more."
    if behaviour.outside is not None:
        yield f"In no phase: {behaviour.outside}."


def _as_phrases(predicate: Predicate) -> list[Line]:
    lines = []
    for phrase in phrases(predicate):
        first, *rest = textwrap.wrap(phrase, _WORDS)
        lines += [Line.plain("words", first), *(Line("words", ((0.9, line),)) for line in rest)]
    return lines


def _formula(predicate: Predicate) -> list[Line]:
    """An invariant: its conditions in two columns where they are short, else one below the other."""
    parts = conditions(predicate)
    cells = [pretty_predicate(part) for part in parts] or ["true"]
    column = max(map(text_width, cells)) + 0.9
    if len(cells) > 1 and 2 * column - 0.9 <= _COLUMNS:
        return [
            Line(
                "formula",
                tuple((column * place, cell) for place, cell in enumerate(cells[index : index + 2])),
            )
            for index in range(0, len(cells), 2)
        ]
    return [line for cell in cells for line in _broken(cell)]


def _broken(formula: str) -> list[Line]:
    """A formula in lines that fit: broken before connectives, else before relations, else anywhere."""
    pieces = [formula]
    for breaks in ("∧∨", "<≤>≥=", ""):
        pieces = [part for piece in pieces for part in _wrapped(piece, breaks)]
    first, *rest = pieces
    return [Line.plain("formula", first), *(Line("formula", ((0.9, line),)) for line in rest)]


def _wrapped(formula: str, breaks: str) -> list[str]:
    """A formula that is too long, broken before some signs; before any word if none are given."""
    if breaks:
        formula = formula.replace(" ", "\u00a0")
        for sign in breaks:
            formula = formula.replace(f"\u00a0{sign}\u00a0", f" {sign}\u00a0")
    lines = textwrap.wrap(formula, _FORMULA, break_long_words=not breaks, break_on_hyphens=False)
    return [line.replace("\u00a0", " ") for line in lines]


def _reset_lines(changes: Sequence[tuple[str, str]]) -> list[Line]:
    """Assignments, two a line where they are short; of many, exchanges are shown as pairs."""
    if len(changes) > _MOST_ASSIGNMENTS:
        given = dict(changes)
        swapped = [(name, value) for name, value in changes if given.get(value) == name]
        others = [change for change in changes if change not in swapped]
        pairs = dict.fromkeys(tuple(sorted(pair)) for pair in swapped)
        return [*(Line.plain("reset", f"{one} ↔ {other}") for one, other in pairs), *_reset_lines(others)]
    names = max((text_width(name) for name, _ in changes), default=0.0)
    values = max((text_width(value) for _, value in changes), default=0.0)
    column = names + values + 3.2
    per_line = 2 if 2 * column <= _COLUMNS else 1
    lines = []
    for index in range(0, len(changes), per_line):
        cells = []
        for place, (name, value) in enumerate(changes[index : index + per_line]):
            start = column * place
            cells += [(start, name), (start + names + 0.35, ":="), (start + names + 1.85, value)]
        lines.append(Line("reset", tuple(cells)))
    return lines
