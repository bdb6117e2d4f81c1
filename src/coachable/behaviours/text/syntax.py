"""Rows of text as statements: each line is parsed by its rule of the grammar."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lark import Lark, Token, Tree, UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from coachable.behaviours.text.diagnostics import Diagnostics, Place
from coachable.behaviours.text.lines import Row
from coachable.foundation.errors import BehaviourError
from coachable.foundation.suggestion import suggestion

MAX_NESTING = 30
"""How deep parentheses may be nested."""

RULES: Mapping[str, str] = MappingProxyType(
    {
        "behaviour": "quoted",
        "include": "quoted",
        "outside": "quoted",
        "mirror": "mirror",
        "signals": "signal",
        "constants": "constant",
        "vocabulary": "phrase",
        "phases": "phase",
        "cycle": "chain",
        "edges": "chain",
    }
)
"""The rule of a line, by its section."""

STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"')
"""A text in quotes, as in the grammar."""

HEADERS_WITH_CONTENT = ("behaviour", "include", "outside", "mirror")
"""Sections whose header has content of its own; of these only `behaviour` has lines below it."""


@dataclass(frozen=True)
class Statement:
    """A line with content: the row, and its syntax tree; `None` if it could not be parsed."""

    row: Row
    tree: Tree | None

    @property
    def section(self) -> str:
        """Its section, such as `phases`."""
        return self.row.section

    def place(self, token: Token | None = None) -> Place:
        """The place of a token of the statement, or of the statement."""
        if token is None or token.line is None or token.column is None:
            return self.row.place()
        return self.row.place(token.line, token.column)


def statement_of(row: Row, diagnostics: Diagnostics) -> Statement | None:
    """A header or an item parsed by its rule.

    `None` for the header of a section with items, and for the lines that describe the behaviour.
    """
    known = row.section in RULES
    if row.kind == "header":
        if not known:
            diagnostics.add(
                row.place(), f"no section is called {row.section[:40]!r}", suggestion(row.section, RULES)
            )
            return None
        if row.section in HEADERS_WITH_CONTENT:
            return Statement(row, _tree(row, RULES[row.section], diagnostics, skipped=len(row.section)))
        if rest := row.text[len(row.section) :].strip():
            column = row.text.index(rest, len(row.section)) + 1
            diagnostics.add(
                row.place(1, column),
                f"{row.section} must be alone in its line",
                "its items follow in the lines below, indented",
            )
        return None
    if not known or row.section == "behaviour":
        return None
    if row.section in HEADERS_WITH_CONTENT:
        diagnostics.add(row.place(), f"{row.section} has no lines below it", "begin a section, not indented")
        return None
    return Statement(row, _tree(row, RULES[row.section], diagnostics))


def tokens_of(row: Row) -> tuple[Token, ...]:
    """The tokens of a row that can be read."""
    skipped = len(row.section) if row.kind == "header" else 0
    reading = _parser().parse_interactive(" " * skipped + row.text[skipped:], start=RULES[row.section])
    return tuple(reading.exhaust_lexer())


def string_of(token: Token) -> str:
    """The text of a word or of a string in quotes. Escapes in quotes are those of JSON.

    **Raises:** `BehaviourError` for an unknown escape.
    """
    if token.type != "STRING":
        return " ".join(token.split())
    try:
        return json.loads(str(token))
    except ValueError:
        raise BehaviourError(
            f'{token} has an unknown escape; write \\\\ for one, or \\" for a quote'
        ) from None


def quoted(text: str) -> str:
    """The text in quotes; unprintable characters are escaped."""
    pieces = json.dumps(text, ensure_ascii=False)
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in pieces)


def parts_of(tree: object) -> list[Any]:
    """The children of a syntax tree: trees and tokens, by its rule of the grammar."""
    assert isinstance(tree, Tree)
    return tree.children


@cache
def _parser() -> Lark:
    grammar = (Path(__file__).parent / "grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", start=sorted(set(RULES.values())), maybe_placeholders=False)


def _tree(row: Row, rule: str, diagnostics: Diagnostics, skipped: int = 0) -> Tree | None:
    text = " " * skipped + row.text[skipped:]
    depth = deepest = 0
    for letter in text:
        depth += {"(": 1, ")": -1}.get(letter, 0)
        deepest = max(deepest, depth)
    if deepest > MAX_NESTING:
        diagnostics.add(
            row.place(), f"parentheses are nested {deepest} deep; no more than {MAX_NESTING} are read"
        )
        return None
    try:
        return _parser().parse(text, start=rule)
    except UnexpectedInput as error:
        diagnostics.add(*_explained(row, rule, text, error))
        return None


def _explained(row: Row, rule: str, text: str, error: UnexpectedInput) -> tuple[Place, str, str]:
    """The place of an error, its message with what was expected, and a hint."""
    if isinstance(error, UnexpectedToken) and error.token.type != "$END":
        found, expected = str(error.token), error.accepts or error.expected
        offset = error.token.start_pos or 0
    elif isinstance(error, UnexpectedCharacters):
        found, expected, offset = text[error.pos_in_stream], error.allowed or (), error.pos_in_stream
    else:
        found, expected, offset = "", getattr(error, "accepts", None) or (), len(text)
    line = text.count("\n", 0, offset)
    column = offset - (text.rfind("\n", 0, offset) + 1) + 1
    shown = f"{found.split()[0][:40]!r}" if found.split() else "the end of the line"
    wanted = _in_words(set(expected) - _impossible(rule, text[:offset]))
    message = f"{shown} is not expected here" + (f"; expected {wanted}" if wanted else "")
    return row.place(line + 1, column), message, _hint(rule, text, offset, found, expected)


_WORDS_FOR = (
    ({"STRING", "WORD", "NUMBER"}, "a name, a number or a phrase"),
    ({"WORD", "NUMBER"}, "a name or a number"),
    ({"WORD", "STRING"}, "a name"),
    ({"STRING", "TEXT"}, "a description"),
    ({"WORD"}, "a word"),
    ({"STRING"}, "a text in quotes"),
    ({"NUMBER"}, "a number"),
    ({"UNIT"}, "a unit in brackets"),
    ({"RELATION"}, "a comparison such as > or <="),
    ({"D_DT"}, "d/dt"),
    ({"SECONDS"}, "s, for seconds"),
    ({"FOR"}, "a time such as: for 0.1 s to 0.4 s"),
    ({"COLON"}, "a colon"),
    ({"COMMA"}, "a comma"),
    ({"OPEN"}, "'('"),
    ({"CLOSE"}, "')'"),
    ({"ARROW"}, "->"),
    ({"SWAP"}, "<->"),
    ({"ASSIGN"}, ":="),
    ({"EQUALS"}, "="),
    ({"PLUS", "MINUS", "TIMES", "OVER"}, "a sign of arithmetic"),
    *(({word}, f"'{word.lower()}'") for word in ("AND", "OR", "NOT", "WITHIN", "DEADBAND", "MEANS", "TO")),
    *(({word}, f"'{word.lower()}'") for word in ("AT", "LEAST", "MOST", "ON", "WITH")),
    ({"$END"}, "the end of the line"),
)


def _impossible(rule: str, before: str) -> set[str]:
    """Terminals that the parser, whose rules share states, names although they cannot come here."""
    elsewhere = set() if rule == "chain" else {"ON", "WITH", "ASSIGN"}
    elsewhere |= set() if rule in ("chain", "mirror") else {"ARROW"}
    elsewhere |= set() if rule == "mirror" else {"SWAP"}
    elsewhere |= set() if rule == "phrase" and " means " not in before else {"MEANS"}
    elsewhere |= set() if before.count("(") > before.count(")") else {"CLOSE"}
    return elsewhere | (set() if rule == "phase" and ":" not in before else {"COLON", "FOR"})


def _in_words(expected: Collection[str]) -> str:
    left, words = set(expected), []
    for terminals, word in _WORDS_FOR:
        if terminals <= left:
            words.append(word)
            left -= terminals
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _hint(rule: str, text: str, offset: int, found: str, expected: Collection[str]) -> str:
    before, rest = text[:offset].rstrip(), text[offset:]
    if found == "=" and re.match(r"==?", rest) and "EQUALS" not in expected:
        return "equality needs a tolerance: x = 0.3 within 0.01"
    if before.endswith("=") and rest.startswith("="):
        return "equality needs a tolerance: x = 0.3 within 0.01"
    if found in ("≤", "≥", "≠", "!"):
        return "comparisons are written <, <=, > and >=; equality as x = 0.3 within 0.01"
    if not found and "WITHIN" in expected:
        return "equality needs a tolerance: x = 0.3 within 0.01"
    if found in ("→", "⟶", "⇒"):
        return "an arrow is written ->"
    if found == '"' and rule in ("phrase", "phase"):
        return "phrases are written without quotes; a text in quotes ends in the line in which it begins"
    if found == '"':
        return "a text in quotes ends in the line in which it begins"
    if re.search(r"[0-9]$", before) and re.match(r"[^\W\d]", found) and "UNIT" in expected:
        return f"a unit is written in brackets: [{found.split()[0][:20]}]"
    if found in ("and", "or") and {"and": "OR", "or": "AND"}[found] in expected:
        return "group with parentheses: (a and b) or c"
    if rule == "phrase" and "MEANS" in expected:
        return "a phrase is explained like this: leg leans back means theta_1 > 0"
    if rule == "phase" and "COLON" in expected:
        return 'a phase is written like this: O1 "swing": leg leans back, foot is up'
    return ""


def rough_name(row: Row) -> str:
    """The name that an unparsable line most likely declares, so that its error is reported only once."""
    head = row.text.partition(" means ")[0] if row.section == "vocabulary" else row.text
    words = re.findall(r"[^\W\d]\w*(?:['’-]\w+)*", head)
    return " ".join(words if row.section == "vocabulary" else words[:1])
