"""The expected run beside a recorded trace: where the robot was in step, behind, ahead or elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse.csgraph import shortest_path

from coachable.automata.monitor import gaps_between
from coachable.automata.trace import Trace, seconds
from coachable.automata.tracker import Move, Tracker
from coachable.behaviours.behaviour import Behaviour
from coachable.foundation.errors import ParameterError
from coachable.rewards.forms import Schedule, Step
from coachable.rewards.forms.schedule import BoundSchedule

_ROWS = 4096
"""Samples that one call of the compiled program takes; the last ones are padded."""
_TAIL = 100
"""Times before a part that are remembered, to tell what is a gap at its beginning."""


class Standing(StrEnum):
    """Where a robot is, seen from the expected run."""

    IN_STEP = "in step"
    BEHIND = "behind"
    """In a phase from which fewer edges lead to the expected one than the other way."""
    AHEAD = "ahead"
    OUT_OF_PHASE = "out of phase"
    """In a phase that is as far from the expected one either way."""
    OUTSIDE = "outside"
    """In no phase."""
    NOT_BEGUN = "not begun"
    """Before the first phase on a cycle."""


@dataclass(frozen=True)
class Spell:
    """Samples in a row at which a robot was in the same place beside the expected run."""

    standing: Standing
    start: float
    """Of its first sample [s]."""
    end: float
    """Of the next one after it, or of the trace's last [s]."""
    phase: str
    """Where the robot was at its beginning."""
    expected: str
    """What was expected there."""

    @property
    def sentence(self) -> str:
        """Such as `t = 1.2 s to 1.35 s: behind, in O2 while O3 is expected`."""
        where = "outside" if self.standing is Standing.OUTSIDE else f"in {self.phase}"
        what = "" if self.standing is Standing.OUTSIDE else f"{self.standing}, "
        return (
            f"t = {seconds(self.start)} s to {seconds(self.end)} s: {what}{where} while {self.expected} is "
            "expected"
        )


@dataclass(frozen=True)
class ExpectedRun:
    """A trace beside the expected run of a behaviour."""

    time: Mapping[Standing, float]
    """How long the robot was where [s]; gaps do not count."""
    spells: tuple[Spell, ...]
    """The longest ones out of step, the longest first."""


def has_expected_run(behaviour: Behaviour) -> bool:
    """Whether the form `schedule` can pay for it: there is a cycle, and every phase on one has a limit."""
    try:
        Schedule().bind(behaviour, 1.0)
    except ParameterError:
        return False
    return bool(behaviour.cycles)


class ExpectedRunFollower:
    """Follows a trace that comes in parts with the expected run of the form `schedule`.

    **Arguments:** `most`, how many spells out of step are kept, the longest ones.

    **Raises:** `ParameterError` for a behaviour without one: a phase on a cycle has no `for at most`.
    """

    def __init__(self, behaviour: Behaviour, most: int = 5):
        self._behaviour, self._tracker, self._most = behaviour, Tracker.of(behaviour), most
        self._previous, self._held = self._tracker.none_yet, None
        self._times = np.zeros(0)
        self._dt = 0.0
        self._memory: Any = None
        self._took = dict.fromkeys(Standing, 0.0)
        self._spells: list[Spell] = []
        self._open: Spell | None = None
        Schedule().bind(behaviour, 1.0)

    @staticmethod
    def of(behaviour: Behaviour) -> ExpectedRunFollower | None:
        """The follower of a behaviour, or `None` for one without an expected run, or without a cycle."""
        return ExpectedRunFollower(behaviour) if has_expected_run(behaviour) else None

    def following(self, parts: Iterable[Trace]) -> Iterator[Trace]:
        """The same parts, each of which is followed before it is given."""
        for part in parts:
            if len(part.time):
                self._follow(part)
            yield part

    def along(
        self, time: Float[np.ndarray, " samples"], locations: Int[np.ndarray, " samples"]
    ) -> Int[np.ndarray, " samples"]:
        """The phase that is expected at each sample of a whole walk, K where none is; nothing is kept of it.

        **Arguments:** `locations`, where the robot is: 0 … K−1, or K outside.
        """
        self._dt = self._dt or (float(np.median(np.diff(time))) if len(time) > 1 else 0.0)
        memory, self._memory = self._memory, None
        try:
            return self._expected(locations, np.append(0.0, np.diff(time)), np.arange(len(time)) == 0)
        finally:
            self._memory = memory

    def run(self) -> ExpectedRun:
        """What has been followed so far."""
        spells = self._longest([*self._spells, *([self._open] if self._open else [])])
        return ExpectedRun({kind: time for kind, time in self._took.items() if time > 0}, tuple(spells))

    def _longest(self, spells: list[Spell]) -> list[Spell]:
        counted = [each for each in spells if each.standing not in (Standing.IN_STEP, Standing.NOT_BEGUN)]
        return sorted(counted, key=lambda spell: spell.start - spell.end)[: self._most]

    def _follow(self, part: Trace) -> None:
        there, self._held = self._tracker.along_with(part.values, self._previous, self._held)
        self._previous = int(there[-1])
        known = np.concatenate([self._times, part.time])
        first = len(self._times)
        gap = np.append(True, gaps_between(known))[first:]
        lasted = np.where(gap, 0.0, np.append(0.0, np.diff(known))[first:])
        self._dt = self._dt or (float(np.median(np.diff(known))) if len(known) > 1 else 0.0)
        self._times = known[-_TAIL:]
        expected = self._expected(there, lasted, gap)
        standing, kinds = self._standings[expected, there], list(Standing)
        for index, kind in enumerate(kinds):
            self._took[kind] += float(lasted[standing == index].sum())
        names = (*self._behaviour.phase_names, "outside", "outside")
        finished = []
        for row in np.flatnonzero(np.append(True, (np.diff(standing) != 0) | gap[1:])):
            kind, time = kinds[standing[row]], float(part.time[row])
            if self._open is not None and self._open.standing is kind and not gap[row]:
                continue
            if self._open is not None:
                finished.append(self._open if gap[row] else replace(self._open, end=time))
            self._open = Spell(kind, time, time, names[there[row]], names[expected[row]])
        assert self._open is not None, "a part has a sample"
        self._open = replace(self._open, end=float(part.time[-1]))
        self._spells = self._longest([*self._spells, *finished])

    def _expected(
        self,
        locations: Int[np.ndarray, " samples"],
        lasted: Float[np.ndarray, " samples"],
        anew: Bool[np.ndarray, " samples"],
    ) -> Int[np.ndarray, " samples"]:
        """The phase that is expected at each sample, by the form's own code."""
        found = []
        with jax.enable_x64(True):
            if self._memory is None:
                self._memory = self._bound.init(jnp.asarray(locations[0], jnp.int32), jnp.zeros(()))
            for start in range(0, len(locations), _ROWS):
                count = min(_ROWS, len(locations) - start)
                rows = [
                    np.pad(column[start : start + count], (0, _ROWS - count))
                    for column in (locations.astype(np.int32), lasted, anew, np.ones(len(lasted), bool))
                ]
                self._memory, expected = self._compiled(self._memory, *rows)
                found.append(np.asarray(expected)[:count])
        return np.concatenate(found)

    @cached_property
    def _bound(self) -> BoundSchedule:
        return Schedule().bind(self._behaviour, self._dt or 1.0)

    @cached_property
    def _compiled(self) -> Any:
        bound = self._bound

        def one(memory: Any, row: tuple) -> tuple[Any, Any]:
            location, lasted, anew, there = row
            begun = bound.init(location, jnp.zeros(()))
            after, _ = bound.pay(memory, Step(Move(location, location), lasted, False, jnp.zeros(())))
            after = jax.tree.map(partial(jnp.where, anew), begun, after)
            after = jax.tree.map(partial(jnp.where, there), after, memory)
            return after, after.phase

        return jax.jit(lambda memory, *columns: jax.lax.scan(one, memory, columns))

    @cached_property
    def _standings(self) -> Int[np.ndarray, "expected location"]:
        """The index of the `Standing` by what is expected, the last row if nothing is, and the location."""
        count = len(self._behaviour.phases)
        names, kinds = list(self._behaviour.phase_names), list(Standing)
        edges = np.zeros((count, count))
        for edge in self._behaviour.edges:
            edges[names.index(edge.source), names.index(edge.target)] = 1
        away = shortest_path(edges, unweighted=True)
        table = np.full((count + 1, count + 1), kinds.index(Standing.OUTSIDE))
        table[count] = kinds.index(Standing.NOT_BEGUN)
        for expected in range(count):
            for location in range(count):
                behind, ahead = away[location, expected], away[expected, location]
                kind = Standing.BEHIND if behind < ahead else Standing.AHEAD if ahead < behind else None
                kind = Standing.IN_STEP if location == expected else kind or Standing.OUT_OF_PHASE
                table[expected, location] = kinds.index(kind)
        return table


def as_text(run: ExpectedRun) -> str:
    """The run as lines for the terminal."""
    whole = sum(run.time.values())
    if not whole:
        return ""
    shares = ", ".join(f"{kind} {100 * time / whole:.1f} %" for kind, time in run.time.items())
    return "\n".join(
        [f"Beside the expected run: {shares} of the time.", *(f"  {spell.sentence}" for spell in run.spells)]
    )


def as_json(run: ExpectedRun) -> dict[str, object]:
    """The run as JSON values; times in seconds."""
    return {
        "time": {kind.value: time for kind, time in run.time.items()},
        "spells": [
            {
                "standing": spell.standing.value,
                "start": spell.start,
                "end": spell.end,
                "phase": spell.phase,
                "expected": spell.expected,
            }
            for spell in run.spells
        ],
    }
