"""Reading behaviour files: of limited size, and only from the folder of the including file or the library."""

from __future__ import annotations

import stat
from pathlib import Path

from coachable.behaviours.library import LIBRARY
from coachable.behaviours.text.lines import MAX_BYTES
from coachable.foundation.errors import BehaviourError


def read_text(path: Path) -> str:
    """The text of a regular file.

    **Raises:** `BehaviourError` if it is none, is too large, or is not UTF-8, with the line and column.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise BehaviourError(f"{path} cannot be read as text: it is not a file")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise BehaviourError(f"{path} cannot be read as text: {reason}") from None
    if len(data) > MAX_BYTES:
        raise BehaviourError(f"{path} has more than {MAX_BYTES} bytes, which is more than is read")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line, column = before.count(b"\n") + 1, error.start - (before.rfind(b"\n") + 1) + 1
        raise BehaviourError(
            f"{path}:{line}:{column}: cannot be read as text: byte {data[error.start]:#04x} is not UTF-8"
        ) from None


def beside(directory: Path, name: str) -> Path:
    """The file of this name in a folder, for a text that includes it; without one, the shipped file.

    **Raises:** `BehaviourError` for a name with a folder in it, and for a link that leads out of the folder.
    """
    if not name.isprintable() or name in ("", ".", "..") or set("/\\:") & set(name):
        raise BehaviourError(f"{name!r} is not the name of a file beside this one; write it without folders")
    path = directory / name
    try:
        if path.resolve(strict=True).parent != directory.resolve():
            raise BehaviourError(f"{name!r} leads to another folder; only files beside this one are included")
    except (OSError, RuntimeError):
        if name in (shipped.name for shipped in LIBRARY.iterdir()):
            return LIBRARY / name
        raise BehaviourError(f"there is no file {name!r} beside this one") from None
    return path
