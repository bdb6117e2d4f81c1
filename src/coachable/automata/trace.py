"""A recorded motion: signals at increasing times."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from coachable.behaviours.predicates import Signal
from coachable.foundation.errors import TraceError


@dataclass(frozen=True, eq=False)
class Trace:
    """Recorded signals, sample by sample.

    **Raises:** `TraceError` if a signal has no column, if a column has another length than `time`, or if
    times are not finite and increasing.
    """

    time: Float[np.ndarray, " samples"]
    """[s]"""
    signals: tuple[Signal, ...]
    values: Mapping[str, Float[np.ndarray, "..."]]
    """By name, a number a sample for each signal, in its unit; NaN where nothing was recorded."""
    converted: tuple[str, ...] = ()
    """What was converted from another unit, a clause each."""
    clock: str = ""
    """How its times were converted to seconds, in words; empty if they were recorded in them."""

    def __post_init__(self):
        names = tuple(signal.name for signal in self.signals)
        for name in names:
            if name not in self.values:
                raise TraceError(f"signal {name} has no values")
        columns = {name: self.values[name] for name in names}
        object.__setattr__(self, "values", MappingProxyType(columns))
        require_equal_lengths(self.time, columns)
        require_increasing(self.time)

    @property
    def dt(self) -> float:
        """The time between the first two samples [s]; infinity if there are fewer."""
        return float(self.time[1] - self.time[0]) if len(self.time) > 1 else math.inf


def require_signals(signals: tuple[Signal, ...]) -> None:
    """Check that there are any.

    **Raises:** `TraceError` for a behaviour without signals, which no trace could follow or break.
    """
    if not signals:
        raise TraceError(
            "the behaviour has no signals, so a trace could show nothing of it; name its signals and write "
            "the phases in them"
        )


def require_equal_lengths(
    time: Float[np.ndarray, " samples"], columns: Mapping[str, Float[np.ndarray, "..."]]
) -> None:
    """Check that each column has one row a sample.

    **Raises:** `TraceError` for the first that has not.
    """
    for name, column in columns.items():
        if column.shape != time.shape:
            raise TraceError(f"signal {name} has {len(column)} samples, but there are {len(time)} times")


def require_increasing(
    time: Float[np.ndarray, " samples"], previous: float = -math.inf, num_before: int = 0
) -> None:
    """Check that times are finite and increase from sample to sample.

    **Arguments:** `previous`: the time of the sample before [s]; `num_before`: how many samples come before
    these, for the number of a sample in the message.

    **Raises:** `TraceError` for the first sample that breaks this.
    """
    finite = np.isfinite(time)
    if not finite.all():
        raise TraceError(f"sample {num_before + int(np.argmin(finite)) + 1}: its time is not a number")
    rises = np.diff(time, prepend=previous) > 0
    if not rises.all():
        row = int(np.argmin(rises))
        raise not_increasing(
            num_before + row + 1, float(time[row - 1]) if row else previous, float(time[row])
        )


def not_increasing(sample: int, previous: float, time: float) -> TraceError:
    """The error for a sample, counted from 1, whose time [s] is not after the one before."""
    return TraceError(
        f"sample {sample}: the time goes from {seconds(previous)} s to {seconds(time)} s; "
        f"it must increase from sample to sample"
    )


def seconds(time: float) -> str:
    """A time to the microsecond, without zeros at the end."""
    return f"{round(time, 6) + 0.0:.15g}"
