"""Times and signals of a trace as plain numbers, whatever they were recorded in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import TraceError

Column = Any
"""A number or a time for each sample, in whatever NumPy makes an array of; Python and pandas included."""

UNITS: Mapping[str, int] = MappingProxyType(
    {"s": 1, "sec": 1, "ms": 10**3, "us": 10**6, "µs": 10**6, "μs": 10**6, "ns": 10**9}
)
"""How many of each unit of time a second has."""

_NAMES: Mapping[int, str] = MappingProxyType(
    {10**3: "milliseconds", 10**6: "microseconds", 10**9: "nanoseconds"}
)

_SINCE_1970 = ((1e17, 10**9), (1e14, 10**6), (1e11, 10**3))
"""Whole numbers from the first on are dates, in so many parts of a second: from 1973 on, as ns, µs, ms."""

_STEPS = ((1e5, 10**9), (1e3, 10**6))
"""Whole numbers that far apart are so many parts of a second: in seconds it would be a quarter of an hour."""


@dataclass(frozen=True)
class Clock:
    """How the times of one trace become seconds; the clock after its first part converts the further ones.

    - Numbers are seconds, unless the column says another unit. Whole numbers that cannot be seconds, by their
      size or their distance, are taken for nanoseconds, microseconds or milliseconds.
    - Durations (`timedelta64`) are converted.
    - Dates with a time of day (`datetime64`, `datetime`, timestamps and indices of pandas) are counted from
      the first one, those with a time zone in UTC.
    """

    per_second: int | None = None
    """How many of the numbers' unit a second has; `None` while that is not known."""
    origin: Any = None
    """The date, or the large whole number, from which is counted; `None` before the first sample."""
    zoned: bool = False
    """Whether the dates have a time zone."""
    note: str = ""
    """How times are converted, in words; empty for seconds."""

    @staticmethod
    def of_seconds(note: str = "") -> Clock:
        """The clock of times that are seconds, or were converted, as the note says."""
        return Clock(per_second=1, origin=0, note=note)

    def seconds(self, times: Column, zoned: bool = False) -> tuple[Float[np.ndarray, " samples"], Clock]:
        """The next times [s], NaN where one is missing, and the clock for those after them.

        **Arguments:** `zoned`: whether dates without a time zone are in UTC.

        **Raises:** `TraceError` for what are neither numbers nor times, for times with a time zone beside
        some without, and for dates beside numbers.
        """
        array, has_zone = _dates(times)
        if array.dtype.kind == "m":
            return numbers_of("the time", array / np.timedelta64(1, "s")), replace(
                self, per_second=1, note=self.note or "durations, converted to s"
            )
        if array.dtype.kind == "M":
            return self._since_first(array, zoned or has_zone)
        if isinstance(self.origin, np.datetime64):
            raise TraceError("the time was a date before and is a number now; give one or the other")
        numbers = numbers_of("the time", times, ", or dates as datetime64 or datetime")
        if not len(numbers):
            return numbers, self
        per_second = self.per_second or _parts_of_a_second(numbers)
        whole = array.dtype.kind in "iu" and not isinstance(array, np.ma.MaskedArray)
        origin = self.origin
        if origin is None:
            large = per_second > 1 and abs(numbers[0]) >= _SINCE_1970[-1][0]
            origin = int(array[0] if whole else numbers[0]) if large else 0
        start = f" from the first, {origin}, on" if origin else ""
        note = f"{_NAMES[per_second]}, converted to s{start}" if per_second > 1 else ""
        # The difference of large whole numbers is exact before it becomes a float.
        counted = array.astype(np.int64) - int(origin) if whole and origin else numbers - origin
        seconds = counted / per_second if per_second > 1 else numbers
        return seconds, replace(self, per_second=per_second, origin=origin, note=self.note or note)

    def _since_first(self, dates: np.ndarray, zoned: bool) -> tuple[Float[np.ndarray, " samples"], Clock]:
        if dates.ndim != 1:
            raise TraceError(f"the time must be one a sample, but its shape is {dates.shape}")
        if not len(dates):
            return np.zeros(0), self
        if self.origin is not None and not isinstance(self.origin, np.datetime64):
            raise TraceError("the time was a number before and is a date now; give one or the other")
        if self.origin is not None and zoned != self.zoned:
            raise TraceError("some times have a time zone and others have none; give all or none of them one")
        origin = dates[0] if self.origin is None else self.origin
        note = f"dates, counted in s from the first, {origin}{' UTC' if zoned else ''}, on"
        seconds = (dates - origin) / np.timedelta64(1, "s")
        return seconds, replace(self, origin=origin, zoned=zoned, note=self.note or note)


def numbers_of(what: str, column: Column, hint: str = "") -> Float[np.ndarray, " samples"]:
    """A column of numbers, NaN where one is masked or missing.

    **Raises:** `TraceError`, which names the column by `what` and ends in the hint, for anything else.
    """
    try:
        if np.asanyarray(column).dtype.kind in "mMc":
            raise TypeError
        if isinstance(column, np.ma.MaskedArray):
            numbers = np.ma.filled(column.astype(np.float64), math.nan)
        elif hasattr(column, "to_numpy") and hasattr(column, "isna"):
            numbers = column.astype("Float64").to_numpy(np.float64, na_value=math.nan)
        else:
            numbers = np.asarray(column, np.float64)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        raise TraceError(f"{what} must be numbers, one a sample{hint}") from None
    if numbers.ndim != 1:
        raise TraceError(f"{what} must be numbers, one a sample, but its shape is {numbers.shape}")
    return numbers


def _dates(times: Column) -> tuple[np.ndarray, bool]:
    """The times in an array, of `datetime64` in UTC if they are dates; and whether these had a time zone."""
    array = np.asanyarray(times)
    if isinstance(array, np.ma.MaskedArray):
        if array.dtype.kind not in "mM":
            return array, False
        return np.where(np.ma.getmaskarray(array), array.dtype.type("NaT"), array.data), False
    zoned = getattr(getattr(times, "dtype", None), "tz", None) is not None
    if array.dtype.kind != "O" or not len(array):
        return array, zoned
    if all(hasattr(time, "total_seconds") for time in array):
        # Of pandas: NaT, which is not equal to itself, has the attributes of a duration and of a date.
        return np.array([np.timedelta64(time if time == time else "NaT") for time in array]), False
    if not all(hasattr(time, "tzinfo") and hasattr(time, "year") for time in array):
        return array, False
    zones = {time.tzinfo is not None for time in array if time == time}
    if len(zones) > 1:
        raise TraceError("some times have a time zone and others have none; give all or none of them one")
    return np.array([_utc(time) for time in array], "M8[ns]"), zones == {True}


def _utc(time: Any) -> np.datetime64:
    if hasattr(time, "to_datetime64"):
        return time.to_datetime64()
    return np.datetime64(time if time.tzinfo is None else time.astimezone(UTC).replace(tzinfo=None))


def _parts_of_a_second(numbers: Float[np.ndarray, " samples"]) -> int:
    """How many of the unit of these times a second has, by what they can be."""
    if not np.all(np.isfinite(numbers) & (numbers == np.floor(numbers))):
        return 1
    for size, parts in _SINCE_1970:
        if abs(numbers[0]) >= size:
            return parts
    step = float(np.median(np.diff(numbers[:1000]))) if len(numbers) > 1 else 0.0
    return next((parts for distance, parts in _STEPS if step >= distance), 1)
