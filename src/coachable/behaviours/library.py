"""The shipped behaviours: ideal walking as in the paper and as in its released code, and others."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from coachable.behaviours.behaviour import Behaviour
from coachable.foundation.errors import BehaviourError
from coachable.foundation.suggestion import suggestion

LIBRARY = Path(__file__).parent / "library"
"""The folder of the shipped behaviours and vocabularies."""

SHIPPED = (
    "bound",
    "compass-walking",
    "compass-walking-five-phases",
    "compass-walking-released",
    "compass-walking-timed",
    "hop",
    "hop-on-the-spot",
    "pace",
    "perry-gait",
    "run",
    "skip",
    "squat-and-stand",
    "trot",
    "walk",
    "walk-backwards",
)
"""Their names."""


def load_behaviour(name_or_path: str | Path) -> Behaviour:
    """A shipped behaviour by its name, or one from a file by its path.

    **Arguments:** `name_or_path`: `"compass-walking"` or another of `SHIPPED`, or a file in the language that
    docs/language.md describes.

    **Raises:** `BehaviourError` for a name that is neither, with the nearest one that is, and for a file that
    cannot be read or has errors, each shown in its place.
    """
    if str(name_or_path) in SHIPPED:
        return _shipped(str(name_or_path))
    return _read(find_behaviour(name_or_path))


def find_behaviour(name_or_path: str | Path) -> Path:
    """The file of a shipped behaviour, or the one at a path.

    **Raises:** `BehaviourError` for a name that is neither, with the nearest one that is.
    """
    if str(name_or_path) in SHIPPED:
        return LIBRARY / f"{name_or_path}.behaviour"
    path = Path(name_or_path)
    try:
        found = path.is_file()
    except (OSError, ValueError):
        found = False
    if not found:
        raise BehaviourError(
            f"{str(name_or_path)!r} is neither a behaviour that ships nor a file; "
            + suggestion(str(name_or_path), SHIPPED)
        )
    return path


@cache
def _shipped(name: str) -> Behaviour:
    return _read(find_behaviour(name))


def _read(path: Path) -> Behaviour:
    # Loading the parser takes a moment, and only reading a text needs it.
    from coachable.behaviours.text import read_document

    return read_document(path).behaviour
