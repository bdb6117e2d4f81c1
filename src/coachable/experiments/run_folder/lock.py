"""One writer to a run folder at a time."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from coachable.foundation.errors import RunFolderError


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder's lock, a file `lock` with this process's id, while the body runs.

    The operating system drops the lock with the process that holds it, however that ends: a file that was
    left behind locks nothing.

    **Raises:** `RunFolderError` naming the process that writes there.
    """
    path = folder / "lock"
    with _open_locked(path) as file:
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def _open_locked(path: Path):
    while True:
        file = path.open("a+", encoding="ascii")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.seek(0)
            holder = file.read().strip() or "unknown"
            file.close()
            raise RunFolderError(
                f"{path.parent} is being written by process {holder}; wait for it, "
                "or name another folder with --out"
            ) from None
        # Between opening and locking, its holder may have removed the file: then this lock is on nothing.
        if path.exists() and os.fstat(file.fileno()).st_ino == path.stat().st_ino:
            return file
        file.close()
