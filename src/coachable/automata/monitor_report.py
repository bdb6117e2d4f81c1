"""Statistics of a monitored trace."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from coachable.automata.violation import Kind, Violation
from coachable.behaviours.behaviour import Behaviour


@dataclass(frozen=True)
class Stays:
    """Durations of the stays in a phase [s]; stays without an observed beginning or end do not count."""

    count: int = 0
    total: float = 0.0
    shortest: float = math.inf
    longest: float = 0.0

    @property
    def mean(self) -> float | None:
        """`None` without a whole stay."""
        return self.total / self.count if self.count else None

    def and_one_of(self, duration: float) -> Stays:
        """With one more stay."""
        return Stays(
            self.count + 1,
            self.total + duration,
            min(self.shortest, duration),
            max(self.longest, duration),
        )


@dataclass(frozen=True)
class Gaps:
    """Intervals without samples, in which nothing was observed."""

    count: int = 0
    total: float = 0.0
    """How long they lasted [s]."""
    first: tuple[float, float] | None = None
    """The times of the samples before and after the first one [s]."""

    def and_one(self, before: float, after: float) -> Gaps:
        """With one more gap between samples at these times."""
        return Gaps(self.count + 1, self.total + (after - before), self.first or (before, after))


@dataclass(frozen=True)
class MonitorReport:
    """Statistics of a trace, up to the last sample processed."""

    behaviour: Behaviour = field(repr=False)
    samples: int
    start: float | None
    """Time of the first sample [s]."""
    end: float | None
    """Time of the last one [s]."""
    samples_in: Mapping[str, int]
    """How many samples were in each phase."""
    stays: Mapping[str, Stays]
    """How long they were, phase by phase."""
    cycles: tuple[int, ...]
    """Completions of each of the behaviour's cycles: all its edges taken one after another, from any of
    them on."""
    violations: Mapping[Kind, int]
    """The number of violations of each kind that occurred."""
    first: Violation | None
    """The first violation."""
    gaps: Gaps = Gaps()
    """What was not observed between the first and the last sample."""
    clock: str = ""
    """How times were converted to seconds, in words; empty if they were seconds."""

    @property
    def follows(self) -> bool:
        """Whether the trace follows the behaviour, without a violation."""
        return not self.violations

    @property
    def share_in_cycle(self) -> float | None:
        """Share of the samples that were in a phase; `None` without samples."""
        return sum(self.samples_in.values()) / self.samples if self.samples else None
