"""What is wrong with a text: every mistake with its line, column, a caret and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from coachable.foundation.errors import BehaviourTextError

MOST_MISTAKES = 50
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
class Mistake:
    """Something wrong at a place, and a hint of what to write instead."""

    place: Place
    message: str
    hint: str = ""

    def __str__(self) -> str:
        place = self.place
        where = f"{place.source.name}:{place.line}:{place.column}" if place.source.name else ""
        where = where or f"line {place.line}, column {place.column}"
        lines = [f"{where}: {self.message}", *_shown(place)]
        return "\n".join([*lines, *([f"  {self.hint}"] if self.hint else [])])


class Mistakes:
    """The mistakes found so far; reading goes on after each, until there are too many to be of use."""

    def __init__(self):
        self._found: list[Mistake] = []

    def add(self, place: Place, message: str, hint: str = "") -> None:
        """Note a mistake. **Raises:** `BehaviourTextError` if there are as many as anyone would read."""
        self._found.append(Mistake(place, message, hint))
        if len(self._found) == MOST_MISTAKES:
            self.stop(f"Only the first {MOST_MISTAKES} mistakes are shown.")

    def __bool__(self) -> bool:
        return bool(self._found)

    def stop(self, remark: str = "") -> NoReturn:
        """**Raises:** `BehaviourTextError` with what was found, in the order of the text."""
        order = {source: index for index, source in enumerate(self._sources())}
        found = sorted(self._found, key=lambda m: (order[m.place.source], m.place.line, m.place.column))
        raise BehaviourTextError("\n".join([*map(str, found), *([remark] if remark else [])]))

    def _sources(self) -> list[Source]:
        return list(dict.fromkeys(mistake.place.source for mistake in self._found))


def _shown(place: Place) -> list[str]:
    """The line, as much of it as fits, and a caret below; what could deceive the eye becomes a `?`."""
    if not 1 <= place.line <= len(place.source.lines):
        return []
    line = place.source.lines[place.line - 1]
    start = max(0, place.column - 1 - _WIDTH * 3 // 4)
    seen = "".join(c if c.isprintable() else " " if c == "\t" else "?" for c in line[start : start + _WIDTH])
    return [f"    {seen}".rstrip(), " " * (4 + place.column - 1 - start) + "^"]
