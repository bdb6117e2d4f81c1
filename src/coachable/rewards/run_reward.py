"""A described reward for one run, step by step in plain floats, without the cost of arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from coachable.automata.decision_diagram import DecisionDiagram
from coachable.automata.tracker import CLOCK_TOLERANCE, Move
from coachable.rewards.described_reward import VERDICTS, DescribedReward


class RunStep(NamedTuple):
    """What a step was, in Python's numbers; the same object whenever it comes again, so not to be changed."""

    gone: tuple[tuple[int, ...], ...]
    """What is gone of each cycle after it; see `RewardMemory`."""
    paid: float
    phase: str
    location: int
    cycles: int
    verdict: Mapping[str, bool]
    """Whether it `follows` the behaviour, took an `edge`, left `too_short`, stays `too_long`."""


class RunReward:
    """Follows one run whose signals come as plain floats, and pays it what `DescribedReward` would.

    Where the run is, and for how long, is worked out sample by sample. What that is worth depends on few
    values, none of them a time, so `DescribedReward.worth` is asked for each of their combinations once.
    """

    def __init__(self, reward: DescribedReward):
        self._reward = reward
        tracker = reward.phase_reward.tracker
        self._none_yet = tracker.none_yet
        self._locate = DecisionDiagram(tracker).locate
        self._dwells = (*tracker.dwells, None) if tracker.has_dwells else ()
        self._dt = reward.dt or 0.0
        self._worth: dict[tuple, RunStep] = {}
        none_gone, verdict = reward.none_gone(0), dict.fromkeys(VERDICTS, False)
        self._begun = [
            RunStep(none_gone, 0.0, name, location, 0, verdict)
            for location, name in enumerate(reward.phase_names)
        ]
        self._location, self._gone = self._none_yet, none_gone
        self._time, self._entered = 0.0, False

    def begin(self, values: Sequence[float]) -> RunStep:
        """Begin an episode with the behaviour's signals in its order; no step, but told like one."""
        begun = self._begun[self._locate(values, self._none_yet)]
        self._location, self._gone = begun.location, begun.gone
        self._time, self._entered = 0.0, False
        return begun

    def step(self, values: Sequence[float], terminated: bool) -> RunStep:
        """One more step, and what it was. `begin` comes first."""
        previous, location = self._location, self._locate(values, self._location)
        too_short, too_long = self._clocked(previous, location) if self._dwells else (None, None)
        case = (self._gone, previous, location, too_short, too_long, terminated)
        step = self._worth.get(case)
        if step is None:
            step = self._worth[case] = self._worked_out(*case)
        self._location, self._gone = location, step.gone
        return step

    def _clocked(self, previous: int, location: int) -> tuple[bool, bool]:
        """Whether a dwell time is violated, by the clock of `Tracker.advance`."""
        dwell, tolerance = self._dwells[previous], CLOCK_TOLERANCE * self._dt
        time, entered, moved = self._time + self._dt, self._entered, location != previous
        self._time, self._entered = (0.0, True) if moved else (time, entered)
        if dwell is None:
            return False, False
        if moved:
            return entered and dwell.too_short(time, tolerance), False
        return False, dwell.too_long(time, tolerance)

    def _worked_out(self, gone: tuple, *move_and_end: Any) -> RunStep:
        *move, terminated = move_and_end
        gone, move = jax.tree.map(np.asarray, (gone, Move(*move)))
        worth = self._reward.worth(gone, move, np.zeros(()), terminated)
        gone, paid, info = jax.tree.map(lambda leaf: np.asarray(leaf).item(), worth)
        verdict = {name: getattr(info, name) for name in VERDICTS}
        return RunStep(gone, paid, self._reward.phase_names[info.phase], info.phase, info.cycles, verdict)
