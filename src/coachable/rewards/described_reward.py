"""A described reward without an environment: pure functions for whoever has signals in arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.classifier import array_library
from coachable.automata.tracker import Memory, Move
from coachable.behaviours.behaviour import Behaviour, Edge
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.rewards.phase_reward import PhaseReward, Variant, beside


@dataclass(frozen=True)
class Shaping:
    """Potential-based shaping: γ Φ(phase after) − Φ(phase before), which changes no optimal policy.

    Ng, Harada and Russell, ICML 1999. Φ is 0 after a step that terminates the episode, and is what it is
    after one that truncates it.

    **Arguments:** `discount`, γ of the trainer; `potential`, Φ by the names of phases, 0 for those that are
    left out and outside all phases. By default Φ is how far the phase is along the behaviour's first cycle:
    1/n for the first of its n phases, 1 for the last.

    **Raises:** `ParameterError` for a discount that is not in [0, 1], or a potential that is not finite.
    """

    discount: int | float
    potential: Mapping[str, int | float] | None = None

    def __post_init__(self):
        if not 0 <= self.discount <= 1:
            raise ParameterError(f"discount is {self.discount!r}; it must be between 0 and 1")
        if self.potential is not None:
            object.__setattr__(self, "potential", MappingProxyType(dict(self.potential)))
            for name, value in self.potential.items():
                if not math.isfinite(value):
                    raise ParameterError(f"the potential of phase {name!r} is {value!r}; it must be finite")


class RewardMemory(NamedTuple):
    """What a run remembers from one step to the next, in any batch shape; for JAX it is a pytree."""

    phase: Memory
    """Where it is, and since when."""
    gone: tuple[tuple[Int[Any, "*batch"], ...], ...] = ()
    """For each edge of each cycle, how many of its edges in a row end with it; empty without cycle bonus."""


VERDICTS: tuple[str, ...] = ("follows", "edge", "too_short", "too_long")
"""What is said of a step in yes and no; each is a field of `StepInfo`."""


class StepInfo(NamedTuple):
    """What a step was, and what was paid for what."""

    phase: Int[Any, "*batch"]
    """The location after the step: 0 … K−1, or K outside all phases."""
    follows: Bool[Any, "*batch"]
    """Whether the step belongs to the behaviour, so that ±1 is +1."""
    edge: Bool[Any, "*batch"]
    """Whether it went along an edge."""
    too_short: Bool[Any, "*batch"]
    """Whether it left a phase before its time."""
    too_long: Bool[Any, "*batch"]
    """Whether it is still in a phase whose time is up."""
    cycles: Int[Any, "*batch"]
    """How many cycles it completed; they are counted only with a cycle bonus."""
    terms: dict[str, Float[Any, "*batch"]]
    """What is paid, by what for: `phases` or `shaping`, and `cycles`. They add up to the reward."""


@dataclass(frozen=True, eq=False)
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
        behaviour: what to pay for. variant: the reading of r_or; see `reward_table`.
        dt: the time between two steps [s]; needed only where the behaviour has dwell times.
        cycle_bonus: what each completed cycle pays on top. A cycle is completed by a step along the last of
            its edges after all others, one after another, from whichever on, as `Monitor` counts.
        shaping: pay by a potential in the place of ±1.

    **Raises:** `ParameterError` for a `dt` that is missing or not positive, a bonus that is not finite or
    has no cycle to pay for, a potential of no phase, and what `reward_table` raises.
    """

    behaviour: Behaviour
    variant: Variant = "stay"
    dt: int | float | None = None
    cycle_bonus: int | float = 0.0
    shaping: Shaping | None = None

    def __post_init__(self):
        _ = self.phase_reward, self._potential
        if self.dt is not None and not 0 < self.dt < math.inf:
            raise ParameterError(f"dt is {self.dt!r}; it must be a positive number of seconds")
        if self.dt is None and self.phase_reward.tracker.has_dwells:
            raise ParameterError(
                f"behaviour {self.behaviour.name!r} says how long phases last, so dt is needed: the time "
                "between two steps in seconds"
            )
        if not math.isfinite(self.cycle_bonus):
            raise ParameterError(f"cycle_bonus is {self.cycle_bonus!r}; it must be finite")
        if self.cycle_bonus and not self.behaviour.cycles:
            raise ParameterError(f"behaviour {self.behaviour.name!r} has no cycle that a bonus could be for")

    def init(self, signals: Float[Any, "*batch num_signals"]) -> RewardMemory:
        """The memory of episodes that begin with these signals."""
        phase = self.phase_reward.start(signals)
        return RewardMemory(phase, self.none_gone(phase.location * 0))

    def none_gone(self, none: Int[Any, "*batch"] | int) -> tuple[tuple[Any, ...], ...]:
        """What is remembered of cycles, in zeros, where nothing of any is gone along."""
        return tuple((none,) * len(cycle) for cycle in self._cycles)

    def step(
        self,
        memory: RewardMemory,
        signals: Float[Any, "*batch num_signals"],
        terminated: Bool[Any, "*batch"] | bool = False,
    ) -> tuple[RewardMemory, Float[Any, "*batch"], StepInfo]:
        """The memory after one more step, the step's reward in the dtype of the signals, and what it was.

        **Arguments:** `terminated`, whether the step ends the episode for good, which matters to shaping
        alone. A truncated episode is not terminated.
        """
        phase, move = self.phase_reward.tracker.advance(memory.phase, signals, self.dt or 0.0)
        zero = array_library(signals).zeros_like(signals[..., 0])
        gone, paid, info = self.worth(memory.gone, move, zero, terminated)
        return RewardMemory(phase, gone), paid, info

    def worth(
        self,
        gone: tuple[tuple[Any, ...], ...],
        move: Move,
        zero: Float[Any, "*batch"],
        terminated: Bool[Any, "*batch"] | bool,
    ) -> tuple[tuple[tuple[Any, ...], ...], Float[Any, "*batch"], StepInfo]:
        """What is gone of each cycle after a move, what the move pays, and what it was.

        **Arguments:** `gone`, of each cycle before the move; `zero`, in the form of what is to be paid.
        """
        pay = self.phase_reward.pay(move)
        no = move.location != move.location
        gone, completed = self._count(gone, move)
        if self.shaping is None:
            terms = {"phases": zero + pay}
        else:
            before, after = (self._potential_at(place, zero) for place in (move.previous, move.location))
            after = array_library(zero).where(no | terminated, zero, after)
            terms = {"shaping": self.shaping.discount * after - before}
        if self.cycle_bonus:
            terms["cycles"] = self.cycle_bonus * sum(completed, start=zero)
        info = StepInfo(
            phase=move.location,
            follows=pay > 0,
            edge=beside(self._edges, move.location)[move.previous, move.location],
            too_short=no if move.too_short is None else move.too_short,
            too_long=no if move.too_long is None else move.too_long,
            cycles=sum(completed, start=move.location * 0),
            terms=terms,
        )
        return gone, sum(terms.values(), start=zero), info

    @cached_property
    def phase_reward(self) -> PhaseReward:
        """±1."""
        return PhaseReward.of(self.behaviour, self.variant)

    @property
    def phase_names(self) -> tuple[str, ...]:
        """What the locations 0 … K are called."""
        return (*self.behaviour.phase_names, "outside")

    @cached_property
    def _edges(self) -> Bool[np.ndarray, "previous current"]:
        """Whether an edge leads from a location to another; no edge leads from *none yet*."""
        count = len(self.behaviour.phases)
        edges = np.zeros((count + 2, count + 1), bool)
        for edge in self.behaviour.edges:
            edges[self._pair(edge)] = True
        return edges

    @cached_property
    def _cycles(self) -> tuple[tuple[tuple[int, int], ...], ...]:
        """The cycles that are counted."""
        counted = self.behaviour.cycles if self.cycle_bonus else ()
        return tuple(tuple(map(self._pair, cycle)) for cycle in counted)

    def _pair(self, edge: Edge) -> tuple[int, int]:
        place = self.behaviour.phase_names.index
        return place(edge.source), place(edge.target)

    def _count(
        self, gone: tuple[tuple[Any, ...], ...], move: Move
    ) -> tuple[tuple[tuple[Int[Any, "*batch"], ...], ...], list[Bool[Any, "*batch"]]]:
        """How far the run is along each cycle, and whether that cycle is now completed."""
        xp = array_library(move.location)
        moved = move.location != move.previous
        after, completed = [], []
        for edges, before in zip(self._cycles, gone, strict=True):
            now, done = [], move.location != move.location
            for index, (source, target) in enumerate(edges):
                along = (move.previous == source) & (move.location == target)
                now.append(xp.where(moved, xp.where(along, before[index - 1] + 1, 0), before[index]))
                done = done | (now[-1] == len(edges))
            completed.append(done)
            after.append(tuple(xp.where(done, 0, count) for count in now))
        return tuple(after), completed

    @cached_property
    def _potential(self) -> Float[np.ndarray, " locations"]:
        """Φ of the locations 0 … K."""
        potential = np.zeros(len(self.behaviour.phases) + 1)
        if self.shaping is None:
            return potential
        names = self.behaviour.phase_names
        given = self.shaping.potential
        if given is None:
            if not self.behaviour.cycles:
                raise ParameterError(
                    f"behaviour {self.behaviour.name!r} has no cycle to make progress along; give the "
                    "potential of its phases"
                )
            cycle = tuple(dict.fromkeys(edge.source for edge in self.behaviour.cycles[0]))
            given = {name: (index + 1) / len(cycle) for index, name in enumerate(cycle)}
        for name, value in given.items():
            if name not in names:
                raise ParameterError(f"potential of an unknown phase {name!r}; {suggestion(name, names)}")
            potential[names.index(name)] = value
        return potential

    def _potential_at(self, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]) -> Float[Any, "*batch"]:
        xp = array_library(zero)
        return sum(
            (xp.where(location == k, zero + phi, zero) for k, phi in enumerate(self._potential.tolist())),
            zero,
        )
