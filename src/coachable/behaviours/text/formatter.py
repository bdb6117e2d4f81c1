"""The standard layout of a text: the same tokens and comments, indented, aligned and wrapped alike."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from lark import Token

from coachable.behaviours.text.diagnostics import Diagnostics
from coachable.behaviours.text.lines import Row, rows_of
from coachable.behaviours.text.syntax import HEADERS_WITH_CONTENT, STRING, statement_of, tokens_of

WIDTH = 100
_FARTHER = 4
"""The least indentation of lines that continue an item."""
_DEEPEST = 50
"""Lines that continue an item and would begin farther right than this begin near the left instead."""

Line = tuple[str, str]
"""The kind of a line (`blank`, `comment`, `header` or `item`) and its text."""


def formatted(text: str, name: str = "") -> str:
    """The text in the standard layout. Its tokens, comments and their order stay; formatting is idempotent.

    **Raises:** `BehaviourTextError` for a text with lines that cannot be parsed.
    """
    diagnostics = Diagnostics()
    rows = rows_of(text, name, diagnostics)
    for row in rows:
        if row.kind in ("header", "item"):
            statement_of(row, diagnostics)
    if diagnostics:
        diagnostics.stop()
    return laid_out(rows)


def laid_out(rows: Sequence[Row]) -> str:
    """The text of rows that can be parsed, in the standard layout."""
    lines: list[Line] = []
    for _, group in groupby(rows, key=_section_number(rows)):
        lines += _section(list(group))
    return "\n".join(line for _, line in _spaced_out(lines)) + "\n"


def _section_number(rows: Sequence[Row]):
    number, numbers = 0, {}
    for row in rows:
        number += row.kind == "header"
        numbers[row.number] = number
    return lambda row: numbers[row.number]


def _section(rows: Sequence[Row]) -> Iterable[Line]:
    """The lines of one section, with its header; those before the first header have none."""
    items = [row for row in rows if row.kind == "item"]
    aligned = iter(_aligned(items))
    for row in rows:
        comment_indent = "  " if row.indented else ""
        if row.kind == "blank":
            # A blank line between lines of a description is part of it.
            within = row.section == "behaviour" and items and items[0].number < row.number < items[-1].number
            yield ("item", "") if within else ("blank", "")
        elif row.kind == "comment":
            yield "comment", comment_indent + row.remark
        elif row.kind == "header":
            content = _joined(tokens_of(row)) if row.section in HEADERS_WITH_CONTENT else ""
            yield "header", _with_remark(f"{row.section} {content}".rstrip(), row)
        else:
            yield from (("comment", f"  {comment}") for comment in row.comments)
            *above, last = next(aligned)
            yield from (("item", line) for line in above)
            yield "item", _with_remark(last, row)


def _spaced_out(lines: Sequence[Line]) -> list[Line]:
    """One blank line before each section and the comments on it, none at the ends, nowhere two."""
    result: list[Line] = []
    for line in lines:
        if line[0] == "blank" and (not result or result[-1][0] in ("blank", "header")):
            continue
        if line[0] == "header":
            start = len(result)
            while start and result[start - 1][0] == "comment" and result[start - 1][1][0] != " ":
                start -= 1
            if start and result[start - 1][0] != "blank":
                result.insert(start, ("blank", ""))
        result.append(line)
    while result and result[-1][0] == "blank":
        result.pop()
    return result


def _with_remark(line: str, row: Row) -> str:
    return f"{line}  {row.remark}" if row.remark else line


def _aligned(items: Sequence[Row]) -> list[list[str]]:
    """Each item of a section as lines, in aligned columns."""
    if not items:
        return []
    section = items[0].section
    if section == "behaviour":
        texts = [row.text.strip() for row in items]
        return [[f"  {text if STRING.fullmatch(text) else ' '.join(text.split())}"] for text in texts]
    divided = [_DIVIDE[section](tokens_of(row)) for row in items]
    widths = [max(map(len, column)) for column in zip(*(cells for cells, _ in divided), strict=True)]
    result = []
    for cells, chunks in divided:
        padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=True) if width]
        start = "".join(f"{cell}  " for cell in ["", *padded])
        result.append(_wrapped(start, chunks, len(start) if len(start) <= _DEEPEST else _FARTHER))
    if section == "phases" and any(len(lines) > 1 or len(lines[0]) > WIDTH for lines in result):
        result = [
            [f"  {' '.join(filter(None, cells))}", *_wrapped(" " * _FARTHER, chunks, _FARTHER)]
            for cells, chunks in divided
        ]
    return result


def _wrapped(start: str, chunks: Sequence[str], indent: int) -> list[str]:
    lines = [start]
    for chunk in chunks:
        empty = not lines[-1].strip() or lines[-1] == start
        if empty or len(lines[-1]) + 1 + len(chunk) <= WIDTH:
            lines[-1] += chunk if empty else f" {chunk}"
        else:
            lines.append(" " * max(indent, _FARTHER) + chunk)
    return [line.rstrip() for line in lines]


Divided = tuple[tuple[str, ...], list[str]]
"""The cells of an item, each of which begins in its own column, and the chunks after them, which may wrap."""


def _divided_signal(tokens: Sequence[Token]) -> Divided:
    by_type = {token.type: token for token in tokens}
    name = [token for token in tokens if token.type in ("WORD", "EQUALS", "D_DT")]
    return (_joined(name), _joined([by_type["UNIT"]]) if "UNIT" in by_type else ""), _text(tokens)


def _divided_constant(tokens: Sequence[Token]) -> Divided:
    number = [token for token in tokens[1:] if token.type not in ("TEXT", "STRING")]
    return (str(tokens[0]), _joined(number)), _text(tokens)


def _divided_phrase(tokens: Sequence[Token]) -> Divided:
    means = next(index for index, token in enumerate(tokens) if token.type == "MEANS")
    return (_joined(tokens[:means]), "means"), _chunks(tokens[means + 1 :])


def _divided_phase(tokens: Sequence[Token]) -> Divided:
    colon = next(index for index, token in enumerate(tokens) if token.type == "COLON")
    name, *rest = tokens[: colon + 1]
    title = [token for token in rest if token.type == "STRING"]
    dwell = [token for token in rest if token.type not in ("STRING", "COLON")]
    cells = [str(name), _joined(title), _joined(dwell)]
    last = max(index for index, cell in enumerate(cells) if cell)
    cells[last] += ":"
    return tuple(cells), _chunks(tokens[colon + 1 :])


def _divided_chain(tokens: Sequence[Token]) -> Divided:
    return (), _chunks(tokens)


_DIVIDE = {
    "signals": _divided_signal,
    "constants": _divided_constant,
    "vocabulary": _divided_phrase,
    "phases": _divided_phase,
    "cycle": _divided_chain,
    "edges": _divided_chain,
}


def _text(tokens: Sequence[Token]) -> list[str]:
    last = tokens[-1]
    if last.type == "STRING":
        return [str(last)]
    return last.split() if last.type == "TEXT" else []


def _chunks(tokens: Sequence[Token]) -> list[str]:
    """The tokens in pieces between which a line may end: after commas, before arrows, `and` and `or`.

    What is in parentheses stays together, unless it is too long for a line.
    """
    pieces = _split(tokens, {"AND", "OR", "ARROW"}, in_parentheses=False)
    divided = []
    for piece in pieces:
        fits = len(_joined(piece)) <= WIDTH - 2 * _FARTHER
        ends = {"AND", "OR", "RELATION", "PLUS", "TIMES", "OVER"}
        divided += [piece] if fits else _split(piece, ends, in_parentheses=True)
    return [_joined(piece) for piece in divided]


def _split(tokens: Sequence[Token], ends: set[str], in_parentheses: bool) -> list[list[Token]]:
    """The tokens in pieces: one ends before each token of these types, and after each comma."""
    pieces: list[list[Token]] = [[]]
    depth = 0
    for token in tokens:
        depth += {"OPEN": 1, "CLOSE": -1}.get(token.type, 0)
        within = in_parentheses or not depth
        if within and token.type in ends and pieces[-1]:
            pieces.append([])
        pieces[-1].append(token)
        if within and token.type == "COMMA":
            pieces.append([])
    return [piece for piece in pieces if piece]


_NUMBERS_FOLLOW = {"NUMBER", "WORD", "CLOSE", "UNIT"}


def _joined(tokens: Sequence[Token]) -> str:
    """The tokens with single spaces where there should be some."""
    text = ""
    previous = before = None
    for token in tokens:
        unary = (
            previous is not None
            and previous.type == "MINUS"
            and (before is None or before.type not in _NUMBERS_FOLLOW)
        )
        call = token.type == "OPEN" and previous is not None and previous.type == "WORD"
        opened = previous is not None and previous.type == "OPEN"
        if text and not (unary or call or opened or token.type in ("COMMA", "COLON", "CLOSE")):
            text += " "
        text += " ".join(token.split()) if token.type in ("UNIT", "TEXT") else str(token)
        before, previous = previous, token
    return text
