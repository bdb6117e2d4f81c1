"""One writer to a run folder at a time."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from coachable.foundation.errors import RunFolderError

_PATIENCE = 0.1
"""Seconds for another try where the file was opened just before its holder removed it."""


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder's lock, a file `lock` with this process's id, while the body runs.

    The operating system drops the lock with the process that holds it, however that ends: a file that was
    left behind locks nothing.

    **Raises:** `RunFolderError` naming the process that writes there.
    """
    path = folder / "lock"
    # With `on_acquired` it is a lock of the operating system everywhere: filelock's other kind, the existence
    # of a file, would outlive a process that is killed.
    lock = FileLock(path, timeout=_PATIENCE, poll_interval=_PATIENCE / 4, on_acquired=_write_holder)
    try:
        lock.acquire()
    except Timeout:
        raise RunFolderError(
            f"{folder} is being written by process {_holder(path)}; wait for it, "
            "or name another folder with --out"
        ) from None
    try:
        yield
    finally:
        # While the lock is held: whoever waits with the removed file open finds that it has no name any more.
        # Windows does not remove open files; there, filelock removes it after the release.
        with contextlib.suppress(OSError):
            path.unlink()
        lock.release()


# Windows locks the first byte against reading as well, so the number begins at the second. It has a fixed
# width since a file that was left behind is written over, not cut off.


def _write_holder(descriptor: int) -> None:
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.write(descriptor, f" {os.getpid():<11}\n".encode())


def _holder(path: Path) -> str:
    try:
        with path.open("rb", buffering=0) as file:
            file.seek(1)
            return file.read(11).decode().strip() or "unknown"
    except (OSError, UnicodeDecodeError):
        return "unknown"
