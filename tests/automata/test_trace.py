import math
from dataclasses import replace

import numpy as np
import pytest

from coachable.automata.trace import Trace
from coachable.behaviours import Signal
from coachable.foundation.errors import TraceError

X, Y = Signal("x", "m"), Signal("y")
TRACE = Trace(np.array([0.0, 0.1, 0.3]), (X, Y), {"x": np.arange(3.0), "y": np.array([1.0, np.nan, 2.0])})


def test_a_trace_has_the_columns_of_its_signals_and_no_others():
    assert replace(TRACE, signals=(Y,)).values.keys() == {"y"}
    assert TRACE.dt == 0.1
    assert replace(TRACE, time=np.zeros(1), values=dict.fromkeys("xy", np.zeros(1))).dt == math.inf


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"values": {"x": np.zeros(3)}}, "signal y has no values"),
        ({"time": np.zeros(0)}, "signal x has 3 samples, but there are 0 times"),
        ({"time": np.array([0.0, 0.2, 0.2])}, "sample 3: the time goes from 0.2 s to 0.2 s"),
        ({"time": np.array([0.0, 2.0, 1.0])}, "sample 3: the time goes from 2 s to 1 s"),
        ({"time": np.array([0.0, np.nan, 1.0])}, "sample 2: its time is not a number"),
        ({"time": np.array([-np.inf, 0.0, 1.0])}, "sample 1: its time is not a number"),
    ],
)
def test_what_is_no_trace_is_refused(change, message):
    with pytest.raises(TraceError, match=message):
        replace(TRACE, **change)
