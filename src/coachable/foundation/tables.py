"""Tables with a declared schema as Parquet files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from coachable.foundation.errors import Raises, RunFolderError


def table_of(schema: pa.Schema, columns: Mapping[str, np.ndarray | list]) -> pa.Table:
    """A table from its columns, in the schema's order.

    In a nullable column NaN becomes null; one that is not among `columns` is all null.
    """

    def array(field: pa.Field) -> pa.Array:
        if not field.nullable:
            return pa.array(columns[field.name], field.type)
        if field.name not in columns:
            return pa.nulls(len(columns[schema.names[0]]), field.type)
        return pa.array(columns[field.name], field.type, from_pandas=True)

    return pa.table([array(field) for field in schema], schema=schema)


def table_bytes(table: pa.Table) -> bytes:
    """The table as a Parquet file; equal tables are equal bytes."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue().to_pybytes()


def table_from(data: bytes, path: Path, schema: pa.Schema, error: Raises = RunFolderError) -> pa.Table:
    """The table in the content of a Parquet file.

    **Arguments:** `path`, the name of the file in messages; `schema`, whose columns the table must have;
    `error`, the class to raise.

    Nullable columns of the schema that the table lacks are added, as nulls.

    **Raises:** `error` if the content is no Parquet file, or lacks another column.
    """
    try:
        table = pq.read_table(pa.BufferReader(data))
    except (pa.ArrowException, OSError) as failure:
        raise error(f"{path} is damaged: {failure}") from None
    missing = [field for field in schema if field.name not in table.column_names]
    if required := [field.name for field in missing if not field.nullable]:
        raise error(f"{path} lacks the column {required[0]!r}")
    for field in missing:
        table = table.append_column(field, pa.nulls(len(table), field.type))
    return table
