"""What can be earned without following a behaviour: an audit of a reward form, exact.

What a form pays depends on the locations that a robot visits, sample by sample, and on what form and clocks
remember of them. So all runs of all robots are the walks of a finite graph: a node is a memory, an edge a
sample at some location, its weight the pay. The greatest mean pay of a kind of run is the *maximum mean
cycle* of the edges that such a run may take, found by Howard's policy iteration (Cochet-Terrasson, Cohen,
Gaubert, McGettrick and Quadrat, *Numerical computation of spectral elements in max-plus algebra*, 1998).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.tracker import Memory, Move
from coachable.automata.tracker import Stay as PhaseStay
from coachable.behaviours.behaviour import Behaviour, Dwell, Edge
from coachable.behaviours.checking.findings import Finding
from coachable.behaviours.checking.regions import Regions
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import in_a_row
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import RewardForm, Schedule, Stay, Step
from coachable.rewards.mean_cycles import Exploit, Graph

MOST_NODES = 1_000_000
"""A behaviour whose runs have more memories than that is refused."""

_FEW_NODES = 20_000
"""With no more memories, about a second, the audit is part of a check."""


@dataclass(frozen=True)
class Audit:
    """What a reward form leaves open."""

    behaviour: Behaviour
    form: RewardForm
    dt: float
    exploits: tuple[Exploit, ...]
    num_memories: int


def audit(
    behaviour: Behaviour,
    form: RewardForm | str,
    dt: float = 0.01,
    slower: float | None = None,
    faster: float | None = None,
) -> Audit:
    """The most that is paid for staying in one phase, for leaving one out, and for never going round.

    A run *goes round* where it visits all phases of a cycle in their order and is in the first one again, a
    glitch of one sample elsewhere aside. A robot may be anywhere at the next sample, except where two phases
    do not touch or declared derivatives forbid the way between them; see `possible_moves`.

    **Arguments:** `form`, as in `DescribedReward`; `dt`, the time between two samples [s]; `slower`,
    `faster`: if given, also the most that is paid to runs that go round less or more often, on average, than
    once in so many seconds.

    **Raises:** `ParameterError` as `DescribedReward`, and if runs have more than `MOST_NODES` memories.
    """
    for name, seconds in (("slower", slower), ("faster", faster)):
        if seconds is not None:
            real_number(seconds, name, ParameterError, above=0.0)
            if not behaviour.cycles:
                raise ParameterError(f"{name}: behaviour {behaviour.name!r} has no cycle to go round")
    reward, names = DescribedReward(behaviour, form, dt), behaviour.phase_names
    moves = possible_moves(behaviour)
    anywhere = np.ones(len(moves), bool)
    graph = _explored(_Walker(reward), moves, MOST_NODES)
    found = _of_phases(graph, names)
    if behaviour.cycles:
        rounds = _explored(_Walker(reward, behaviour.cycles), moves, MOST_NODES)
        found.append(rounds.best("never goes round", anywhere, rounds.goes_on))
        if slower is not None:
            found.append(rounds.best_at_rate(f"goes round in more than {slower:g} s", dt / slower, 1))
        if faster is not None:
            found.append(rounds.best_at_rate(f"goes round in less than {faster:g} s", dt / faster, -1))
    found.append(graph.best("anything", anywhere))
    exploits = tuple(exploit for exploit in found if exploit is not None)
    return Audit(behaviour, reward.bound_form.form, dt, exploits, len(graph.rows))


def _of_phases(graph: Graph, names: Sequence[str]) -> list[Exploit | None]:
    """The most that is paid for staying in each phase, and for leaving it out."""
    phase = np.eye(len(names), len(names) + 1, dtype=bool)
    found = [graph.best(f"stays in {name}", only) for name, only in zip(names, phase, strict=True)]
    return found + [
        graph.best(f"never enters {name}", ~only) for name, only in zip(names, phase, strict=True)
    ]


def left_open(behaviour: Behaviour) -> Iterator[Finding]:
    """The finding of a check that says what is earned without following, where every phase has its limit.

    Without limits a robot may stay anywhere, which `camping` reports. The audit is left to `coachable audit`
    where it would take long.
    """
    on_cycle = {edge.source for cycle in behaviour.cycles for edge in cycle}
    limits = [(phase.dwell or Dwell()).at_most for phase in behaviour.phases if phase.name in on_cycle]
    if not limits or not all(map(math.isfinite, limits)):
        return
    earned, moves = [], possible_moves(behaviour)
    for form in (Stay(), Schedule(skip_fine=1.0)):
        try:
            graph = _explored(_Walker(DescribedReward(behaviour, form, 0.01)), moves, _FEW_NODES)
        except ParameterError:
            return
        found = [each for each in _of_phases(graph, behaviour.phase_names) if each is not None]
        most = max(found, key=lambda each: each.mean)
        earned.append(f"{most.mean:.2f} in the form `{form.name}` (it {most.kind})")
    yield Finding(
        "left-open",
        "note",
        (),
        f"A run that does not follow earns a sample at most {in_a_row(earned)}; one that follows earns 1.",
        "Nothing, if you train with the form `schedule`; `coachable audit` shows the rest, and the runs that "
        "earn it.",
    )


def possible_moves(behaviour: Behaviour) -> Bool[np.ndarray, "previous current"]:
    """Whether a robot can be at a location one sample after another; the last row and column are outside.

    From phase to phase it cannot where the two do not touch, or where declared derivatives forbid the way. An
    edge with an event or a reset is possible.
    """
    names = behaviour.phase_names
    regions, moves = Regions.of(behaviour), np.ones((len(names) + 1, len(names) + 1), bool)
    jumps = {(edge.source, edge.target) for edge in behaviour.edges if edge.event or edge.reset}
    for (i, one), (j, other) in itertools.permutations(enumerate(names), 2):
        if (one, other) not in jumps:
            edge = Edge(one, other)
            moves[i, j] = regions.touch(edge) is not False and regions.travelled(edge) is not False
    return moves


class _Progress(NamedTuple):
    """How far runs are along a cycle."""

    at: Int[np.ndarray, " runs"]
    """The place in the cycle; −1 in none of its phases."""
    visited: Int[np.ndarray, " runs"]
    """How many of its phases were visited in order."""
    elsewhere: Bool[np.ndarray, " runs"]
    """Whether the last sample was elsewhere: a glitch, if the next one is not."""


class _Walker:
    """Takes many runs a sample further by their locations alone. A memory is a row of numbers."""

    def __init__(self, reward: DescribedReward, cycles: Sequence[Sequence[Edge]] = ()):
        self._reward, self._dt = reward, float(reward.dt or 0.0)
        self.names = reward.phase_names
        tracker = reward.tracker
        self._clocked = tracker.has_dwells and reward.bound_form.judges_dwells
        dwells = [dwell for dwell in tracker.dwells if dwell is not None]
        times = [time for dwell in dwells for time in (dwell.at_least, dwell.at_most) if math.isfinite(time)]
        self._longest = max(times, default=0.0) + 2 * self._dt
        flicker = self._dt if tracker.flicker is None else tracker.flicker
        self._absence = flicker + self._dt / 2
        number = reward.behaviour.phase_names.index
        self._cycles = [np.array([number(edge.source) for edge in cycle]) for cycle in cycles]

    def begin(self, places: Int[np.ndarray, " runs"]) -> Float[np.ndarray, "runs numbers"]:
        """Memories of runs that begin at locations; the first number is the location."""
        zero = np.zeros(len(places))
        phase = self._reward.tracker.begun(places, zero) if self._clocked else Memory(places)
        form, _ = self._reward.initial_memory(places, zero)
        memory = (phase, form, tuple(self._begun(cycle, places) for cycle in self._cycles))
        self._structure = jax.tree.structure(memory)
        self._dtypes = [np.asarray(leaf).dtype for leaf in jax.tree.leaves(memory)]
        return self._rows(memory)

    def step(
        self, rows: Float[np.ndarray, "runs numbers"], places: Int[np.ndarray, " runs"]
    ) -> tuple[Float[np.ndarray, "runs numbers"], Float[np.ndarray, " runs"], Bool[np.ndarray, " runs"]]:
        """Memories after a sample at locations, what it pays, and whether the run went round with it."""
        columns = [column.astype(dtype) for column, dtype in zip(rows.T, self._dtypes, strict=True)]
        phase, form, progress = jax.tree.unflatten(self._structure, columns)
        zero = np.zeros(len(rows))
        after, move = Memory(places), Move(phase.location, places)
        if self._clocked:
            after, move = self._reward.tracker.moved(phase, places, self._dt)
        form, _, paid, _ = self._reward.pay(form, (), Step(move, self._dt, False, zero))
        rounds = [self._onward(*each, places) for each in zip(self._cycles, progress, strict=True)]
        round_ = np.any([completed for _, completed in rounds] or [zero > 0], axis=0)
        return self._rows((after, form, tuple(going for going, _ in rounds))), paid, round_

    def _rows(self, memory: Any) -> Float[np.ndarray, "runs numbers"]:
        """Memories that pay alike ever after are the same row: times stop where they matter no more."""
        phase, *others = memory
        stays = []
        for stay in phase.stays:
            over = stay.absent > self._absence
            time = np.where(over, 0.0, np.minimum(stay.time, self._longest))
            stays.append(PhaseStay(time, stay.entered & ~over, np.where(over, math.inf, stay.absent)))
        leaves = jax.tree.leaves((phase._replace(stays=tuple(stays)), *others))
        return np.stack([np.asarray(leaf, float) for leaf in leaves], -1).round(9)

    def _begun(self, cycle: Int[np.ndarray, " phases"], places: Int[np.ndarray, " runs"]) -> _Progress:
        at = self._position(cycle, places)
        return _Progress(at, (at >= 0).astype(int), np.zeros(len(places), bool))

    def _position(
        self, cycle: Int[np.ndarray, " phases"], places: Int[np.ndarray, " runs"]
    ) -> Int[np.ndarray, " runs"]:
        hits = places[:, None] == cycle
        return np.where(hits.any(1), hits.argmax(1), -1)

    def _onward(
        self, cycle: Int[np.ndarray, " phases"], progress: _Progress, places: Int[np.ndarray, " runs"]
    ) -> tuple[_Progress, Bool[np.ndarray, " runs"]]:
        """The progress after a sample, and whether it completes a round."""
        at, visited, elsewhere = progress
        next_at = np.where(at < 0, self._position(cycle, places), (at + 1) % len(cycle))
        stays = (at >= 0) & (places == cycle[at])
        goes = (at >= 0) & ~stays & (places == cycle[next_at])
        glitch = (at >= 0) & ~stays & ~goes & ~elsewhere
        anew = ~stays & ~goes & ~glitch
        fresh = self._begun(cycle, places)
        count = visited + goes
        completed = count > len(cycle)
        after = _Progress(
            np.where(anew, fresh.at, np.where(goes, next_at, at)),
            np.where(anew, fresh.visited, np.where(completed, 1, count)),
            glitch,
        )
        return after, completed


def _explored(walker: _Walker, moves: Bool[np.ndarray, "previous current"], most_nodes: int) -> Graph:
    """Every memory that a run can have, breadth first."""
    rows = walker.begin(np.arange(len(moves)))
    number = {row.tobytes(): index for index, row in enumerate(rows)}
    kept, edges, frontier, done = [rows], [], rows, 0
    while len(frontier):
        before, place = np.nonzero(moves[frontier[:, 0].astype(int)])
        after, paid, rounds = walker.step(frontier[before], place)
        count, targets = len(number), np.empty(len(after), int)
        for index, row in enumerate(after):
            targets[index] = number.setdefault(row.tobytes(), len(number))
        new, first = np.unique(targets, return_index=True)
        edges.append((before + done, targets, paid, ~rounds))
        done += len(frontier)
        if len(number) > most_nodes:
            raise ParameterError(
                f"runs of this behaviour have more than {most_nodes:,} memories; give a larger dt, or "
                "shorter limits"
            )
        frontier = after[first[new >= count]]
        kept.append(frontier)
    source, target, paid, goes_on = map(np.concatenate, zip(*edges, strict=True))
    order = np.argsort(source, kind="stable")
    return Graph(
        walker.names,
        np.concatenate(kept),
        len(rows),
        source[order],
        target[order],
        paid[order],
        goes_on[order],
    )
