"""A text as rows: blank lines, comments, section headers and the items below them.

An item that continues in deeper-indented lines is one row. A `#` outside of quotes begins a comment.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal

from coachable.behaviours.names import code_point
from coachable.behaviours.text.diagnostics import Diagnostics, Place, Source

MAX_BYTES = 2**18
MAX_LINES = 5000
MAX_COLUMNS = 1000
"""Limits a hundred times above the size of a behaviour that a person can read."""

_CODE = re.compile(r'(?:"(?:[^"\\]|\\.)*"|[^#])*')


@dataclass(frozen=True)
class Row:
    """A line, or the lines of an item that continues; `section` is the first word of its header."""

    kind: Literal["blank", "comment", "header", "item"]
    source: Source
    number: int
    text: str = ""
    section: str = ""
    indented: bool = False
    comments: tuple[str, ...] = ()
    """The comments within, at the ends of lines that are not the last."""
    remark: str = ""
    """The comment at the end of the last line; of a comment row, the comment."""

    def place(self, line: int = 1, column: int = 0) -> Place:
        """A place in the row's text, both counted from 1; without a column, where the text begins."""
        if not column:
            column = len(self.text) - len(self.text.lstrip()) + 1
        return Place(self.source, self.number + line - 1, column)


def rows_of(text: str, name: str, diagnostics: Diagnostics, bounded: bool = True) -> tuple[Row, ...]:
    """The rows of a text called `name`; errors in its letters and its layout go to `diagnostics`.

    **Raises:** `BehaviourTextError` for a text that is too long, unless it is not `bounded`: one of our own.
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n")
    source = Source(name, tuple(text.split("\n")))
    if bounded:
        _refuse_long_texts(source, text, diagnostics)
    _refuse_invisible_characters(source, diagnostics)
    rows: list[Row] = []
    section, indent = "", 0
    for number, line in enumerate(source.lines, start=1):
        line = "".join(c if c.isprintable() else " " for c in line.expandtabs(1)).rstrip()
        written = _CODE.match(line)
        assert written is not None  # it matches the empty text, too
        code = written.group().rstrip()
        remark = line[len(code) :].strip()
        depth = len(code) - len(code.lstrip())
        if not line:
            rows.append(Row("blank", source, number, section=section))
        elif not code:
            indented = bool(section) and line[0] == " "
            rows.append(Row("comment", source, number, section=section, indented=indented, remark=remark))
        elif not depth:
            section, indent = code.split()[0], 0
            rows.append(Row("header", source, number, code, section, remark=remark))
        elif not section:
            rows.append(Row("blank", source, number))
            diagnostics.add(
                Place(source, number, depth + 1),
                "this line is in no section",
                'begin with: behaviour "NAME"',
            )
        elif section == "behaviour" or not indent or depth == indent:
            indent = indent or depth
            rows.append(Row("item", source, number, code, section, indented=True, remark=remark))
        elif depth < indent:
            rows.append(Row("blank", source, number, section=section))
            diagnostics.add(
                Place(source, number, depth + 1),
                f"this line is indented by {depth}, those above it by {indent}",
                "indent the lines of a section alike, and a line that continues the one above farther",
            )
        else:
            _continue(rows, number, code, remark)
    return tuple(rows)


def _continue(rows: list[Row], number: int, code: str, remark: str) -> None:
    """Join a line to the last item; comments in between become part of it, blank lines are dropped."""
    between = []
    while rows[-1].kind != "item":
        between.append(rows.pop())
    item = rows.pop()
    comments = [*item.comments, item.remark, *(row.remark for row in reversed(between))]
    lines_so_far = item.text.count("\n") + 1
    text = item.text + "\n" * (number - item.number - lines_so_far + 1) + code
    rows.append(replace(item, text=text, comments=tuple(filter(None, comments)), remark=remark))


def _refuse_long_texts(source: Source, text: str, diagnostics: Diagnostics) -> None:
    longest = max(range(len(source.lines)), key=lambda index: len(source.lines[index]))
    size = len(text.encode("utf-8", "surrogatepass"))
    for amount, most, what, line in (
        (size, MAX_BYTES, "the text has {} bytes", 1),
        (len(source.lines), MAX_LINES, "the text has {} lines", MAX_LINES + 1),
        (len(source.lines[longest]), MAX_COLUMNS, "the line has {} characters", longest + 1),
    ):
        if amount > most:
            diagnostics.add(Place(source, line, 1), f"{what.format(amount)}; no more than {most} are read")
            diagnostics.stop()


def _refuse_invisible_characters(source: Source, diagnostics: Diagnostics) -> None:
    for number, line in enumerate(source.lines, start=1):
        for column, letter in enumerate(line, start=1):
            if not letter.isprintable() and letter != "\t":
                diagnostics.add(
                    Place(source, number, column),
                    f"an invisible character: {code_point(letter)}",
                    "remove it or write a plain space; in quotes it can be written as \\u and four digits",
                )
                break
