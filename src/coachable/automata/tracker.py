"""The phase of a trajectory, with the memory that deadbands and dwell times need."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.classifier import Classifier, array_library
from coachable.automata.latches import Held, Latches
from coachable.behaviours.behaviour import Behaviour, Dwell, Phase

CLOCK_TOLERANCE = 1e-3
"""A dwell time is violated only by more than this share of a sample: sums of steps are not exact."""


class Stay(NamedTuple):
    """The current or the last stay in a phase, in any batch shape."""

    time: Float[Any, "*batch"]
    """From its first sample to the last sample of the run [s]."""
    entered: Bool[Any, "*batch"]
    """Whether its entry was observed."""
    absent: Float[Any, "*batch"]
    """From the first sample outside since then to the last sample [s]; 0 inside, infinite without a stay."""


class Memory(NamedTuple):
    """The memory from one sample to the next, in any batch shape; for JAX it is a pytree."""

    location: Int[Any, "*batch"]
    """A phase 0 … K−1, K outside all of them, or K+1: *none yet*, before the first sample."""
    stays: tuple[Stay, ...] = ()
    """The last stay in each phase with a dwell time, in the behaviour's order."""
    held: Held = ()
    """Which comparisons with a deadband hold; empty without deadbands."""


class Move(NamedTuple):
    """The change of location at one sample."""

    previous: Int[Any, "*batch"]
    """The location at the sample before, or *none yet*."""
    location: Int[Any, "*batch"]
    """The location at this sample."""
    too_short: Bool[Any, "*batch"] | None = None
    """Whether a phase was left too soon; `None` without dwell times."""
    too_long: Bool[Any, "*batch"] | None = None
    """Whether a phase has lasted too long; `None` without dwell times."""


@dataclass(frozen=True)
class Tracker:
    """The phases of a trajectory, sample by sample.

    - *Deadband*: each comparison with one has a memory of its own, see `Latches`. A trajectory stays in a
      phase with deadbands as long as it holds so; otherwise the first phase that does is the location. With a
      NaN a state is outside.
    - *Dwell*: the time in a phase runs from the first sample in it. Leaving it before `at_least` is a
      violation at the sample that has left; every sample inside it beyond `at_most` is one. A phase in
      which the trajectory began is not held to its minimum.
    - *Flicker*: where a phase is entered again after an absence of at most `flicker`, in whatever other
      phase or outside, its stay goes on, and its time counts on through the absence.

    A behaviour without either needs no memory but the location, and nothing else is then computed. Like the
    classifier, a tracker is an immutable value, and the same code serves NumPy, JAX and torch.
    """

    classifier: Classifier
    latches: Latches
    """The memories of the comparisons with a deadband."""
    dwells: tuple[Dwell | None, ...]
    """The dwell time of each phase that has one."""
    flicker: float | None = None
    """The longest absence through which a stay goes on [s]; `None` for one sample, 0 for none."""

    @staticmethod
    def of(behaviour: Behaviour, flicker: float | None = None) -> Tracker:
        """The tracker of a behaviour."""
        return Tracker(
            Classifier.of(behaviour),
            Latches.of([phase.predicate for phase in behaviour.phases]),
            tuple(map(_dwell, behaviour.phases)),
            flicker,
        )

    @property
    def none_yet(self) -> int:
        """K+1, the location before the first sample."""
        return self.classifier.outside + 1

    @property
    def has_dwells(self) -> bool:
        """Whether any phase has a dwell time."""
        return any(self.dwells)

    def initial(self, signals: Float[Any, "*batch num_signals"]) -> Memory:
        """The initial memory, before the first sample, for signals of this shape and dtype."""
        location = self.classifier(signals)
        return self.begun(location * 0 + self.none_yet, _zero(signals), self.latches.none(location))

    def start(self, signals: Float[Any, "*batch num_signals"]) -> Memory:
        """The memory after a first sample: a phase, whose entry was not observed."""
        location = self.classifier(signals)
        held = self.latches.after(self.latches.none(location), self.classifier.by_name(signals))
        return self.begun(location, _zero(signals), held)

    def advance(
        self, memory: Memory, signals: Float[Any, "*batch num_signals"], dt: Float[Any, "..."] | float
    ) -> tuple[Memory, Move]:
        """The memory after one more sample, and the change of location at that sample.

        **Arguments:** `memory`, from the last sample; `signals`, as the classifier takes them; `dt`, the
        time between the two samples [s].
        """
        location, held = self._located(signals, memory.location, memory.held)
        return self.moved(memory, location, dt, held)

    def moved(
        self, memory: Memory, location: Int[Any, "*batch"], dt: Float[Any, "..."] | float, held: Held = ()
    ) -> tuple[Memory, Move]:
        """The same for a run that is at a location after the sample, whatever its signals are."""
        previous = memory.location
        if not self.has_dwells:
            return Memory(location, held=held), Move(previous, location)
        where = array_library(location).where
        tolerance = CLOCK_TOLERANCE * dt
        too_short = too_long = location != location
        stays = []
        for (index, dwell), stay in zip(self._limited, memory.stays, strict=True):
            was, now = previous == index, location == index
            absent = where(was, 0.0, stay.absent + dt)
            time = stay.time + dt
            goes_on = now & (was | (absent <= (dt if self.flicker is None else self.flicker + tolerance)))
            too_short = too_short | (was & ~now & stay.entered & dwell.too_short(time, tolerance))
            too_long = too_long | (goes_on & dwell.too_long(time, tolerance))
            begins = now & ~goes_on
            stays.append(
                Stay(
                    where(begins, 0.0, time),
                    where(begins, previous != self.none_yet, stay.entered),
                    where(now, 0.0, absent),
                )
            )
        return Memory(location, tuple(stays), held), Move(previous, location, too_short, too_long)

    def locate(
        self,
        signals: Float[Any, "*batch num_signals"],
        previous: Int[Any, "*batch"],
        held: Held | None = None,
    ) -> Int[Any, "*batch"]:
        """The location at a sample, after the location `previous` at the one before.

        **Arguments:** `held`, which comparisons with a deadband held there; by default those of `previous`.
        """
        return self._located(signals, previous, held)[0]

    def _located(
        self, signals: Float[Any, "*batch num_signals"], previous: Int[Any, "*batch"], held: Held | None
    ) -> tuple[Int[Any, "*batch"], Held]:
        if not self.latches:
            return self.classifier(signals), ()
        xp, values = array_library(signals), self.classifier.by_name(signals)
        held = self.latches.after(self.latches.of_phase(previous) if held is None else held, values)
        holding = self.latches.holding(values, held)
        known = self.classifier.known(values)
        location = xp.full_like(values[self.classifier.signals[0]], self.classifier.outside, dtype=xp.int32)
        for index, holds in reversed(list(enumerate(holding))):
            location = xp.where(known & holds, index, location)
        for index, holds in enumerate(holding):
            if self.latches.keeps[index]:
                location = xp.where(known & holds & (previous == index), index, location)
        return location, held

    def along(
        self, values: Mapping[str, Float[np.ndarray, " samples"]], previous: int, held: Held | None = None
    ) -> Int[np.ndarray, " samples"]:
        """The location of one trajectory at many consecutive samples, as `locate` gives it one by one.

        Without deadbands all samples are classified at once. With them the loop steps from one exit of a
        phase to the next: inside a phase with a deadband only the first sample beyond it matters.

        **Arguments:** `values`: a column for each signal; `previous`, `held`: the location before the first
        sample, and which comparisons with a deadband held there, by default those of `previous`.
        """
        return self.along_with(values, previous, held)[0]

    def along_with(
        self, values: Mapping[str, Float[np.ndarray, " samples"]], previous: int, held: Held | None = None
    ) -> tuple[Int[np.ndarray, " samples"], Held]:
        """The same, and which comparisons with a deadband hold after the last sample."""
        if not self.latches:
            return self.classifier.locate(values), ()
        held = self.latches.of_phase(previous) if held is None else held
        columns = self.latches.along(held, values)
        known = self.classifier.known(values)
        holding = [known & holds for holds in self.latches.holding(values, columns)]
        location = np.full(len(known), self.classifier.outside, np.int32)
        for index, holds in reversed(list(enumerate(holding))):
            location[holds] = index
        outs = {i: np.flatnonzero(~holds) for i, holds in enumerate(holding) if self.latches.keeps[i]}
        ways_in = np.flatnonzero(np.isin(location, list(outs)))
        sample, count = 0, len(location)
        while sample < count:
            if previous in outs:
                out = _first_from(outs[previous], sample, count)
                location[sample:out] = previous
            else:
                out = _first_from(ways_in, sample, count)
            if out < count:
                previous = int(location[out])
            sample = out + 1
        return location, tuple(bool(column[-1]) for column in columns) if count else held

    def begun(self, location: Int[Any, "*batch"], zero: Float[Any, "*batch"], held: Held = ()) -> Memory:
        """The memory of runs that begin at locations, whatever their signals are; `zero` in their dtype."""
        if not self.has_dwells:
            return Memory(location, held=held)
        no, where = location != location, array_library(zero).where
        stays = [
            Stay(zero, no, where(location == index, zero, zero + math.inf)) for index, _ in self._limited
        ]
        return Memory(location, tuple(stays), held)

    @property
    def _limited(self) -> list[tuple[int, Dwell]]:
        """The phases with a dwell time, and that."""
        return [(index, dwell) for index, dwell in enumerate(self.dwells) if dwell is not None]


def _zero(signals: Float[Any, "*batch num_signals"]) -> Float[Any, "*batch"]:
    return array_library(signals).zeros_like(signals[..., 0])


def _dwell(phase: Phase) -> Dwell | None:
    return None if phase.dwell in (None, Dwell()) else phase.dwell


def _first_from(rows: np.ndarray, start: int, count: int) -> int:
    """The first of the (increasing) rows that is not before `start`, or else `count`."""
    position = int(np.searchsorted(rows, start))
    return int(rows[position]) if position < len(rows) else count
