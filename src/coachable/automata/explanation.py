"""The explanation of a recorded trace, as `coachable explain` prints it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv as pa_csv

from coachable.automata.clock import Clock
from coachable.automata.monitor import Monitor
from coachable.automata.monitor_report import Gaps, MonitorReport
from coachable.automata.trace import Trace, seconds
from coachable.automata.trace_file import read_trace
from coachable.automata.violation import Violation
from coachable.behaviours.behaviour import Behaviour, Edge
from coachable.foundation.data import whole_number
from coachable.foundation.errors import TraceError
from coachable.foundation.files import written_beside


@dataclass(frozen=True)
class Explanation:
    """The report on a whole trace, its first violations, and what was converted from another unit."""

    trace: str
    report: MonitorReport
    shown: tuple[Violation, ...]
    converted: tuple[str, ...] = ()


def explain(
    behaviour: Behaviour,
    trace: Path,
    dt: float | None = None,
    limit: int | None = 20,
    phases: Path | None = None,
    progress: Callable[[MonitorReport], None] = lambda report: None,
    through: Callable[[Iterable[Trace]], Iterable[Trace]] = lambda parts: parts,
) -> Explanation:
    """Monitor a recorded trace from its first row to its last, in constant memory except for the result.

    **Arguments:** `dt`, the time between rows if the file has no time column [s]; `limit`, how many
    violations to keep, `None` for all; `phases`, a CSV file to write, the phase at each moment; `progress`,
    called every some ten thousand rows; `through`, what else sees the parts of the trace, and gives them on.

    **Raises:** `TraceError` for a file that `read_trace` refuses, or without rows, and
    if `phases` is the trace itself.
    """
    if phases is not None and phases.exists() and trace.exists() and phases.samefile(trace):
        raise TraceError(f"{phases}: this is the trace; give another file for the phases")
    parts = read_trace(trace, behaviour.signals, dt)
    return explain_parts(behaviour, through(parts), str(trace), limit, phases, progress)


def explain_parts(
    behaviour: Behaviour,
    parts: Iterable[Trace],
    title: str,
    limit: int | None = 20,
    phases: Path | None = None,
    progress: Callable[[MonitorReport], None] = lambda report: None,
) -> Explanation:
    """Monitor a trace that comes in consecutive parts; the arguments are those of `explain`.

    **Raises:** `TraceError` if the trace lacks one of the behaviour's signals, or has no sample, and for a
    limit that is no whole number.
    """
    if limit is not None:
        limit = whole_number(limit, "limit", TraceError, 0, sys.maxsize)
    chunks, shown = iter(parts), []
    first = next((chunk for chunk in chunks if len(chunk.time)), None)
    if first is None:
        raise TraceError(f"{title}: there are no samples")
    intervals = np.diff(first.time)
    usual = float(np.quantile(intervals, 0.5, method="lower")) if len(intervals) else None
    monitor = Monitor(behaviour, usual, Clock.of_seconds(first.clock))
    with _phase_writer(phases, behaviour) as write:
        for chunk in chain([first], chunks):
            locations, violations = monitor.feed_rows(chunk.time, chunk.values)
            shown += violations if limit is None else violations[: max(limit - len(shown), 0)]
            write(chunk.time, locations)
            progress(monitor.report())
    return Explanation(title, monitor.report(), tuple(shown), first.converted)


def as_text(explanation: Explanation) -> str:
    """The explanation as text."""
    report, behaviour = explanation.report, explanation.report.behaviour
    total = sum(report.violations.values())
    lines = [
        f"{explanation.trace} against {behaviour.name!r}: "
        f"{report.samples:,} sample{'s' * (report.samples != 1)}, "
        f"t = {seconds(report.start or 0.0)} s to {seconds(report.end or 0.0)} s",
        *(f"  {clause}" for clause in explanation.converted),
        *([f"times were {report.clock}"] if report.clock else []),
        "",
        *_gap_line(report.gaps),
        f"  in a phase   {_percent(report.share_in_cycle)} of the samples",
        *(
            f"  {'cycles' if index == 0 else '':<13}{count} × {_walk(cycle)}"
            for index, (cycle, count) in enumerate(zip(behaviour.cycles, report.cycles, strict=True))
        ),
        "",
        *_phase_table(report),
        "",
    ]
    if report.follows:
        where = ", where it was observed" if report.gaps.count else ""
        return "\n".join([*lines, f"It follows the behaviour{where}."])
    kinds = ", ".join(f"{kind.value}: {count:,}" for kind, count in report.violations.items())
    lines += [f"It does not follow the behaviour ({kinds}):", ""]
    lines += [f"  {violation.sentence}" for violation in explanation.shown]
    if left_out := total - len(explanation.shown):
        lines.append(f"  … and {left_out:,} more; --all shows them.")
    return "\n".join(lines)


def as_json(explanation: Explanation) -> dict[str, object]:
    """The explanation as JSON values; times in seconds."""
    report, behaviour = explanation.report, explanation.report.behaviour
    return {
        "trace": explanation.trace,
        "behaviour": behaviour.name,
        "follows": report.follows,
        "converted": list(explanation.converted),
        "samples": report.samples,
        "start": report.start,
        "end": report.end,
        "clock": report.clock,
        "gaps": {
            "count": report.gaps.count,
            "total": report.gaps.total,
            "first": None if report.gaps.first is None else list(report.gaps.first),
        },
        "share_in_cycle": report.share_in_cycle,
        "cycles": [
            {"cycle": _walk(cycle), "completed": count}
            for cycle, count in zip(behaviour.cycles, report.cycles, strict=True)
        ],
        "phases": [
            {
                "phase": name,
                "share": report.samples_in[name] / report.samples,
                "stays": stays.count,
                "mean": stays.mean,
                "shortest": stays.shortest if stays.count else None,
                "longest": stays.longest if stays.count else None,
            }
            for name, stays in report.stays.items()
        ],
        "violations": {kind.value: count for kind, count in report.violations.items()},
        "first_violation": None if report.first is None else _violation(report.first),
        "shown": [_violation(violation) for violation in explanation.shown],
    }


def _gap_line(gaps: Gaps) -> list[str]:
    if gaps.first is None:
        return []
    count = f"1 gap, t = {seconds(gaps.first[0])} s to {seconds(gaps.first[1])} s"
    if gaps.count > 1:
        count = f"{gaps.count:,} gaps, the first at t = {seconds(gaps.first[0])} s"
    return [
        f"  not observed {seconds(gaps.total)} s in {count}: they count in no time, and nothing is judged"
    ]


def _violation(violation: Violation) -> dict[str, object]:
    return {
        "t": violation.time,
        "kind": violation.kind.value,
        "from": violation.source,
        "to": violation.target,
        "sentence": violation.sentence,
    }


def _phase_table(report: MonitorReport) -> list[str]:
    width = max(len("phase"), *map(len, report.stays))
    lines = [f"  {'phase':<{width}}  samples  whole stays     mean  shortest   longest [s]"]
    for name, stays in report.stays.items():
        times = [
            f"{time:.3f}" if stays.count else "–" for time in (stays.mean, stays.shortest, stays.longest)
        ]
        share = _percent(report.samples_in[name] / report.samples)
        lines.append(
            f"  {name:<{width}}  {share:>7}{stays.count:>13,}{times[0]:>9}{times[1]:>10}{times[2]:>10}"
        )
    return lines


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f} %"


def _walk(cycle: tuple[Edge, ...]) -> str:
    return " → ".join([*(edge.source for edge in cycle), cycle[0].source]) if cycle else "nothing"


@contextmanager
def _phase_writer(
    path: Path | None, behaviour: Behaviour
) -> Iterator[Callable[[np.ndarray, np.ndarray], None]]:
    """A function that writes the phase at each sample to a file, if there is one; outside it is empty."""
    if path is None:
        yield lambda times, locations: None
        return
    names = np.array([*behaviour.phase_names, ""], object)
    schema = pa.schema([("t [s]", pa.float64()), ("phase", pa.string())])
    with written_beside(path) as beside, beside.open("wb") as file, pa_csv.CSVWriter(file, schema) as writer:
        yield lambda times, locations: writer.write_batch(
            pa.record_batch([pa.array(times), pa.array(names[locations], pa.string())], schema)
        )
