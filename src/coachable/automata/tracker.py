"""Where a run is, given where it was: the phase with its memory, which deadbands and dwell times need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.classifier import Classifier, array_library, holds_at
from coachable.behaviours.behaviour import Behaviour, Dwell, Phase
from coachable.behaviours.predicates import Comparison, Predicate
from coachable.behaviours.rewriting import expanded, widened
from coachable.behaviours.tree import walk

CLOCK_TOLERANCE = 1e-3
"""A dwell time is violated only by more than this share of a sample: sums of steps are not exact."""


class Memory(NamedTuple):
    """What a run remembers from one sample to the next, in any batch shape; for JAX it is a pytree."""

    location: Int[Any, "*batch"]
    """A phase 0 … K−1, K outside all of them, or K+1: *none yet*, before anything was seen."""
    time: Float[Any, "*batch"] | None = None
    """From the first sample there to the last [s]; `None` without dwell times."""
    entered: Bool[Any, "*batch"] | None = None
    """Whether it was seen coming there; `None` without dwell times."""


class Move(NamedTuple):
    """What one sample brought."""

    previous: Int[Any, "*batch"]
    """Where the run was, or *none yet*."""
    location: Int[Any, "*batch"]
    """Where it is."""
    too_short: Bool[Any, "*batch"] | None = None
    """Whether it left a phase before its time; `None` without dwell times."""
    too_long: Bool[Any, "*batch"] | None = None
    """Whether it is still in a phase whose time is up; `None` without dwell times."""


@dataclass(frozen=True)
class Tracker:
    """Follows a run through the phases of a behaviour, sample by sample.

    - *Deadband*: a run that was in phase p at the last sample stays in p as long as `widened(p)` holds;
      otherwise, and for phases without a deadband, the classifier decides. With a NaN a state is outside.
    - *Dwell*: the time in a phase runs from the first sample in it. Leaving it before `at_least` is a
      violation at the sample that has left; every sample inside it beyond `at_most` is one. A phase that
      nobody saw the run enter, for it began there, is not held to its minimum.

    A behaviour without either needs no memory but the location, and nothing else is then computed. Like the
    classifier, a tracker is an immutable value, and the same code serves NumPy, JAX and torch.
    """

    classifier: Classifier
    staying: tuple[Predicate | None, ...]
    """For each phase with a deadband, where one stays in it."""
    dwells: tuple[Dwell | None, ...]
    """For each phase with a dwell time, what it is."""

    @staticmethod
    def of(behaviour: Behaviour) -> Tracker:
        """The tracker of a behaviour."""
        return Tracker(
            Classifier.of(behaviour),
            tuple(
                widened(phase.predicate) if has_deadband(phase.predicate) else None
                for phase in behaviour.phases
            ),
            tuple(map(_dwell, behaviour.phases)),
        )

    @property
    def none_yet(self) -> int:
        """K+1, the location before anything was seen."""
        return self.classifier.outside + 1

    @property
    def has_dwells(self) -> bool:
        """Whether any phase has a dwell time."""
        return any(self.dwells)

    def before_all(self, signals: Float[Any, "*batch num_signals"]) -> Memory:
        """The memory of a run of which nothing was seen, for signals like these."""
        return self._fresh(signals, self.classifier(signals) * 0 + self.none_yet)

    def start(self, signals: Float[Any, "*batch num_signals"]) -> Memory:
        """The memory of a run that starts here: it is in a phase, but nobody saw it come."""
        return self._fresh(signals, self.classifier(signals))

    def advance(
        self, memory: Memory, signals: Float[Any, "*batch num_signals"], dt: Float[Any, "..."] | float
    ) -> tuple[Memory, Move]:
        """The memory after one more sample, and what that sample brought.

        **Arguments:** `memory`, from the last sample; `signals`, as the classifier takes them; `dt`, the
        time between the two samples [s].
        """
        previous, location = memory.location, self.locate(signals, memory.location)
        if memory.time is None or memory.entered is None:
            return Memory(location), Move(previous, location)
        xp = array_library(signals)
        moved = location != previous
        time, tolerance = memory.time + dt, CLOCK_TOLERANCE * dt
        too_short = too_long = moved & ~moved
        for index, dwell in enumerate(self.dwells):
            if dwell is not None:
                was_there = previous == index
                too_early = memory.entered & dwell.too_short(time, tolerance)
                too_short = too_short | (was_there & moved & too_early)
                too_long = too_long | (was_there & ~moved & dwell.too_long(time, tolerance))
        after = Memory(
            location,
            xp.where(moved, 0.0, time),
            xp.where(moved, previous != self.none_yet, memory.entered),
        )
        return after, Move(previous, location, too_short, too_long)

    def locate(
        self, signals: Float[Any, "*batch num_signals"], previous: Int[Any, "*batch"]
    ) -> Int[Any, "*batch"]:
        """Where a run is that was at the location `previous` one sample ago."""
        location = self.classifier(signals)
        if any(self.staying):
            xp, values = array_library(signals), self.classifier.by_name(signals)
            known = self.classifier.known(values)
            for index, predicate in enumerate(self.staying):
                if predicate is not None:
                    stays = known & (previous == index) & holds_at(predicate, values)
                    location = xp.where(stays, index, location)
        return location

    def along(
        self, values: Mapping[str, Float[np.ndarray, " samples"]], previous: int
    ) -> Int[np.ndarray, " samples"]:
        """Where one run is at each of many samples in a row: what `locate` gives sample after sample.

        Without deadbands all samples are classified at once. With them one walks from one way out of a phase
        to the next: inside a phase with a deadband nothing counts but the first sample that is beyond it.

        **Arguments:** `values`: a column for each signal; `previous`: the location before the first sample.
        """
        location = self.classifier.locate(values)
        if not any(self.staying):
            return location
        known = self.classifier.known(values)
        outs = {
            index: np.flatnonzero(~(known & holds_at(predicate, values)))
            for index, predicate in enumerate(self.staying)
            if predicate is not None
        }
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
        return location

    def _fresh(self, signals: Float[Any, "*batch num_signals"], location: Int[Any, "*batch"]) -> Memory:
        if not self.has_dwells:
            return Memory(location)
        xp = array_library(signals)
        return Memory(location, xp.zeros_like(signals[..., 0]), location != location)


def has_deadband(predicate: Predicate) -> bool:
    """Whether any comparison in it has a deadband."""
    return any(
        comparison.deadband is not None and comparison.deadband.value > 0
        for comparison in walk(expanded(predicate), Comparison)
    )


def _dwell(phase: Phase) -> Dwell | None:
    return None if phase.dwell in (None, Dwell()) else phase.dwell


def _first_from(rows: np.ndarray, start: int, count: int) -> int:
    """The first of the (increasing) rows that is not before `start`, or else `count`."""
    position = int(np.searchsorted(rows, start))
    return int(rows[position]) if position < len(rows) else count
