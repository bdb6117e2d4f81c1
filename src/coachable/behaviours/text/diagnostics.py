"""Errors in a text, each with its line and column, a caret, and a hint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from coachable.foundation.errors import BehaviourTextError

MAX_DIAGNOSTICS = 50
_WIDTH = 100
_UNNAMED = "the text"


@dataclass(frozen=True, eq=False)
class Source:
    """A text and where it comes from; `name` is empty for one that is in no file."""

    name: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Place:
    """A line and a column in a source, both counted from 1."""

    source: Source
    line: int
    column: int


@dataclass(frozen=True)
class Diagnostic:
    """An error at a place, and a hint of what to write instead."""

    place: Place
    message: str
    hint: str = ""

    def __str__(self) -> str:
        place = self.place
        where = f"{place.source.name}:{place.line}:{place.column}" if place.source.name else ""
        where = where or f"line {place.line}, column {place.column}"
        lines = [f"{where}: {self.message}", *_shown(place)]
        return "\n".join([*lines, *([f"  {self.hint}"] if self.hint else [])])


class Diagnostics:
    """The errors found so far; reading continues after each one, up to `MAX_DIAGNOSTICS`."""

    def __init__(self):
        self._found: list[Diagnostic] = []

    def add(self, place: Place, message: str, hint: str = "") -> None:
        """Add an error. **Raises:** `BehaviourTextError` if there are `MAX_DIAGNOSTICS` of them."""
        self._found.append(Diagnostic(place, message, hint))
        if len(self._found) == MAX_DIAGNOSTICS:
            self.stop(f"Only the first {MAX_DIAGNOSTICS} errors are shown.")

    def __bool__(self) -> bool:
        return bool(self._found)

    def stop(self, remark: str = "") -> NoReturn:
        """**Raises:** `BehaviourTextError` with the errors found, in the order of the text."""
        order = {source: index for index, source in enumerate(self._sources())}
        found = sorted(self._found, key=lambda m: (order[m.place.source], m.place.line, m.place.column))
        raise BehaviourTextError("\n".join([*map(str, found), *([remark] if remark else [])]))

    def _sources(self) -> list[Source]:
        return list(dict.fromkeys(diagnostic.place.source for diagnostic in self._found))


def _shown(place: Place) -> list[str]:
    """The line, as much of it as fits, and a caret below; unprintable characters become a `?`."""
    if not 1 <= place.line <= len(place.source.lines):
        return []
    line = place.source.lines[place.line - 1]
    start = max(0, place.column - 1 - _WIDTH * 3 // 4)
    seen = "".join(c if c.isprintable() else " " if c == "\t" else "?" for c in line[start : start + _WIDTH])
    return [f"    {seen}".rstrip(), " " * (4 + place.column - 1 - start) + "^"]
