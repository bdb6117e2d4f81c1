"""Tables with a declared schema as Parquet files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from coachable.foundation.errors import Raises, RunFolderError

MOST_BYTES = 1 << 31
"""Of a table in memory: a study of a hundred seeds has a tenth of that."""


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

    **Raises:** `error` if the content is no Parquet file, unpacks to more than `MOST_BYTES`, or lacks another
    column.
    """
    try:
        file = pq.ParquetFile(pa.BufferReader(data))
        _require_bounded(file.metadata, path, error)
        texts = [field.name for field in file.schema_arrow if pa.types.is_string(field.type)]
        file = pq.ParquetFile(pa.BufferReader(data), read_dictionary=texts)
        table = _decoded(file.read(), path, error)
    except (pa.ArrowException, OSError) as failure:
        raise error(f"{path} is damaged: {failure}") from None
    missing = [field for field in schema if field.name not in table.column_names]
    if required := [field.name for field in missing if not field.nullable]:
        raise error(f"{path} lacks the column {required[0]!r}")
    for field in missing:
        table = table.append_column(field, pa.nulls(len(table), field.type))
    return table


def _require_bounded(metadata: pq.FileMetaData, path: Path, error: Raises) -> None:
    # A column of one repeated value is a few bytes in a file, whatever its length.
    groups = (metadata.row_group(index) for index in range(metadata.num_row_groups))
    unpacked = max(
        sum(group.total_byte_size for group in groups), 8 * metadata.num_rows * metadata.num_columns
    )
    if unpacked > MOST_BYTES:
        raise error(f"{path} cannot be read: it unpacks to {unpacked:,} bytes, more than {MOST_BYTES:,}")


def _decoded(table: pa.Table, path: Path, error: Raises) -> pa.Table:
    """The table with its texts as such, which were read as indices into what they repeat."""
    for place, field in enumerate(table.schema):
        if not pa.types.is_dictionary(field.type):
            continue
        column = table.column(place)
        lengths = (pc.call_function("binary_length", [chunk.dictionary]) for chunk in column.chunks)
        longest = max((pc.call_function("max", [one]).as_py() or 0 for one in lengths), default=0)
        if longest * len(table) > MOST_BYTES:
            raise error(f"{path} cannot be read: the texts in its column {field.name!r} are too long")
        table = table.set_column(
            place, pa.field(field.name, pa.string(), field.nullable, field.metadata), column.cast(pa.string())
        )
    return table
