"""The schedule form: pays for being in the phase that is expected now, not for being in any."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Int8

from coachable.automata.classifier import array_library
from coachable.automata.cycle_progress import pairs
from coachable.automata.tracker import CLOCK_TOLERANCE
from coachable.behaviours.behaviour import Behaviour, Dwell
from coachable.foundation.data import plain, real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import in_a_row, suggestion
from coachable.rewards.forms.form import BoundForm, Payment, RewardForm, Step, entry


class Expected(NamedTuple):
    """Where the expected run is, in any batch shape."""

    phase: Int[Any, "*batch"]
    """The expected phase 0 … K−1, or K: none, before the robot was in step."""
    time: Float[Any, "*batch"]
    """Since when it is expected [s]."""
    visited: Bool[Any, "*batch"]
    """Whether the robot has been in it since."""


class Owing(NamedTuple):
    """The same, where a fine is spread over the steps that follow."""

    phase: Int[Any, "*batch"]
    time: Float[Any, "*batch"]
    visited: Bool[Any, "*batch"]
    owed: Float[Any, "*batch"]
    """What of the fine was not charged yet."""


@dataclass(frozen=True)
class Schedule(RewardForm):
    """+1 in the expected phase, −1 in another or outside, less a fine for a phase that was passed over.

    An *expected run* of the behaviour's automaton is beside the robot. It begins with the first phase on a
    cycle that the robot is in. From the expected phase e it goes on

    - with the robot, where the robot enters a successor of e, not before e's `at_least`;
    - by itself, where e's `at_most` is over: to the target of e's first edge in the text.

    If the robot goes on from e without having been there, the rest of its time is charged: `skip_fine` for
    each step of `dt` that was left. A phase without successors stays expected: a goal.

    **Arguments:** `skip_fine`, φ from 0, phases may be passed over, to 1, passing over pays no more than
    waiting outside. `fine_spread`, whether the fine is not charged at once but taken from the steps in the
    expected phase that follow, up to 2 from each, so that no step pays less than −1: where an episode can be
    ended, a large fine is a reason to end it. Of a fine that is still owed when another one comes the larger
    one is owed. `robot_leads`, whether the robot's own pace counts; without it the expected run is a fixed
    clock, as in periodic reward composition (Siekmann et al., ICRA 2021). `durations`, how long phases are
    expected [s] by name, in place of their `at_most`.

    **Raises:** `ParameterError` for a fine that is not in [0, 1], and a duration that is not positive.
    """

    name: ClassVar[str] = "schedule"

    skip_fine: int | float = 0.0
    robot_leads: bool = True
    durations: Mapping[str, int | float] = field(default_factory=dict, hash=False)
    fine_spread: bool = False

    def __post_init__(self):
        real_number(self.skip_fine, "skip_fine", ParameterError, least=0.0, most=1.0)
        for phase, seconds in self.durations.items():
            real_number(seconds, f"durations.{phase}", ParameterError, above=0.0)
        for name in ("skip_fine", "durations"):
            object.__setattr__(self, name, plain(getattr(self, name)))

    def bind(self, behaviour: Behaviour, dt: int | float | None) -> BoundSchedule:
        """The expected run of the behaviour.

        **Raises:** `ParameterError` for a phase on a cycle without `for at most`, and without `dt`.
        """
        if dt is None:
            raise ParameterError(
                "the form 'schedule' measures how long a phase lasts, so dt is needed: the time between two "
                "steps in seconds"
            )
        for name in self.durations:
            if name not in behaviour.phase_names:
                hint = suggestion(name, behaviour.phase_names)
                raise ParameterError(f"durations: behaviour {behaviour.name!r} has no phase {name!r}; {hint}")
        bound = BoundSchedule(self, behaviour, dt)
        endless = [
            name
            for name, on_cycle, longest in zip(
                behaviour.phase_names, bound.on_cycle, bound.durations, strict=False
            )
            if on_cycle and not math.isfinite(longest)
        ]
        if endless:
            raise ParameterError(
                f"behaviour {behaviour.name!r}: the form 'schedule' needs to know how long each phase on a "
                f"cycle may last, but {in_a_row(endless)} may last for ever; write, for example, "
                "`for at most 0.3 s` after the phase's name; `coachable limits` proposes times from a "
                "recorded motion"
            )
        return bound

    def paid_by(self, behaviour: Behaviour) -> Mapping[str, object]:
        """φ, who leads, the durations, and the edges in their order."""
        return {
            "schedule": repr(self.skip_fine + 0.0),
            "robot_leads": self.robot_leads,
            "durations": [repr(float(self.durations.get(name, 0.0))) for name in behaviour.phase_names],
            "edges": pairs(behaviour, behaviour.edges),
            **({"fine_spread": True} if self.fine_spread else {}),
        }


@dataclass(frozen=True, eq=False)
class BoundSchedule(BoundForm):
    """The expected run of a behaviour."""

    judges_dwells: ClassVar[bool] = False

    form: Schedule
    dt: int | float = 0.0

    def init(self, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]) -> Expected | Owing:
        """In the phase in which a run begins, if it is one that an expected run begins with."""
        none = location * 0 + len(self.behaviour.phases)
        begins = entry(self.first_phases, location)
        begun = Expected(array_library(zero).where(begins, location, none), zero, begins)
        return Owing(*begun, zero) if self.form.fine_spread else begun

    def pay(self, memory: tuple, step: Step) -> tuple[Expected | Owing, Payment]:
        """±1 as the term `phases`, the fine as the term `passed_over`."""
        (e, c, visited, *owed), q, zero = memory, step.move.location, step.zero
        none = len(self.behaviour.phases)
        where, dtype = array_library(zero).where, zero.dtype
        at_least = entry(self._at_least, e, dtype=dtype)
        at_most = entry(self._at_most, e, dtype=dtype)
        tolerance = CLOCK_TOLERANCE * self.dt

        time = c + step.elapsed
        begins = (e == none) & entry(self.first_phases, q)
        robot_leads = entry(self._leads, e, q) & (time >= at_least - tolerance)
        schedule_leads = ~robot_leads & (time >= at_most - tolerance)
        charged = robot_leads & ~visited & (at_most < math.inf) & (at_most > time)
        fine = self.form.skip_fine * where(charged, at_most - time, zero) / self.dt

        expected = where(
            begins | robot_leads, q, where(schedule_leads, entry(self._onward, e, dtype=e.dtype), e)
        )
        begun = begins | robot_leads | schedule_leads
        time = where(begun, zero, where(time < entry(self._longest, e, dtype=dtype), time, c))
        in_step = (q == expected) & (q != none)
        after: Expected | Owing = Expected(expected, time, (visited & ~begun) | in_step)
        if owed:
            due = where(fine > owed[0], fine, owed[0])
            fine = where(in_step, where(due < 2, due, zero + 2), zero)
            after = Owing(*after, due - fine)
        terms = {"phases": where(in_step, zero + 1, zero - 1), "passed_over": zero - fine}
        return after, Payment(terms, in_step, {"expected": expected, "expected_time": time})

    @property
    def least_pay(self) -> float:
        """−1, or where a fine is charged at once what passing over the longest phase costs, if that is more.

        Who passes a phase over is in step afterwards, which pays 1, and one step of it was waited for.
        """
        passed_over = max([limit for limit in self.durations if math.isfinite(limit)], default=self.dt)
        at_once = 0.0 if self.form.fine_spread else self.form.skip_fine * (passed_over / self.dt - 1)
        return min(-1.0, 1.0 - at_once)

    def expected(self, memory: tuple, location: Int[Any, "*batch"]) -> Int[Any, "*batch"]:
        """Where the expected run is."""
        return memory[0]

    @property
    def table(self) -> Int8[np.ndarray, "expected location"]:
        """±1 by the phase that was expected, the last row if none was, and the location; times apart."""
        none = len(self.behaviour.phases)
        paid = self._leads | np.eye(none + 1, dtype=bool)
        paid[none] = self.first_phases[: none + 1]
        return np.where(paid, 1, -1).astype(np.int8)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One for each expected phase, the share of its time that is over, and whether it was visited.

        If fines are spread also what is owed, of the largest fine that there can be.
        """
        names = (*(f"expected {name}" for name in self.behaviour.phase_names), "time over", "visited")
        return (*names, "owed") if self.form.fine_spread else names

    def observe(
        self, memory: tuple, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]
    ) -> tuple[Float[Any, "*batch"], ...]:
        """Those numbers; all are 0 while no phase is expected."""
        (e, c, visited, *owed), where = memory, array_library(zero).where
        share = c / entry(np.maximum(self._at_most, self.dt), e, dtype=zero.dtype)
        return (
            *(where(e == k, zero + 1, zero) for k in range(len(self.behaviour.phases))),
            where(share < 1, share, zero + 1),
            where(visited, zero + 1, zero),
            *(each * (self.dt / max(self._longest.max(), self.dt)) for each in owed),
        )

    # Tables by the expected phase; their last row is that of none.

    @cached_property
    def _edges(self) -> Bool[np.ndarray, "expected location"]:
        """Whether an edge leads from a phase to another one; staying is no edge here."""
        count = len(self.behaviour.phases)
        edges = np.zeros((count + 1, count + 1), bool)
        for source, target in pairs(self.behaviour, self.behaviour.edges):
            edges[source, target] = source != target
        return edges

    @cached_property
    def _leads(self) -> Bool[np.ndarray, "expected location"]:
        """Whether a robot that enters a location takes the expected run along."""
        return self._edges & self.form.robot_leads

    @cached_property
    def on_cycle(self) -> Bool[np.ndarray, " expected"]:
        """Whether edges lead from a phase back to itself."""
        reached = self._edges.copy()
        for k in range(len(reached)):
            reached |= reached[:, k, None] & reached[k]
        return reached.diagonal().copy()

    @cached_property
    def first_phases(self) -> Bool[np.ndarray, " location"]:
        """Whether a run begins at a location: phases on a cycle or, if there is no cycle, all."""
        phases = np.arange(len(self.behaviour.phases) + 2) < len(self.behaviour.phases)
        return phases & (np.pad(self.on_cycle, (0, 1)) | ~self.on_cycle.any())

    @cached_property
    def _onward(self) -> Int[np.ndarray, " expected"]:
        """Where the expected run goes by itself: along the first edge, or nowhere."""
        onward = np.arange(len(self.behaviour.phases) + 1)
        for source, target in reversed(pairs(self.behaviour, self.behaviour.edges)):
            onward[source] = target if source != target else onward[source]
        return onward

    @cached_property
    def _at_least(self) -> Float[np.ndarray, " expected"]:
        return np.array([(phase.dwell or Dwell()).at_least for phase in self.behaviour.phases] + [0.0])

    @cached_property
    def durations(self) -> tuple[float, ...]:
        """How long each phase is expected [s] if the robot does not go on before."""
        return tuple(
            float(self.form.durations.get(phase.name, (phase.dwell or Dwell()).at_most))
            for phase in self.behaviour.phases
        )

    @cached_property
    def _at_most(self) -> Float[np.ndarray, " expected"]:
        """Infinite for a goal, which has no time to be over."""
        return np.where(self._edges.any(1), [*self.durations, math.inf], math.inf)

    @cached_property
    def _longest(self) -> Float[np.ndarray, " expected"]:
        """From here on a phase's time changes nothing, and is counted no further: memories come again."""
        longest = np.where(np.isfinite(self._at_most), self._at_most, self._at_least + 2 * self.dt)
        longest[-1] = 0.0
        return longest
