"""Monitoring of recorded signals: whether they follow a behaviour, and where they do not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.clock import Clock, Column, numbers_of
from coachable.automata.cycle_progress import Pairs, Progress, along_cycle, choose, pairs
from coachable.automata.decision_diagram import DecisionDiagram
from coachable.automata.monitor_report import Gaps, MonitorReport, Stays
from coachable.automata.trace import (
    not_increasing,
    require_equal_lengths,
    require_increasing,
    require_signals,
    seconds,
)
from coachable.automata.tracker import CLOCK_TOLERANCE, Tracker
from coachable.automata.violation import Kind, Violation
from coachable.behaviours.behaviour import Behaviour, Dwell
from coachable.foundation.data import real_number, shown
from coachable.foundation.errors import TraceError
from coachable.foundation.suggestion import suggestion

_WINDOW = 5
"""The usual interval is the median of so many."""

_GAP = 5.0
"""An interval longer than so many usual ones is a gap."""

_NO_SECONDS = 1e5
"""Whole numbers that grow so fast from sample to sample are no seconds."""


class _Left(NamedTuple):
    """A stay that has ended, and may yet go on."""

    time: float
    """When the first sample after it was [s]."""
    since: float
    entered: bool
    overdue: bool
    absences: int


class Monitor:
    """A monitor of a trace, fed sample by sample or in parts, in constant memory; the parts do not matter.

    `Tracker` locates the samples, with deadbands and dwell times. A violation is a step with negative r_or in
    the variant `stay`, reported once where the reward stays negative: starting in no phase, leaving all
    phases (until the trace is back in one), a transition without an edge, leaving a phase too soon, and
    staying in one too long (until it is left).

    A stay goes on through an absence of at most `flicker`, as in the reward: the limit of the phase counts
    from the first sample of all. In the report each part of it is a stay of its own.

    A *gap* is an interval between samples longer than five usual ones, of which the last five have the
    median. Nothing is known of it: it counts in no time, and there is no verdict across it. What follows is
    judged like the beginning of a trace, and the report has the gaps.

        monitor = Monitor(load_behaviour("compass-walking"))
        for t, x in log:
            for violation in monitor.feed(t, {"theta_1": x[0], …}):
                print(violation.sentence)
        monitor.report().share_in_cycle

    **Arguments:** `flicker`, the longest absence through which a stay goes on [s], by default one sample;
    `dt`, the usual interval at the beginning [s]; by default it is that of the first samples,
    and a gap right behind the first one is not noticed; `clock`, how times become seconds, by default as
    the first samples show.

    **Raises:** `TraceError` for a behaviour without signals, which no trace could follow or break, a `dt`
    that is not positive and a `flicker` below zero.
    """

    def __init__(
        self,
        behaviour: Behaviour,
        dt: float | None = None,
        clock: Clock | None = None,
        flicker: float | None = None,
    ):
        require_signals(behaviour.signals)
        if dt is not None:
            real_number(dt, "dt", TraceError, above=0.0)
        if flicker is not None:
            real_number(flicker, "flicker", TraceError, least=0.0)
        self.behaviour = behaviour
        self._tracker = Tracker.of(behaviour, flicker)
        self._diagram = DecisionDiagram(self._tracker)
        self._edges = frozenset(pairs(behaviour, behaviour.edges))
        self._cycles = [_Cycle(pairs(behaviour, cycle)) for cycle in behaviour.cycles]
        self._location = self._tracker.none_yet
        self._none_held = self._held = self._tracker.latches.none(self._location)
        self._entered = False
        self._overdue = False
        self._was_outside = False
        self._left: dict[int, _Left] = {}
        self._arrived, self._absences = math.nan, 0
        self._since = self._start = self._last = math.nan
        self._clock = clock or Clock()
        self._intervals = [math.nan if dt is None else dt] * _WINDOW
        """The last ones; NaN for those that are not known."""
        self._gaps = Gaps()
        self._samples_at = np.zeros(len(behaviour.phases) + 1, np.int64)
        self._stays = [Stays() for _ in behaviour.phases]
        self._violations: dict[Kind, int] = {}
        self._first: Violation | None = None

    @property
    def phase(self) -> str | None:
        """The phase at the last sample; `None` outside and before the first sample."""
        return self._name(self._location)

    def feed(self, t: Any, values: Mapping[str, Any]) -> tuple[Violation, ...]:
        """Process one sample and return its violations.

        **Arguments:** `t`, its time [s], or a date; `values`, the signals by name, NaN where one is missing;
        others than the behaviour's are ignored.

        **Raises:** `TraceError` as `feed_rows` does.
        """
        t, here, clock = self._sample(t, values)
        self._clock = clock
        tolerance = 0.0
        if not math.isnan(self._last):
            interval = t - self._last
            tolerance = CLOCK_TOLERANCE * interval
            if _is_gap(interval, np.array(self._intervals)):
                self._begin_anew(t)
                tolerance = 0.0
            self._intervals = [*self._intervals[1:], interval]
        target, self._held = self._diagram.step([*here.values()], self._location, self._held)
        found = []
        if target != self._location:
            found = self._move(target, self._last, t, tolerance, here)
        if (dwell := self._due()) is not None and t - tolerance > self._since + dwell.at_most:
            found = [*found, self._overstay(t, here)]
        self._samples_at[target] += 1
        return self._seen(t, t, found)

    def feed_rows(
        self, times: Column, values: Mapping[str, Column]
    ) -> tuple[Int[np.ndarray, " samples"], tuple[Violation, ...]]:
        """Process the next consecutive samples.

        **Arguments:** `times` [s], or dates, or what else `Clock` converts; `values`, a column for each
        signal. A sample with a NaN in one of the behaviour's signals, or a masked one, is in no phase.

        **Returns:** the location at each sample, a phase 0 … K−1 or K outside, and the violations in their
        order.

        **Raises:** `TraceError`, leaving the monitor unchanged, if a signal has no column, if a
        column is not numbers or not as long as `times`, or if times are not finite and increasing.
        """
        times, columns, clock = self._columns(times, values)
        if not len(times):
            return np.zeros(0, np.int32), ()
        self._clock = clock
        intervals = np.diff(times, prepend=self._last)
        first = int(math.isnan(self._last))
        known = np.concatenate([self._intervals, intervals[first:]])
        before = np.lib.stride_tricks.sliding_window_view(known, _WINDOW)
        gaps = np.zeros(len(times), bool)
        gaps[first:] = _is_gap(intervals[first:], before[: len(times) - first])
        self._intervals = known[-_WINDOW:].tolist()
        tolerances = np.where(gaps | np.isnan(intervals), 0.0, CLOCK_TOLERANCE * intervals)
        locations, found = [], []
        edges = [0, *np.flatnonzero(gaps).tolist(), len(times)]
        for start, end in pairwise(edges):
            if start < end:
                if gaps[start]:
                    self._begin_anew(float(times[start]))
                part = {name: column[start:end] for name, column in columns.items()}
                there, violations = self._feed_part(times[start:end], part, tolerances[start:end])
                self._last = float(times[end - 1])
                locations.append(there)
                found += violations
        whole = np.concatenate(locations)
        self._samples_at += np.bincount(whole, minlength=len(self._samples_at))
        return whole, self._seen(float(times[0]), float(times[-1]), found)

    def _feed_part(
        self,
        times: Float[np.ndarray, " samples"],
        columns: Mapping[str, Float[np.ndarray, " samples"]],
        tolerances: Float[np.ndarray, " samples"],
    ) -> tuple[Int[np.ndarray, " samples"], list[Violation]]:
        """The locations and violations of samples without a gap between them."""
        locations, self._held = self._tracker.along_with(columns, self._location, self._held)
        came_from = np.concatenate([[self._location], locations[:-1]])
        found: list[Violation] = []

        def here(row: int) -> dict[str, float]:
            return {name: float(column[row]) for name, column in columns.items()}

        row = 0
        for change in [*np.flatnonzero(locations != came_from).tolist(), len(times)]:
            if (dwell := self._due()) is not None:
                # A time less a thousandth of the step to it still increases from row to row.
                clock = times[row:change] - tolerances[row:change]
                late = row + int(np.searchsorted(clock, self._since + dwell.at_most, side="right"))
                if late < change:
                    found.append(self._overstay(float(times[late]), here(late)))
            if change < len(times):
                before = float(times[change - 1]) if change else self._last
                time, tolerance = float(times[change]), float(tolerances[change])
                found += self._move(int(locations[change]), before, time, tolerance, here(change))
            row = change
        return locations, found

    def _begin_anew(self, time: float) -> None:
        """Forget, at the first sample after a gap, what was before it."""
        self._gaps = self._gaps.and_one(self._last, time)
        self._was_outside = self._location == self._tracker.classifier.outside
        self._location, self._entered, self._overdue = self._tracker.none_yet, False, False
        self._held, self._left, self._absences = self._none_held, {}, 0
        for cycle in self._cycles:
            cycle.begin_anew()

    def report(self) -> MonitorReport:
        """The report on all samples so far."""
        names = self.behaviour.phase_names
        return MonitorReport(
            behaviour=self.behaviour,
            samples=self._num_samples,
            start=None if math.isnan(self._start) else self._start,
            end=None if math.isnan(self._last) else self._last,
            samples_in=dict(zip(names, self._samples_at[:-1].tolist(), strict=True)),
            stays=dict(zip(names, self._stays, strict=True)),
            cycles=tuple(cycle.completed for cycle in self._cycles),
            violations=dict(self._violations),
            first=self._first,
            gaps=self._gaps,
            clock=self._clock.note,
        )

    def _name(self, location: int) -> str | None:
        return self.behaviour.phase_names[location] if location < len(self.behaviour.phases) else None

    def _due(self) -> Dwell | None:
        """The dwell time that limits the current stay, unless its violation was reported already."""
        dwell = self._dwell()
        return None if dwell is None or self._overdue or math.isinf(dwell.at_most) else dwell

    def _overstay(self, time: float, here: dict[str, float]) -> Violation:
        """The violation of staying too long."""
        self._overdue = True
        return self._violation(Kind.TOO_LONG, self._location, time, here)

    def _move(
        self, target: int, before: float, time: float, tolerance: float, here: dict[str, float]
    ) -> list[Violation]:
        """Move to another location, from the sample at `before` to that at `time`; the violations of that."""
        source, outside, dwell = self._location, self._tracker.classifier.outside, self._dwell()
        kinds = []
        if source == self._tracker.none_yet:
            kinds += [Kind.START_OUTSIDE] if target == outside and not self._was_outside else []
        elif target == outside:
            kinds.append(Kind.LEFT)
        elif source != outside and (source, target) not in self._edges:
            kinds.append(Kind.NOT_AN_EDGE)
        if dwell is not None and self._entered and dwell.too_short(time - self._since, tolerance):
            kinds.append(Kind.TOO_SHORT)
        found = [self._violation(kind, target, time, here) for kind in kinds]
        for cycle in self._cycles:
            cycle.advance(source, target)
        saw_it_begin = self._entered or self._absences > 0
        if saw_it_begin and source < outside:
            self._stays[source] = self._stays[source].and_one_of(time - self._arrived)
        if dwell is not None:
            self._left[source] = _Left(time, self._since, self._entered, self._overdue, self._absences)
        self._location, self._arrived = target, time
        left = self._left.get(target)
        flicker = self._tracker.flicker
        longest = time - before if flicker is None else flicker + tolerance
        if left is not None and time - left.time <= longest:
            self._since, self._entered, self._overdue = left.since, left.entered, left.overdue
            self._absences = left.absences + 1
        else:
            self._since, self._entered, self._overdue = time, source != self._tracker.none_yet, False
            self._absences = 0
        return found

    def _violation(self, kind: Kind, target: int, time: float, here: dict[str, float]) -> Violation:
        duration = 0.0 if kind is Kind.START_OUTSIDE else time - self._since
        source = self._name(self._location)
        absences = 0 if kind is Kind.START_OUTSIDE else self._absences
        return Violation(kind, time, source, self._name(target), duration, here, self.behaviour, absences)

    def _seen(self, first: float, last: float, found: list[Violation]) -> tuple[Violation, ...]:
        """Record processed samples and their violations."""
        if math.isnan(self._start):
            self._start = first
        self._last = last
        for violation in found:
            self._violations[violation.kind] = self._violations.get(violation.kind, 0) + 1
            self._first = self._first or violation
        return tuple(found)

    def _dwell(self) -> Dwell | None:
        return self._tracker.dwells[self._location] if self._location < len(self._stays) else None

    def _sample(self, t: Any, values: Mapping[str, Any]) -> tuple[float, dict[str, float], Clock]:
        self._require_signals(values)
        clock = self._clock
        given = t
        if t is np.ma.masked:
            t = math.nan
        elif not (isinstance(given, float) and clock.per_second == 1 and clock.origin == 0):
            times, clock = clock.seconds([given])
            t = float(times[0])
        if not math.isfinite(t):
            raise TraceError(f"sample {self._num_samples + 1}: its time is not a number")
        if t <= self._last:
            raise not_increasing(self._num_samples + 1, self._last, t)
        if isinstance(given, int | np.integer) and clock.per_second == 1 and t - self._last >= _NO_SECONDS:
            raise TraceError(
                f"sample {self._num_samples + 1}: the time goes from {seconds(self._last)} s to "
                f"{seconds(t)} s; if these are nanoseconds, give them divided by 1e9, or as datetime64"
            )
        here = {name: values[name] for name in self.behaviour.signal_names}
        for name, value in here.items():
            try:
                if isinstance(value, str | bytes):
                    raise TypeError
                here[name] = math.nan if value is np.ma.masked or value is None else float(value)
            except (TypeError, ValueError, OverflowError, RuntimeError):
                raise TraceError(f"signal {name} must be a number, but it is {shown(value)}") from None
        return t, here, clock

    def _columns(
        self, times: Column, values: Mapping[str, Column]
    ) -> tuple[Float[np.ndarray, " samples"], dict[str, Float[np.ndarray, " samples"]], Clock]:
        self._require_signals(values)
        times, clock = self._clock.seconds(times)
        columns = {name: numbers_of(f"signal {name}", values[name]) for name in self.behaviour.signal_names}
        require_equal_lengths(times, columns)
        require_increasing(times, -math.inf if math.isnan(self._last) else self._last, self._num_samples)
        return times, columns, clock

    def _require_signals(self, values: Mapping[str, object]) -> None:
        for name in self.behaviour.signal_names:
            if name not in values:
                others = [other for other in values if other not in self.behaviour.signal_names]
                raise TraceError(f"signal {name} has no value; {suggestion(name, others or values)}")

    @property
    def _num_samples(self) -> int:
        return int(self._samples_at.sum())


class _Cycle:
    """Counts completions of a closed walk, starting from any of its edges."""

    def __init__(self, edges: Pairs):
        self.completed = 0
        self._edges = edges
        self._progress: Progress = (0,) * len(edges)
        self._after: dict[tuple[Progress, int, int], tuple[Progress, bool]] = {}
        """What each move led to, for a trace makes the same few again and again."""

    def begin_anew(self) -> None:
        """Forget the progress, not the completions."""
        self._progress = (0,) * len(self._edges)

    def advance(self, source: int, target: int) -> None:
        case = (self._progress, source, target)
        if case not in self._after:
            self._after[case] = along_cycle(self._edges, *case, where=choose)
        self._progress, completed = self._after[case]
        self.completed += completed


def gaps_between(times: Float[np.ndarray, " samples"]) -> Bool[np.ndarray, " intervals"]:
    """Whether each interval between the samples [s] is a gap, as a `Monitor` has it."""
    intervals = np.diff(times)
    known = np.concatenate([np.full(_WINDOW, np.nan), intervals])
    return _is_gap(intervals, np.lib.stride_tricks.sliding_window_view(known, _WINDOW)[: len(intervals)])


def _is_gap(interval: Any, last: Float[np.ndarray, "*samples window"]) -> Any:
    """Whether an interval is a gap, after the last ones, of which those that are not known are NaN."""
    known = np.isfinite(last)
    ordered = np.sort(last, axis=-1)
    # NaN comes last. Of an even number the greater of the two in the middle counts.
    middle = known.sum(axis=-1) // 2
    usual = np.take_along_axis(ordered, middle[..., None], axis=-1)[..., 0]
    return interval > _GAP * (1 + CLOCK_TOLERANCE) * usual
