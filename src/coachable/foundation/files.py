"""Files that are written whole or not at all, and read with an error that names the file."""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path

from coachable.foundation.errors import Raises, RunFolderError


def write_atomic(path: Path, data: bytes | str) -> None:
    """Write a file whole or not at all: into a neighbour, flushed to the disk, then renamed."""
    neighbour = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with neighbour.open("wb") as file:
            file.write(data.encode() if isinstance(data, str) else data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(neighbour, path)
    except BaseException as error:
        neighbour.unlink(missing_ok=True)
        # The system names the neighbour, or, where the disk is full, no file at all.
        if isinstance(error, OSError) and error.errno is not None:
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise
    _flush_folder(path.parent)


def replace_text(path: Path, text: str) -> None:
    """Give a file, or the one that a link leads to, another text; its permissions stay."""
    path = path.resolve()
    mode = path.stat().st_mode
    write_atomic(path, text)
    path.chmod(mode)


def read_bytes(path: Path, sha256: str | None = None, error: Raises = RunFolderError) -> bytes:
    """The content of a file.

    **Arguments:** `sha256`, the hash in hexadecimal that the content must have; `error`, the class to raise.

    **Raises:** `error` naming a file that cannot be read or has another hash.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise error(f"{path} is missing") from None
    except OSError as failure:
        raise error(f"{path} cannot be read: {failure.strerror}") from None
    if sha256 is not None and hash_of(data) != sha256:
        raise error(f"{path} is damaged: it is not what was written there; restore it, or run the study anew")
    return data


def read_text(path: Path, sha256: str | None = None, error: Raises = RunFolderError) -> str:
    """The content of a text file in UTF-8, with the arguments and errors of `read_bytes`."""
    try:
        return read_bytes(path, sha256, error).decode()
    except UnicodeDecodeError:
        raise error(f"{path} is damaged: it is not text in UTF-8") from None


def hash_of(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def _flush_folder(folder: Path) -> None:
    # A rename is on the disk once its folder is; not every system can flush a folder.
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
