"""Traces in files: CSV, also compressed, and Parquet; read in parts, so that any length fits in memory."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import csv as pa_csv

from coachable.automata.trace import Trace, require_increasing
from coachable.behaviours.predicates import Signal
from coachable.foundation.errors import TraceError
from coachable.foundation.files import written_beside
from coachable.foundation.suggestion import suggestion

TIME_NAMES = ("t", "time")

_HEADER = re.compile(r"\s*(?P<name>[^\[\]]*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?\s*")

_ROWS_OF_PARQUET = 1 << 16
_BYTES_OF_CSV = 1 << 20
_LONGEST_HEADER = 1 << 20


def read_trace(path: Path, signals: tuple[Signal, ...], dt: float | None = None) -> Iterator[Trace]:
    """The trace in a file, in consecutive parts of some ten thousand samples.

    A CSV file has a header; a column is named after its signal, with the unit behind it in brackets or
    without: `dtheta_1` or `dtheta_1 [rad/s]`. A column in another unit of the same kind is converted where
    the factor is exact, as from mm to m; `Trace.converted` says so. Other columns are not read. The suffix
    decides: `.parquet` is Parquet, everything else CSV, decompressed if it ends in `.gz`, `.bz2` or `.zst`.

    **Arguments:** `signals`, what to look for; `dt`, the time from row to row [s], which takes the place
    of the time column, `t` or `time`, of which one that is no signal is taken first.

    **Raises:** `TraceError` if the file is not there or damaged, if a column is missing, there twice, in
    another unit or not of numbers, if there is no time, or if it does not increase.
    """
    if not path.is_file():
        raise TraceError(f"{path}: there is no such file")
    if dt is not None and not 0 < dt < math.inf:
        raise TraceError(f"dt is {dt!r}; give the time from sample to sample in seconds, greater than zero")
    try:
        names = _parquet_names(path) if _is_parquet(path) else _csv_names(path)
        columns, factors = _columns(path, names, signals, with_time=dt is None)
        converted = tuple(_clause(name or "the time", columns[name], factors[name]) for name in factors)
        batches = _parquet_batches(path, columns) if _is_parquet(path) else _csv_batches(path, columns)
        rows, previous = 0, -math.inf
        for batch in batches:
            arrays = dict(zip(columns, map(_floats, batch.columns), strict=True))
            for name, factor in factors.items():
                arrays[name] = arrays[name] * factor.numerator / factor.denominator
            time = arrays.pop("") if dt is None else np.arange(rows, rows + batch.num_rows) * dt
            _require_increasing(path, time, previous, rows)
            rows, previous = rows + len(time), float(time[-1]) if len(time) else previous
            yield Trace(time, signals, arrays, converted)
    except (pa.ArrowException, OSError, UnicodeDecodeError, csv.Error) as error:
        raise TraceError(f"{path}: cannot be read: {_first_line(error)}") from None


def write_trace(path: Path, trace: Trace) -> None:
    """Write a file for `read_trace`: a column `t [s]`, and one for each signal with its unit.

    Numbers are written so that the very same are read again. The suffix decides as in `read_trace`.

    **Raises:** `TraceError` for a suffix that is neither of CSV nor of Parquet, or if nothing can be written
    there.
    """
    require_trace_file(path)
    columns = {"t [s]": trace.time} | {
        f"{signal.name} [{signal.unit}]" if signal.unit else signal.name: trace.values[signal.name]
        for signal in trace.signals
    }
    table = pa.table(columns)
    try:
        with written_beside(path) as beside:
            if _is_parquet(path):
                pq.write_table(table, beside)
            else:
                with pa.output_stream(str(beside), compression=_compression(path)) as stream:
                    pa_csv.write_csv(table, stream)
    except OSError as error:
        raise TraceError(f"{path}: cannot be written: {error.strerror}") from None


def require_trace_file(path: Path) -> None:
    """**Raises:** `TraceError` for a suffix that is neither of CSV nor of Parquet."""
    if not _is_parquet(path) and not path.name.endswith((".csv", ".csv.gz", ".csv.bz2", ".csv.zst")):
        raise TraceError(f"{path}: give a file that ends in .csv, .csv.gz or .parquet")


def _require_increasing(path: Path, time: np.ndarray, previous: float, num_before: int) -> None:
    try:
        require_increasing(time, previous, num_before)
    except TraceError as error:
        raise TraceError(f"{path}: {error}") from None


def _clause(name: str, column: str, factor: Fraction) -> str:
    return f"{name} is converted from column {column!r}: × {factor}"


def _columns(
    path: Path, names: list[str], signals: tuple[Signal, ...], *, with_time: bool
) -> tuple[dict[str, str], dict[str, Fraction]]:
    """Which column of the file holds which signal, and factors other than 1; the time has the empty name."""
    found: dict[str, list[tuple[str, str | None]]] = {}
    for column in names:
        if header := _HEADER.fullmatch(column):
            found.setdefault(header["name"], []).append((column, header["unit"]))

    factors: dict[str, Fraction] = {}

    def column_of(what: str, name: str, unit: str, key: str) -> str:
        if len(found[name]) > 1 or Counter(names)[found[name][0][0]] > 1:
            raise TraceError(f"{path}: there is more than one column {name}")
        ((column, unit_there),) = found[name]
        if unit_there is not None and unit and "".join(unit_there.split()) != "".join(unit.split()):
            # Whoever writes no units, or the same ones, does without the checker's imports.
            from coachable.behaviours.checking.units import exact_factor

            factor = exact_factor(unit_there, unit)
            if factor is None:
                raise TraceError(
                    f"{path}: column {name} is in {unit_there}, but {what} is in {unit}; convert the column"
                )
            if factor != 1:
                factors[key] = factor
        return column

    columns = {}
    if with_time:
        own = {signal.name for signal in signals}
        times = sorted((name for name in TIME_NAMES if name in found), key=own.__contains__)
        if not times:
            raise TraceError(
                f"{path}: there is no column t or time; give the time between two rows with --dt [s]"
            )
        columns[""] = column_of("the time", times[0], "s", "")
    for signal in signals:
        if signal.name not in found:
            others = found.keys() - {other.name for other in signals} - set(TIME_NAMES)
            hint = suggestion(signal.name, sorted(others or found))
            raise TraceError(f"{path}: there is no column {signal.name}; {hint}")
        columns[signal.name] = column_of("the behaviour's signal", signal.name, signal.unit, signal.name)
    return columns, factors


def _is_parquet(path: Path) -> bool:
    return path.suffix.lower() in (".parquet", ".pq")


def _compression(path: Path) -> str | None:
    return {".gz": "gzip", ".bz2": "bz2", ".zst": "zstd"}.get(path.suffix)


def _parquet_names(path: Path) -> list[str]:
    return pq.ParquetFile(path).schema_arrow.names


def _parquet_batches(path: Path, columns: dict[str, str]) -> Iterator[pa.RecordBatch]:
    wanted = list(dict.fromkeys(columns.values()))
    for batch in pq.ParquetFile(path).iter_batches(_ROWS_OF_PARQUET, columns=wanted):
        yield batch.select(list(columns.values()))


def _csv_names(path: Path) -> list[str]:
    with pa.input_stream(path) as stream:
        beginning = stream.read(_LONGEST_HEADER).decode("utf-8-sig", errors="surrogateescape")
    first = next(csv.reader(io.StringIO(beginning)), [])
    if not first:
        raise TraceError(f"{path}: the file is empty; its first line must name the columns")
    if any("\udc80" <= letter <= "\udcff" for name in first for letter in name):
        raise TraceError(f"{path}: its first line is not text in UTF-8")
    for letter, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(first) == 1 and letter in first[0]:
            raise TraceError(f"{path}: {name} separate its columns; write commas, and points in the numbers")
    return first


def _csv_batches(path: Path, columns: dict[str, str]) -> Iterator[pa.RecordBatch]:
    wanted = list(columns.values())
    with (
        pa.input_stream(path) as stream,
        pa_csv.open_csv(
            stream,
            read_options=pa_csv.ReadOptions(block_size=_BYTES_OF_CSV, use_threads=False),
            convert_options=pa_csv.ConvertOptions(
                include_columns=wanted, column_types=dict.fromkeys(wanted, pa.float64())
            ),
        ) as reader,
    ):
        yield from reader


def _floats(column: pa.Array) -> np.ndarray:
    """The numbers, NaN where there is none."""
    return column.cast(pa.float64()).to_numpy(zero_copy_only=False)


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]
