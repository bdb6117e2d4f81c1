"""A described reward for one run, step by step in plain floats, without the cost of arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from coachable.automata.decision_diagram import DecisionDiagram
from coachable.automata.tracker import CLOCK_TOLERANCE, Move
from coachable.rewards.described_reward import VERDICTS, DescribedReward
from coachable.rewards.forms import Step

MOST_STEPS = 100_000
"""How many different steps are kept; a form whose memory takes more values is computed anew."""


class RunStep(NamedTuple):
    """A step in Python's numbers; the same object whenever the same step comes again: do not change it."""

    memory: tuple[tuple, tuple]
    """What the form and the cycles remember after it; see `RewardMemory`."""
    paid: float
    phase: str
    location: int
    cycles: int
    verdict: Mapping[str, bool]
    """Whether it `follows` the behaviour, took an `edge`, left `too_short`, stays `too_long`."""
    form: Mapping[str, bool | int | float]
    """What else the form has to report."""
    observed: Float[np.ndarray, " numbers"]
    """What a policy may see of the memory after it."""
    expected: int
    """The phase that is expected after it, or K."""


@dataclass(slots=True)
class _Stay:
    """As `tracker.Stay`, in plain numbers."""

    time: float = 0.0
    entered: bool = False
    absent: float = 0.0


class RunReward:
    """Follows one run whose signals come as plain floats, and pays it what `DescribedReward` would.

    Location and dwell times are worked out sample by sample. What a step pays depends on values that come
    again and again, so `DescribedReward.pay` is called for each of their combinations once, whichever of the
    runs that are paid alike comes to it first.
    """

    def __init__(self, reward: DescribedReward):
        self._reward = reward
        tracker = reward.tracker
        self._none_yet = tracker.none_yet
        self._locate = DecisionDiagram(tracker).step
        self._held = self._none_held = tracker.latches.none(tracker.none_yet)
        self._dwells = (*tracker.dwells, None) if tracker.has_dwells else ()
        self._flicker = tracker.flicker
        self._dt = reward.dt or 0.0
        try:
            self._steps = _steps_of(reward)
        except TypeError:  # a form of one's own may hold what cannot be hashed
            self._steps = {}
        self._first = [self._begun_at(location) for location in range(len(reward.phase_names))]
        self._location = self._none_yet
        self._memory = self._first[-1].memory
        self._stays: dict[int, _Stay] = {}
        """The last one in each phase with a dwell time."""

    def begin(self, values: Sequence[float]) -> RunStep:
        """Begin an episode with the behaviour's signals in its order; a `RunStep` that pays 0."""
        location, self._held = self._locate(values, self._none_yet, self._none_held)
        begun = self._first[location]
        self._location, self._memory = begun.location, begun.memory
        self._stays = {}
        if self._dwells and self._dwells[self._location] is not None:
            self._stays[self._location] = _Stay()
        return begun

    def step(self, values: Sequence[float], terminated: bool) -> RunStep:
        """One more step, and what it was. `begin` comes first."""
        previous = self._location
        location, self._held = self._locate(values, previous, self._held)
        too_short, too_long = self._clocked(previous, location) if self._dwells else (None, None)
        case = (self._memory, previous, location, too_short, too_long, terminated)
        step = self._steps.get(case)
        if step is None:
            if len(self._steps) >= MOST_STEPS:
                self._steps.clear()
            step = self._steps[case] = self._computed(*case)
        self._location, self._memory = location, step.memory
        return step

    def _clocked(self, previous: int, location: int) -> tuple[bool, bool]:
        """Whether a dwell time is violated, by the clock of `Tracker.advance`."""
        dt, tolerance = self._dt, CLOCK_TOLERANCE * self._dt
        for place, stay in self._stays.items():
            stay.time += dt
            stay.absent = 0.0 if place == previous else stay.absent + dt
        too_short = too_long = False
        if location != previous and (left := self._dwells[previous]) is not None:
            stay = self._stays[previous]
            too_short = stay.entered and left.too_short(stay.time, tolerance)
        if (dwell := self._dwells[location]) is not None:
            stay, longest = (
                self._stays.get(location),
                dt if self._flicker is None else self._flicker + tolerance,
            )
            if stay is not None and (location == previous or stay.absent <= longest):
                too_long, stay.absent = dwell.too_long(stay.time, tolerance), 0.0
            else:
                self._stays[location] = _Stay(entered=True)
        return too_short, too_long

    def _begun_at(self, location: int) -> RunStep:
        place, zero = np.asarray(location), np.zeros(())
        memory = self._reward.initial_memory(place, zero)
        info = _plain(self._reward.initial_info(memory[0], place, zero))
        return self._step(memory, 0.0, location, 0, dict.fromkeys(VERDICTS, False), info)

    def _computed(self, memory: tuple, *move_and_end: Any) -> RunStep:
        *move, terminated = move_and_end
        (form, cycles), move = jax.tree.map(np.asarray, (memory, Move(*move)))
        step = Step(move, self._dt, terminated, np.zeros(()))
        form, cycles, paid, info = self._reward.pay(form, cycles, step)
        paid, info = _plain((paid, info))
        verdict = {name: getattr(info, name) for name in VERDICTS}
        return self._step((form, cycles), paid, info.phase, info.cycles, verdict, info.form)

    def _step(
        self,
        memory: tuple[tuple, tuple],
        paid: float,
        location: int,
        cycles: int,
        verdict: Mapping[str, bool],
        form: Mapping[str, bool | int | float],
    ) -> RunStep:
        place = np.asarray(location)
        observed = self._reward.observed(memory[0], place, np.zeros(()))
        expected = int(self._reward.bound_form.expected(memory[0], place))
        phase = self._reward.phase_names[location]
        return RunStep(_plain(memory), paid, phase, location, cycles, verdict, form, observed, expected)


@lru_cache
def _steps_of(reward: DescribedReward) -> dict[tuple, RunStep]:
    """The steps of a reward that were computed in this process, by what they depend on."""
    return {}


def _plain(tree: Any) -> Any:
    return jax.tree.map(lambda leaf: np.asarray(leaf).item(), tree)
