"""Files that are written whole or not at all, and read with an error that names the file."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path

from coachable.foundation.errors import Raises, RunFolderError
from coachable.foundation.stopping import Interruptible

MOST_BYTES = 1 << 30
"""Of a file that is read whole: policies and tables are smaller, and what is larger fills the memory."""
MOST_BYTES_OF_TEXT = 1 << 24
"""Of a text that is read whole, such as a plan, a manifest or a passport."""


@contextlib.contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A new, empty file beside `path` that takes its place once the body has written it.

    Whatever happens before that, an older file at `path` stays as it was and nothing is left beside it. A
    link at `path` is replaced, and what it leads to is left alone. Since the new file's suffix is another,
    the body names its format.

    **Raises:** `OSError` naming `path`, for what keeps the file from being written, and for something there
    that is neither a file nor a link to one.
    """
    beside = path.with_name(f".{os.getpid()}-{secrets.token_hex(6)}.part")
    with Interruptible():  # or else a stopped program would leave the file beside
        try:
            _require_replaceable(path)
            os.close(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
            yield beside
            _flush(beside)
            os.replace(beside, path)
        except BaseException as error:
            with contextlib.suppress(OSError):
                beside.unlink(missing_ok=True)
            # The system names the file beside it or, where the disk is full, no file at all.
            if isinstance(error, OSError) and error.filename in (None, str(beside)):
                strerror = error.strerror or str(error).partition("\n")[0]
                raise OSError(error.errno or errno.EIO, strerror, str(path)) from None
            raise
    _flush_folder(path.parent)


def write_atomic(path: Path, data: bytes | str) -> None:
    """Write a file whole or not at all, as `written_beside` does; text in UTF-8."""
    with written_beside(path) as beside:
        beside.write_bytes(data.encode() if isinstance(data, str) else data)


def replace_text(path: Path, text: str) -> None:
    """Give a file, or the one that a link leads to, another text; its permissions stay."""
    path = path.resolve()
    mode = path.stat().st_mode
    write_atomic(path, text)
    path.chmod(mode)


def make_folder(folder: Path, name: str, error: Raises = RunFolderError) -> Path:
    """The folder of a name within another one, made if it is missing.

    **Raises:** `error` if it is a link: what is written into it would lie elsewhere.
    """
    path = folder / name
    if path.is_symlink():
        raise error(f"{path} is a link, and nothing is written through one; remove it")
    path.mkdir(exist_ok=True)
    return path


def read_bytes(
    path: Path, sha256: str | None = None, error: Raises = RunFolderError, most: int | None = MOST_BYTES
) -> bytes:
    """The content of a regular file, or of one that a link leads to.

    **Arguments:** `sha256`, the hash in hexadecimal that the content must have; `error`, the class to raise;
    `most`, how many bytes it may have, `None` for any number.

    **Raises:** `error` naming a file that cannot be read, is no file, is too large or has another hash.
    """
    try:
        # Without O_NONBLOCK, opening a pipe would wait for a writer.
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        descriptor = os.open(path, flags)
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise error(f"{path} cannot be read: it is not a regular file")
            with open(descriptor, "rb", closefd=False) as file:
                data = file.read(-1 if most is None else most + 1)
        finally:
            os.close(descriptor)
    except FileNotFoundError:
        raise error(f"{path} is missing") from None
    except OSError as failure:
        raise error(f"{path} cannot be read: {failure.strerror}") from None
    if most is not None and len(data) > most:
        raise error(f"{path} cannot be read: it has more than {most:,} bytes")
    if sha256 is not None and hash_of(data) != sha256:
        raise error(f"{path} is damaged: it is not what was written there; restore it, or run the study anew")
    return data


def read_text(path: Path, sha256: str | None = None, error: Raises = RunFolderError) -> str:
    """The content of a text file in UTF-8, with the arguments and errors of `read_bytes`."""
    try:
        return read_bytes(path, sha256, error, MOST_BYTES_OF_TEXT).decode()
    except UnicodeDecodeError:
        raise error(f"{path} is damaged: it is not text in UTF-8") from None


def hash_of(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def _require_replaceable(path: Path) -> None:
    # Renaming a file over a device or a pipe would remove it.
    with contextlib.suppress(FileNotFoundError):
        mode = path.lstat().st_mode
        if stat.S_ISDIR(mode):
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode) and not stat.S_ISLNK(mode):
            raise OSError(errno.EINVAL, "It is not a regular file", str(path))


def _flush(path: Path, flags: int = os.O_RDWR) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _flush_folder(folder: Path) -> None:
    # A rename is on the disk once its folder is; not every system can flush a folder.
    with contextlib.suppress(OSError):
        _flush(folder, os.O_RDONLY)
