"""Limits are quantiles of whole stays, and are written into a description where it stands."""

import math
import re

import numpy as np
import pytest

from coachable import cli
from coachable.automata.limits import limits, with_limits
from coachable.automata.trace import Trace
from coachable.behaviours import load_behaviour
from coachable.behaviours.text.document import read_document
from coachable.behaviours.text.parser import parse
from coachable.foundation.errors import ParameterError

UP_AND_DOWN = """behaviour "up and down"

signals
  h  [m]

phases
  low "bent: low" for 0.05 s to 9 s: h < 1 [m]  # a remark
  high: h > 2 [m]

cycle
  low -> high -> low
"""
BEHAVIOUR = parse(UP_AND_DOWN)


def trace(heights, dt=0.1, times=None):
    times = dt * np.arange(len(heights)) if times is None else np.array(times)
    return Trace(times, BEHAVIOUR.signals, {"h": np.array(heights, float)})


def stays(*parts, **options):
    return {
        limit.phase: (limit.stays.tolist(), limit.seconds) for limit in limits(BEHAVIOUR, parts, **options)
    }


LOW, HIGH, BETWEEN = [0.0], [3.0], [1.5]


def test_only_whole_stays_count_and_the_limit_is_their_quantile():
    heights = 5 * LOW + 3 * HIGH + 4 * LOW + 2 * HIGH + 2 * LOW + 9 * HIGH
    found = stays(trace(heights), quantile=0.5)
    assert found["low"][0] == pytest.approx([0.4, 0.2])
    assert found["high"][0] == pytest.approx([0.3, 0.2])
    assert found["low"][1] == found["high"][1] + 0.1 == pytest.approx(0.4)
    assert stays(trace(heights), quantile=0.0, slack=1.25)["low"][1] == 0.25
    assert stays(trace(heights), slack=1e-300)["low"][1] == 0.01


def test_a_trace_in_parts_is_one_trace():
    heights = 2 * LOW + 3 * HIGH + 4 * LOW + HIGH + BETWEEN
    whole = trace(heights)
    parts = [
        Trace(whole.time[rows], BEHAVIOUR.signals, {"h": whole.values["h"][rows]})
        for rows in (slice(0, 4), slice(4, 6), slice(6, None))
    ]
    assert stays(*parts) == stays(whole)


def test_what_was_not_observed_is_no_stay():
    heights = LOW + 2 * HIGH + 3 * LOW + 3 * LOW + 2 * HIGH + LOW
    times = np.append(0.1 * np.arange(6), 8 + 0.1 * np.arange(6))
    found = stays(trace(heights, times=times))
    assert found["low"] == ([], pytest.approx(math.nan, nan_ok=True))
    assert found["high"][0] == pytest.approx([0.2, 0.2])


def test_they_are_written_where_the_phase_stands_and_nothing_else_changes(tmp_path):
    path = tmp_path / "mine.behaviour"
    path.write_text(UP_AND_DOWN, encoding="utf-8")
    text = with_limits(read_document(path), {"low": 0.4, "high": 0.25})
    assert text == UP_AND_DOWN.replace("to 9 s", "to 0.4 s").replace("high:", "high for at most 0.25 s:")
    assert [phase.dwell.at_most for phase in parse(text).phases] == [0.4, 0.25]
    assert with_limits(read_document(path), {"low": math.nan}) == UP_AND_DOWN


@pytest.mark.parametrize(
    "options", [{"quantile": 1.1}, {"quantile": math.nan}, {"slack": 0.0}, {"slack": 1e308}]
)
def test_a_share_and_a_factor_are_needed(options):
    with pytest.raises(ParameterError, match=next(iter(options))):
        limits(BEHAVIOUR, [trace(LOW)], **options)


def test_the_command_measures_a_baseline_and_writes_the_description(tmp_path, capsys):
    out = tmp_path / "timed.behaviour"
    cli.main(["limits", "compass-walking", "--baseline", "virtual-gravity", "-o", str(out)])
    printed = re.findall(r"^(O\d) .* (\d\.\d+)$", capsys.readouterr().out, re.MULTILINE)
    written = load_behaviour(out)
    assert [(phase.name, phase.dwell.at_most) for phase in written.phases] == [
        (name, float(limit)) for name, limit in printed
    ]
    # The shipped file says where its limits come from.
    shipped = load_behaviour("compass-walking-timed")
    assert [phase.predicate for phase in shipped.phases] == [phase.predicate for phase in written.phases]
    for phase, other in zip(shipped.phases, written.phases, strict=True):
        assert phase.dwell.at_most == pytest.approx(other.dwell.at_most, abs=0.041)


def test_one_motion_is_needed(capsys):
    with pytest.raises(SystemExit):
        cli.main(["limits", "compass-walking"])
    assert "give a TRACE or --baseline" in capsys.readouterr().err


def test_the_time_between_rows_is_of_a_trace_and_not_of_a_baseline(capsys):
    with pytest.raises(SystemExit):
        cli.main(["limits", "compass-walking", "--baseline", "virtual-gravity", "--dt", "nan"])
    assert "--dt is for a TRACE" in capsys.readouterr().err
