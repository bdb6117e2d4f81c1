"""Traces in files: CSV, also compressed, and Parquet; read in parts, so that any length fits in memory."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import csv as pa_csv

from coachable.automata.clock import UNITS, Clock
from coachable.automata.trace import Trace, require_increasing, require_signals
from coachable.behaviours.predicates import Signal
from coachable.foundation.errors import TraceError
from coachable.foundation.files import written_beside
from coachable.foundation.suggestion import suggestion

TIME_NAMES = ("t", "time", "timestamp")

_HEADER = re.compile(r"\s*(?P<name>[^\[\]]*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?\s*")

_DATE = re.compile(r"\d{4}-\d\d-\d\d")
_ZONE = re.compile(r":.*(Z|[+-]\d\d:?(\d\d)?)$")
_LARGE = re.compile(r"\d{16,18}|[1-8]\d{18}")
"""A whole number that a float does not hold to the last digit."""

_ROWS_OF_PARQUET = 1 << 16
_BYTES_OF_CSV = 1 << 20
_LONGEST_HEADER = 1 << 20


def read_trace(path: Path, signals: tuple[Signal, ...], dt: float | None = None) -> Iterator[Trace]:
    """The trace in a file, in consecutive parts of some ten thousand samples.

    A CSV file has a header; a column is named after its signal, with the unit behind it in brackets or
    without: `dtheta_1` or `dtheta_1 [rad/s]`. A column in another unit of the same kind is converted where
    the factor is exact, as from mm to m; `Trace.converted` says so. Other columns are not read. The suffix
    decides: `.parquet` is Parquet, everything else CSV, decompressed where it ends in `.gz`, `.bz2` or
    `.zst`. Blank lines before the header are skipped.

    Times are in seconds, or in the unit that their header says, `t [ns]`; dates and what else `Clock`
    converts are counted in seconds, and each part's `clock` says so.

    **Arguments:** `signals`, what to look for; `dt`, the time from row to row [s], which takes the place
    of the time column: `t`, `time` or `timestamp`, of which one that is no signal is taken first, or else, in
    Parquet, the index of a data frame or a column of dates.

    **Raises:** `TraceError` if the file is not there or damaged, if a column is missing, there twice, in
    another unit or not of finite numbers, if there is no time or no row, or if time does not increase.
    """
    require_signals(signals)
    if not path.is_file():
        raise TraceError(f"{path}: there is no such file")
    if dt is not None and not 0 < dt < math.inf:
        raise TraceError(f"dt is {dt!r}; give the time from sample to sample in seconds, greater than zero")
    try:
        is_parquet, blank = _is_parquet(path), 0
        if is_parquet:
            names, other_times = _parquet_names(path)
        else:
            (names, blank), other_times = _csv_names(path), []
        columns, factors, unit = _columns(path, names, signals, other_times, with_time=dt is None)
        converted = tuple(_clause(name or "the time", columns[name], factors[name]) for name in factors)
        batches = _parquet_batches(path, columns) if is_parquet else _csv_batches(path, names, columns, blank)
        clock = Clock(per_second=unit)
        rows, previous = 0, -math.inf
        for batch in batches:
            arrays = dict(zip(columns, batch.columns, strict=True))
            if dt is None:
                time, clock = clock.seconds(*_times(path, arrays.pop("")))
                time = _scaled(time, factors.get(""))
            else:
                time = np.arange(rows, rows + batch.num_rows) * dt
            _require_increasing(path, time, previous, rows)
            previous = float(time[-1]) if len(time) else previous
            values = {name: _scaled(_floats(column), factors.get(name)) for name, column in arrays.items()}
            _require_no_infinity(path, values, rows)
            rows += len(time)
            yield Trace(time, signals, values, converted, clock.note)
        if not rows:
            raise TraceError(f"{path}: it has a header but no rows")
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


def _require_no_infinity(path: Path, values: Mapping[str, np.ndarray], num_before: int) -> None:
    """Refuse what no measurement is, and what a number of too many digits is read as."""
    for name, column in values.items():
        if (infinite := np.isinf(column)).any():
            raise TraceError(
                f"{path}: sample {num_before + int(np.argmax(infinite)) + 1}: {name} is infinite, or larger "
                "than a number can be; leave it empty where nothing was measured"
            )


def _clause(name: str, column: str, factor: Fraction) -> str:
    return f"{name} is converted from column {column!r}: × {factor}"


def _scaled(values: np.ndarray, factor: Fraction | None) -> np.ndarray:
    return values if factor is None else values * factor.numerator / factor.denominator


def _columns(
    path: Path, names: list[str], signals: tuple[Signal, ...], other_times: list[str], *, with_time: bool
) -> tuple[dict[str, str], dict[str, Fraction], int | None]:
    """Which column holds which signal, the time by the empty name; factors other than 1; the time's unit.

    The unit is how many of it a second has, where the header names one; with a factor the numbers are
    counted as seconds first.

    **Arguments:** `other_times`, columns that are the time where none has its name.
    """
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

    columns, unit = {}, None
    if with_time:
        own = {signal.name for signal in signals}
        times = sorted((name for name in TIME_NAMES if name in found), key=own.__contains__)
        if not times and not other_times:
            raise TraceError(
                f"{path}: there is no column t or time; give the time between two rows with --dt [s]"
            )
        if times:
            ((_, written), *_) = found[times[0]]
            wanted = "s"
            if written is not None:
                unit, wanted = UNITS.get(written, 1), written if written in UNITS else "s"
            columns[""] = column_of("the time", times[0], wanted, "")
        else:
            columns[""] = other_times[0]
    for signal in signals:
        if signal.name not in found:
            others = found.keys() - {other.name for other in signals} - set(TIME_NAMES)
            hint = suggestion(signal.name, sorted(others or found))
            raise TraceError(f"{path}: there is no column {signal.name}; {hint}")
        columns[signal.name] = column_of("the behaviour's signal", signal.name, signal.unit, signal.name)
    return columns, factors, unit


def _is_parquet(path: Path) -> bool:
    return path.suffix.lower() in (".parquet", ".pq")


def _compression(path: Path) -> str | None:
    return {".gz": "gzip", ".bz2": "bz2", ".zst": "zstd"}.get(path.suffix)


def _parquet_names(path: Path) -> tuple[list[str], list[str]]:
    """The columns, and those that may be the time without its name: a data frame's index, dates."""
    schema = pq.ParquetFile(path).schema_arrow
    index = (schema.pandas_metadata or {}).get("index_columns", [])
    dates = [field.name for field in schema if pa.types.is_timestamp(field.type)]
    # An index of whole numbers without a name counts rows.
    indices = [
        name
        for name in index
        if isinstance(name, str)
        and name in schema.names
        and pa.types.is_temporal(schema.field(name).type) | pa.types.is_floating(schema.field(name).type)
    ]
    return schema.names, [*indices, *dates]


def _parquet_batches(path: Path, columns: dict[str, str]) -> Iterator[pa.RecordBatch]:
    wanted = list(dict.fromkeys(columns.values()))
    for batch in pq.ParquetFile(path).iter_batches(_ROWS_OF_PARQUET, columns=wanted):
        yield batch.select(list(columns.values()))


def _csv_names(path: Path) -> tuple[list[str], int]:
    """The names in the header, and how many blank lines are before it."""
    lines = _beginning(path).splitlines(keepends=True)
    blank = next((row for row, line in enumerate(lines) if line.strip(" \t\r\n,")), len(lines))
    first = next(csv.reader(io.StringIO("".join(lines[blank:]))), [])
    if not first:
        raise TraceError(f"{path}: the file is empty; its first line must name the columns")
    if any("\udc80" <= letter <= "\udcff" for name in first for letter in name):
        raise TraceError(f"{path}: its first line is not text in UTF-8")
    for letter, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(first) == 1 and letter in first[0]:
            raise TraceError(f"{path}: {name} separate its columns; write commas, and points in the numbers")
    return first, blank


def _beginning(path: Path) -> str:
    with pa.input_stream(path) as stream:
        return stream.read(_LONGEST_HEADER).decode("utf-8-sig", errors="surrogateescape")


def _csv_batches(
    path: Path, names: list[str], columns: dict[str, str], blank: int
) -> Iterator[pa.RecordBatch]:
    wanted = list(columns.values())
    types = dict.fromkeys(wanted, pa.float64())
    if "" in columns:
        types[columns[""]] = _type_of_times(path, names.index(columns[""]), blank)
    with (
        pa.input_stream(path) as stream,
        pa_csv.open_csv(
            stream,
            read_options=pa_csv.ReadOptions(block_size=_BYTES_OF_CSV, use_threads=False, skip_rows=blank),
            convert_options=pa_csv.ConvertOptions(include_columns=wanted, column_types=types),
        ) as reader,
    ):
        yield from reader


def _type_of_times(path: Path, column: int, blank: int) -> pa.DataType:
    """What the first time of a CSV file is: a number, or a date, with a time zone or without."""
    lines = _beginning(path).splitlines(keepends=True)[blank:]
    rows = csv.reader(io.StringIO("".join(lines)))
    next(rows)
    texts = (row[column].strip() for row in rows if column < len(row))
    text = next(filter(None, texts), "nan")
    if _DATE.match(text):
        return pa.timestamp("ns", "UTC" if _ZONE.search(text) else None)
    if _LARGE.fullmatch(text):
        return pa.int64()
    try:
        float(text)
    except ValueError:
        raise TraceError(
            f"{path}: its first time is {text!r}; give numbers of seconds, or dates such as "
            f"2026-01-31 12:00:00.25"
        ) from None
    return pa.float64()


def _times(path: Path, column: pa.Array) -> tuple[np.ndarray, bool]:
    """The times as numbers, dates in UTC or durations; and whether dates have a time zone."""
    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        return column.to_numpy(zero_copy_only=False), pa.types.is_timestamp(kind) and kind.tz is not None
    if pa.types.is_integer(kind) and not column.null_count:
        return column.to_numpy(zero_copy_only=False), False
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
        raise TraceError(
            f"{path}: its times are {kind}; give numbers of seconds, or dates with a time of day"
        )
    return _floats(column), False


def _floats(column: pa.Array) -> np.ndarray:
    """The numbers, NaN where there is none."""
    return column.cast(pa.float64()).to_numpy(zero_copy_only=False)


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]
