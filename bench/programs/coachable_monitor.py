"""Our monitor over a recorded walk, in chunks or sample by sample."""

from __future__ import annotations

import numpy as np

from bench.orthants import BEHAVIOUR, DT, trace
from coachable.automata.monitor import Monitor

ROWS = 1 << 16


def prepare(num_samples: int, online: bool):
    """Watch the trace, its violations told with what explains them; units are samples."""
    columns = trace(num_samples)
    times = DT * np.arange(num_samples)
    samples = [
        (float(times[row]), {name: float(column[row]) for name, column in columns.items()})
        for row in range(num_samples if online else 0)
    ]

    def in_chunks():
        monitor = Monitor(BEHAVIOUR)
        for start in range(0, num_samples, ROWS):
            rows = slice(start, start + ROWS)
            monitor.feed_rows(times[rows], {name: column[rows] for name, column in columns.items()})
        return monitor.report()

    def one_by_one():
        monitor = Monitor(BEHAVIOUR)
        for t, values in samples:
            monitor.feed(t, values)
        return monitor.report()

    return one_by_one if online else in_chunks, num_samples
