"""Monitoring of recorded signals: whether they follow a behaviour, and where they do not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int

from coachable.automata.cycle_progress import Pairs, Progress, along_cycle, choose, pairs
from coachable.automata.decision_diagram import DecisionDiagram
from coachable.automata.monitor_report import MonitorReport, Stays
from coachable.automata.trace import not_increasing, require_equal_lengths, require_increasing
from coachable.automata.tracker import CLOCK_TOLERANCE, Tracker
from coachable.automata.violation import Kind, Violation
from coachable.behaviours.behaviour import Behaviour, Dwell
from coachable.foundation.errors import TraceError
from coachable.foundation.suggestion import suggestion

Column = Sequence[int | float] | np.ndarray


class Monitor:
    """A monitor of a trace, fed sample by sample or in parts, in constant memory; the parts do not matter.

    `Tracker` locates the samples, with deadbands and dwell times. A violation is a step with negative r_or in
    the variant `stay`, reported once where the reward stays negative: starting in no phase, leaving all
    phases (until the trace is back in one), a transition without an edge, leaving a phase too soon, and
    staying in one too long (until it is left).

        monitor = Monitor(load_behaviour("compass-walking"))
        for t, x in log:
            for violation in monitor.feed(t, {"theta_1": x[0], …}):
                print(violation.sentence)
        monitor.report().share_in_cycle
    """

    def __init__(self, behaviour: Behaviour):
        self.behaviour = behaviour
        self._tracker = Tracker.of(behaviour)
        self._diagram = DecisionDiagram(self._tracker)
        self._edges = frozenset(pairs(behaviour, behaviour.edges))
        self._cycles = [_Cycle(pairs(behaviour, cycle)) for cycle in behaviour.cycles]
        self._location = self._tracker.none_yet
        self._entered = False
        self._overdue = False
        self._since = self._start = self._last = math.nan
        self._samples_at = np.zeros(len(behaviour.phases) + 1, np.int64)
        self._stays = [Stays() for _ in behaviour.phases]
        self._violations: dict[Kind, int] = {}
        self._first: Violation | None = None

    @property
    def phase(self) -> str | None:
        """The phase at the last sample; `None` outside and before the first sample."""
        return self._name(self._location)

    def feed(self, t: float, values: Mapping[str, float]) -> tuple[Violation, ...]:
        """Process one sample and return its violations.

        **Arguments:** `t`, its time [s]; `values`, the signals by name, NaN where one is missing; others than
        the behaviour's are ignored.

        **Raises:** `TraceError` as `feed_rows` does.
        """
        here = self._sample(t, values)
        tolerance = 0.0 if math.isnan(self._last) else CLOCK_TOLERANCE * (t - self._last)
        target = self._diagram.locate([*here.values()], self._location)
        found = []
        if target != self._location:
            found = self._move(target, t, tolerance, here)
        elif (dwell := self._due()) is not None and t - tolerance > self._since + dwell.at_most:
            found = [self._overstay(t, here)]
        self._samples_at[target] += 1
        return self._seen(t, t, found)

    def feed_rows(
        self, times: Column, values: Mapping[str, Column]
    ) -> tuple[Int[np.ndarray, " samples"], tuple[Violation, ...]]:
        """Process the next consecutive samples.

        **Arguments:** `times` [s]; `values`, a column for each signal. A sample with a NaN in one of the
        behaviour's signals is in no phase.

        **Returns:** the location at each sample, a phase 0 … K−1 or K outside, and the violations in their
        order.

        **Raises:** `TraceError`, leaving the monitor unchanged, if a signal has no column, if a
        column is not numbers or not as long as `times`, or if times are not finite and increasing.
        """
        times, columns = self._columns(times, values)
        if not len(times):
            return np.zeros(0, np.int32), ()
        before = np.concatenate([times[:1] if math.isnan(self._last) else [self._last], times[:-1]])
        tolerances = CLOCK_TOLERANCE * (times - before)
        locations = self._tracker.along(columns, self._location)
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
                time, tolerance = float(times[change]), float(tolerances[change])
                found += self._move(int(locations[change]), time, tolerance, here(change))
            row = change
        self._samples_at += np.bincount(locations, minlength=len(self._samples_at))
        return locations, self._seen(float(times[0]), float(times[-1]), found)

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

    def _move(self, target: int, time: float, tolerance: float, here: dict[str, float]) -> list[Violation]:
        """Move to another location; the violations of that."""
        source, outside, dwell = self._location, self._tracker.classifier.outside, self._dwell()
        kinds = []
        if source == self._tracker.none_yet:
            kinds += [Kind.START_OUTSIDE] if target == outside else []
        elif target == outside:
            kinds.append(Kind.LEFT)
        elif source != outside and (source, target) not in self._edges:
            kinds.append(Kind.NOT_AN_EDGE)
        if dwell is not None and self._entered and dwell.too_short(time - self._since, tolerance):
            kinds.append(Kind.TOO_SHORT)
        found = [self._violation(kind, target, time, here) for kind in kinds]
        for cycle in self._cycles:
            cycle.advance(source, target)
        if self._entered and source != outside:
            self._stays[source] = self._stays[source].and_one_of(time - self._since)
        self._entered = source != self._tracker.none_yet
        self._location, self._since, self._overdue = target, time, False
        return found

    def _violation(self, kind: Kind, target: int, time: float, here: dict[str, float]) -> Violation:
        duration = 0.0 if kind is Kind.START_OUTSIDE else time - self._since
        source = self._name(self._location)
        return Violation(kind, time, source, self._name(target), duration, here, self.behaviour)

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

    def _sample(self, t: float, values: Mapping[str, float]) -> dict[str, float]:
        self._require_signals(values)
        if not math.isfinite(t):
            raise TraceError(f"sample {self._num_samples + 1}: its time is not a number")
        if t <= self._last:
            raise not_increasing(self._num_samples + 1, self._last, t)
        here = {name: values[name] for name in self.behaviour.signal_names}
        for name, value in here.items():
            try:
                here[name] = float(value)
            except (TypeError, ValueError):
                raise TraceError(f"signal {name} must be a number, but it is {value!r}") from None
        return here

    def _columns(
        self, times: Column, values: Mapping[str, Column]
    ) -> tuple[Float[np.ndarray, " samples"], dict[str, Float[np.ndarray, " samples"]]]:
        self._require_signals(values)
        times = _numbers("the time", times)
        columns = {name: _numbers(f"signal {name}", values[name]) for name in self.behaviour.signal_names}
        require_equal_lengths(times, columns)
        require_increasing(times, -math.inf if math.isnan(self._last) else self._last, self._num_samples)
        return times, columns

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

    def advance(self, source: int, target: int) -> None:
        case = (self._progress, source, target)
        if case not in self._after:
            self._after[case] = along_cycle(self._edges, *case, where=choose)
        self._progress, completed = self._after[case]
        self.completed += completed


def _numbers(what: str, column: Column) -> Float[np.ndarray, " samples"]:
    try:
        numbers = np.asarray(column, np.float64)
    except (TypeError, ValueError):
        raise TraceError(f"{what} must be numbers, one a sample") from None
    if numbers.ndim != 1:
        raise TraceError(f"{what} must be numbers, one a sample, but its shape is {numbers.shape}")
    return numbers
