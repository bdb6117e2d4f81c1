"""A described reward without an environment: pure functions on signals in arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.classifier import array_library
from coachable.automata.cycle_progress import Pairs, Progress, along_cycle, pairs
from coachable.automata.tracker import Memory, Move, Tracker
from coachable.behaviours.behaviour import Behaviour
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.rewards.forms import BoundForm, RewardForm, Step, form_of
from coachable.rewards.forms.form import OUTSIDE, entry


class RewardMemory(NamedTuple):
    """What a run remembers from one step to the next, in any batch shape; for JAX it is a pytree."""

    phase: Memory
    """Where it is, and since when."""
    form: tuple = ()
    """What the reward form remembers."""
    cycles: tuple[Progress, ...] = ()
    """The progress along each cycle; empty without cycle bonus."""


VERDICTS: tuple[str, ...] = ("follows", "edge", "too_short", "too_long")
"""The properties of a step that hold or do not; each is a field of `StepInfo`."""


class StepInfo(NamedTuple):
    """What a step was, and what was paid for what."""

    phase: Int[Any, "*batch"]
    """The location after the step: 0 … K−1, or K outside all phases."""
    follows: Bool[Any, "*batch"]
    """Whether the step is as the form wants it; where it pays ±1, whether it pays +1."""
    edge: Bool[Any, "*batch"]
    """Whether it went along an edge."""
    too_short: Bool[Any, "*batch"]
    """Whether it left a phase before its time."""
    too_long: Bool[Any, "*batch"]
    """Whether it is still in a phase whose time is up."""
    cycles: Int[Any, "*batch"]
    """How many cycles it completed; they are counted only with a cycle bonus."""
    form: dict[str, Any]
    """What else the form has to report."""
    terms: dict[str, Float[Any, "*batch"]]
    """Parts of the reward: the form's, such as `phases` or `shaping`, and `cycles`. They add up to it."""


@dataclass(frozen=True)
class DescribedReward:
    """The reward of a behaviour for runs whose signals are in arrays of NumPy, JAX or torch.

        reward = DescribedReward(behaviour, dt=0.02)
        memory = reward.init(signals)
        memory, paid, info = reward.step(memory, signals)

    Signals are in the order of `behaviour.signal_names` along the last axis; before it there may be any
    batch. There is no other state than the memory, so both functions can be compiled and mapped. Where
    episodes begin anew in a part of a batch, take `init` for that part: `where` of NumPy, JAX or torch, leaf
    by leaf.

    **Arguments:**
        behaviour: what to pay for.
        form: how it pays, as a `RewardForm`, or the name of one that needs no arguments.
        dt: the time between two steps [s]; needed only for dwell times, and for forms that need it.
        cycle_bonus: what each completed cycle pays on top, in any form; see `along_cycle`.

    **Raises:** `ParameterError` for a `dt` that is missing or not positive, a bonus that is not finite or
    has no cycle to pay for, an unknown form, and what `RewardForm.bind` raises.
    """

    behaviour: Behaviour
    form: RewardForm | str = "stay"
    dt: int | float | None = None
    cycle_bonus: int | float = 0.0

    def __post_init__(self):
        object.__setattr__(self, "form", form_of(self.form))
        if self.dt is not None:
            real_number(self.dt, "dt", ParameterError, above=0.0)
        if self.dt is None and self.tracker.has_dwells:
            raise ParameterError(
                f"behaviour {self.behaviour.name!r} limits how long phases last, so dt is needed: the time "
                "between two steps in seconds"
            )
        real_number(self.cycle_bonus, "cycle_bonus", ParameterError)
        if self.cycle_bonus and not self.behaviour.cycles:
            raise ParameterError(f"behaviour {self.behaviour.name!r} has no cycle that a bonus could be for")
        _ = self.bound_form

    def init(self, signals: Float[Any, "*batch num_signals"]) -> RewardMemory:
        """The memory of episodes that begin with these signals."""
        return self._initial(self.tracker.start(signals), signals)

    def init_unseen(self, signals: Float[Any, "*batch num_signals"]) -> RewardMemory:
        """The memory of episodes of which nothing was seen, for signals like these.

        Their first step comes from *none yet*, for which a form that pays ±1 pays 0.
        """
        return self._initial(self.tracker.initial(signals), signals)

    def _initial(self, phase: Memory, signals: Float[Any, "*batch num_signals"]) -> RewardMemory:
        return RewardMemory(phase, *self.initial_memory(phase.location, _zero(signals)))

    def initial_memory(
        self, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]
    ) -> tuple[tuple, tuple[Progress, ...]]:
        """What form and cycles remember of episodes that begin at these locations."""
        return self.bound_form.init(location, zero), tuple(
            (location * 0,) * len(cycle) for cycle in self._cycles
        )

    def initial_info(
        self, form: tuple, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]
    ) -> dict[str, Any]:
        """What `StepInfo.form` is where no step was taken: zeros, of the same names, shapes and dtypes.

        **Arguments:** `form`: what the form remembers of episodes that begin at these locations.
        """
        _, payment = self.bound_form.pay(form, Step(Move(location, location), self.dt or 0.0, False, zero))
        return {name: array_library(zero).zeros_like(value) for name, value in payment.info.items()}

    def step(
        self,
        memory: RewardMemory,
        signals: Float[Any, "*batch num_signals"],
        terminated: Bool[Any, "*batch"] | bool = False,
        elapsed: Float[Any, "..."] | float | None = None,
    ) -> tuple[RewardMemory, Float[Any, "*batch"], StepInfo]:
        """The memory after one more step, the step's reward in the dtype of the signals, and what it was.

        **Arguments:** `terminated`, whether the step ends the episode for good, which a truncated one is
        not; `elapsed`, how long the step lasted [s], by default `dt`.
        """
        elapsed = (self.dt or 0.0) if elapsed is None else elapsed
        phase, move = self.tracker.advance(memory.phase, signals, elapsed)
        step = Step(move, elapsed, terminated, _zero(signals))
        form, cycles, paid, info = self.pay(memory.form, memory.cycles, step)
        return RewardMemory(phase, form, cycles), paid, info

    def pay(
        self, form: tuple, cycles: tuple[Progress, ...], step: Step
    ) -> tuple[tuple, tuple[Progress, ...], Float[Any, "*batch"], StepInfo]:
        """What form and cycles remember after a step, what the step pays, and what it was.

        **Arguments:** `form`, `cycles`: what they remember before it.
        """
        move, zero = step.move, step.zero
        form, payment = self.bound_form.pay(form, step)
        where = array_library(move.location).where
        after = [
            along_cycle(cycle, progress, move.previous, move.location, where)
            for cycle, progress in zip(self._cycles, cycles, strict=True)
        ]
        completed = [done for _, done in after]
        terms = dict(payment.terms)
        if self.cycle_bonus:
            terms["cycles"] = self.cycle_bonus * sum(completed, start=zero)
        no = move.location != move.location
        info = StepInfo(
            phase=move.location,
            follows=payment.follows,
            edge=entry(self._edges, move.previous, move.location),
            too_short=no if move.too_short is None else move.too_short,
            too_long=no if move.too_long is None else move.too_long,
            cycles=sum(completed, start=move.location * 0),
            form=payment.info,
            terms=terms,
        )
        return form, tuple(progress for progress, _ in after), sum(terms.values(), start=zero), info

    def observe(
        self, memory: RewardMemory, signals: Float[Any, "*batch num_signals"]
    ) -> Float[Any, "*batch numbers"]:
        """What a policy may see of the memory, in the dtype of the signals; see `observation_names`."""
        return self.observed(memory.form, memory.phase.location, _zero(signals))

    def observed(
        self, form: tuple, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]
    ) -> Float[Any, "*batch numbers"]:
        """The same for what the form remembers, and the location."""
        return array_library(zero).stack(self.bound_form.observe(form, location, zero), axis=-1)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the numbers that `observe` gives, each of them in [0, 1]."""
        return self.bound_form.observation_names

    @property
    def phase_names(self) -> tuple[str, ...]:
        """Names of the locations 0 … K."""
        return (*self.behaviour.phase_names, OUTSIDE)

    @cached_property
    def tracker(self) -> Tracker:
        """Where a run is."""
        return Tracker.of(self.behaviour, form_of(self.form).flicker)

    @cached_property
    def bound_form(self) -> BoundForm:
        """The form for this behaviour."""
        return form_of(self.form).bind(self.behaviour, self.dt)

    @cached_property
    def _edges(self) -> Bool[np.ndarray, "previous current"]:
        """Whether an edge leads from a location to another; no edge leads from *none yet*."""
        count = len(self.behaviour.phases)
        edges = np.zeros((count + 2, count + 1), bool)
        for edge in pairs(self.behaviour, self.behaviour.edges):
            edges[edge] = True
        return edges

    @cached_property
    def _cycles(self) -> tuple[Pairs, ...]:
        """The cycles that are counted."""
        counted = self.behaviour.cycles if self.cycle_bonus else ()
        return tuple(pairs(self.behaviour, cycle) for cycle in counted)


def _zero(signals: Float[Any, "*batch num_signals"]) -> Float[Any, "*batch"]:
    return array_library(signals).zeros_like(signals[..., 0])
