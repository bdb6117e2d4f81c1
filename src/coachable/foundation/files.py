"""Files written so that nobody ever sees half of one, and read with a clear word when something is wrong."""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from coachable.foundation.errors import RunFolderError


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


def read_bytes(path: Path, sha256: str | None = None) -> bytes:
    """A file's content.

    **Raises:** `RunFolderError` if it cannot be read, or is not what `sha256` (hexadecimal) says it was when
    written.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise RunFolderError(f"{path} is missing") from None
    except OSError as error:
        raise RunFolderError(f"{path} cannot be read: {error.strerror}") from None
    if sha256 is not None and hash_of(data) != sha256:
        raise RunFolderError(
            f"{path} is damaged: it is not what was written there; restore it, or run the study anew"
        )
    return data


def hash_of(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def table_bytes(table: pa.Table) -> bytes:
    """The table as a Parquet file; equal tables are equal bytes."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue().to_pybytes()


def table_from(data: bytes, path: Path, schema: pa.Schema) -> pa.Table:
    """The table in a Parquet file's content.

    Nullable columns of the schema that it lacks are added, as nulls.

    **Raises:** `RunFolderError` naming `path` if it is not one, or lacks other columns of the schema.
    """
    try:
        table = pq.read_table(pa.BufferReader(data))
    except (pa.ArrowException, OSError) as error:
        raise RunFolderError(f"{path} is damaged: {error}") from None
    missing = [field for field in schema if field.name not in table.column_names]
    if required := [field.name for field in missing if not field.nullable]:
        raise RunFolderError(f"{path} lacks the column {required[0]!r}")
    for field in missing:
        table = table.append_column(field, pa.nulls(len(table), field.type))
    return table


def _flush_folder(folder: Path) -> None:
    # A rename is on the disk once its folder is; not every system can flush a folder.
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
