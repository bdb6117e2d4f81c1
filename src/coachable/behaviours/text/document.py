"""A behaviour file as it is: its text, the behaviour that it describes, and where it says what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.text.formatter import formatted
from coachable.behaviours.text.parser import check_fragment, is_fragment, read
from coachable.behaviours.text.sources import read_text


@dataclass(frozen=True)
class Document:
    """A file that describes a behaviour. Nothing is lost: `text` is the file."""

    path: Path
    text: str
    behaviour: Behaviour
    lines: Mapping[tuple[str, str], int]

    def line_of(self, kind: str, name: str) -> int | None:
        """The line in which something is said, counted from 1, or None if the file does not say it.

        **Arguments:** `kind` and `name`: `signal`, `constant` or `phase` and its name, `phrase` and its
        words, `edge` and its `str`, `cycle` and its index as text. What an included file says is said where
        it is included, and a mirror image where its original is.
        """
        return self.lines.get((kind, name))


def read_document(path: str | Path) -> Document:
    """The document in a file.

    **Raises:** `BehaviourError` if it cannot be read as text, `BehaviourTextError` with every mistake in it.
    """
    path = Path(path)
    text = read_text(path)
    reading = read(text, str(path), path.parent)
    return Document(path, text, reading.behaviour, reading.lines)


def formatted_file(path: str | Path) -> tuple[str, str]:
    """The text of a file, a behaviour or one made to be included, and how it reads once formatted.

    **Raises:** `BehaviourError` as `read_document` does: what has mistakes is not formatted.
    """
    path = Path(path)
    text = read_text(path)
    (check_fragment if is_fragment(text) else read)(text, str(path), path.parent)
    return text, formatted(text, str(path))
