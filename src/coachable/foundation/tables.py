"""Tables with a declared schema as Parquet files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from coachable.foundation.errors import Raises, RunFolderError


def table_of(schema: pa.Schema, columns: Mapping[str, np.ndarray | list]) -> pa.Table:
    """A table from its columns, in the schema's order."""
    return pa.table([pa.array(columns[field.name], field.type) for field in schema], schema=schema)


def table_bytes(table: pa.Table) -> bytes:
    """The table as a Parquet file; equal tables are equal bytes."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue().to_pybytes()


def table_from(data: bytes, path: Path, schema: pa.Schema, error: Raises = RunFolderError) -> pa.Table:
    """The table in the content of a Parquet file.

    **Arguments:** `path`, the name of the file in messages; `schema`, whose columns the table must have;
    `error`, the class to raise.

    **Raises:** `error` if the content is no Parquet file, or lacks a column.
    """
    try:
        table = pq.read_table(pa.BufferReader(data))
    except (pa.ArrowException, OSError) as failure:
        raise error(f"{path} is damaged: {failure}") from None
    if missing := [name for name in schema.names if name not in table.column_names]:
        raise error(f"{path} lacks the column {missing[0]!r}")
    return table
