"""rtamt over a recorded walk, the whole trace at once or sample by sample."""

from __future__ import annotations

import numpy as np
import rtamt  # pyright: ignore[reportMissingImports]

from bench.orthants import our_verdicts, rtamt_specification, trace


def prepare(num_samples: int, online: bool):
    """Check that the verdicts are ours, then watch the trace; units are samples."""
    columns = trace(num_samples)
    rows = [
        (row, [(name, float(column[row])) for name, column in columns.items()]) for row in range(num_samples)
    ]
    data = {
        "time": list(range(num_samples)),
        **{name: column.tolist() for name, column in columns.items()},
    }

    def work():
        if online:
            specification = rtamt_specification(rtamt.StlDiscreteTimeOnlineSpecification())
            return [specification.update(*row) for row in rows]
        specification = rtamt_specification(rtamt.StlDiscreteTimeOfflineSpecification())
        return [robustness for _, robustness in specification.evaluate(data)]

    np.testing.assert_array_equal(np.array(work())[1:] > 0, our_verdicts(columns))
    return work, num_samples
