"""The opponents of our monitor are asked the same question, and answer alike, before anybody is timed."""

import numpy as np
import pytest

from bench import orthants
from coachable.automata.monitor import Monitor
from coachable.automata.violation import Kind

pytest.importorskip("rtamt", reason="needs the [bench] extra")
pytest.importorskip("pycrm", reason="needs the [bench] extra")

from bench.programs import reward_machine_monitor, rtamt_monitor


@pytest.mark.parametrize("online", [True, False])
def test_rtamt_gives_our_verdicts(online):
    work, units = rtamt_monitor.prepare(1200, online)
    assert units == 1200
    assert len(work()) == 1200


def test_the_reward_machine_gives_our_verdicts():
    work, _ = reward_machine_monitor.prepare(1200)
    assert set(work()) == {-1.0, 1.0}


def test_our_verdicts_are_those_of_the_monitor_that_is_timed():
    columns = orthants.trace(1200)
    follows = orthants.our_verdicts(columns)
    _, violations = Monitor(orthants.BEHAVIOUR).feed_rows(orthants.DT * np.arange(1200), columns)
    left = [round(violation.time / orthants.DT) for violation in violations]
    assert {violation.kind for violation in violations} == {Kind.LEFT, Kind.NOT_AN_EDGE}
    firsts = 1 + np.flatnonzero(~follows & np.r_[True, follows[:-1]])
    assert left == firsts.tolist()
    assert 0 < len(left) < 40
