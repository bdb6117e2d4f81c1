"""A behaviour file: its text, the behaviour that it describes, and the line of each declaration."""

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
        """The line of a declaration, counted from 1, or `None` if the file does not have it.

        **Arguments:** `kind` and `name`: `signal`, `constant` or `phase` and its name, `phrase` and its
        words, `edge` and its `str`, `cycle` and its index as text. A declaration in an included file has
        the line of the `include`, and a mirror image that of its original.
        """
        return self.lines.get((kind, name))


def read_document(path: str | Path) -> Document:
    """The document in a file.

    **Raises:** `BehaviourError` if it cannot be read as text, `BehaviourTextError` with every error in it.
    """
    path = Path(path)
    text = read_text(path)
    reading = read(text, str(path), path.parent)
    return Document(path, text, reading.behaviour, reading.lines)


def formatted_file(path: str | Path) -> tuple[str, str]:
    """The text of a file, a behaviour or one made to be included, and how it reads once formatted.

    **Raises:** `BehaviourError` as `read_document` does: a text with errors is not formatted.
    """
    path = Path(path)
    text = read_text(path)
    (check_fragment if is_fragment(text) else read)(text, str(path), path.parent)
    return text, formatted(text, str(path))
