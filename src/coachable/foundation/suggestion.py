"""Names in messages: the hint for a mistyped one, and several in a row."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import islice

_LONGEST, _MOST = 80, 200


def suggestion(name: str, known: Iterable[str]) -> str:
    """`did you mean 'orthant'?` if a known name is near, else a list of what is known."""
    known = list(islice(known, _MOST))
    # Looking for near names takes time in the square of their length.
    near = get_close_matches(name, known, n=1) if len(name) <= _LONGEST else []
    if near:
        return f"did you mean {near[0]!r}?"
    listed = ", ".join(map(repr, known[:12])) or "none"
    return f"known: {listed}{', …' if len(known) > 12 else ''}"


def in_a_row(words: Sequence[str]) -> str:
    """`ankle`, `ankle and hip`, `x, y and z`."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last
