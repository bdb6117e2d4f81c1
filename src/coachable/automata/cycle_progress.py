"""How far a run is along the cycles of a behaviour, and when it completes one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from coachable.behaviours.behaviour import Behaviour, Edge

Pairs = tuple[tuple[int, int], ...]
"""Edges as (source, target), phases by their numbers."""

Progress = tuple[Int[Any, "*batch"] | int, ...]
"""For each edge of a cycle, how many of its edges in a row end with it."""


def pairs(behaviour: Behaviour, edges: Sequence[Edge]) -> Pairs:
    """Edges of a behaviour by the numbers of their phases."""
    number = behaviour.phase_names.index
    return tuple((number(edge.source), number(edge.target)) for edge in edges)


def along_cycle(
    cycle: Pairs,
    progress: Progress,
    previous: Int[Any, "*batch"] | int,
    location: Int[Any, "*batch"] | int,
    where: Callable[[Any, Any, Any], Any],
) -> tuple[Progress, Bool[Any, "*batch"] | bool]:
    """The progress along a cycle after a move, and whether the move completes it.

    A cycle is completed by a move along the last of its edges after all others, one after another, from
    whichever on; the count then begins anew. A move along none of its edges sets it back to 0, and a sample
    in the same phase leaves it as it is.

    **Arguments:** `previous`, `location`: of the move, as integers or arrays; `where`: the conditional of
    their library, `choose` for Python's integers.
    """
    moved = location != previous
    completed = location != location
    after = []
    for index, (source, target) in enumerate(cycle):
        along = (previous == source) & (location == target)
        after.append(where(moved, where(along, progress[index - 1] + 1, 0), progress[index]))
        completed = completed | (after[-1] == len(cycle))
    return tuple(where(completed, 0, count) for count in after), completed


def completed_cycles(behaviour: Behaviour, locations: Int[np.ndarray, " samples"]) -> int:
    """How many times a sequence of locations completes any of a behaviour's cycles, as a `Monitor` counts.

    **Arguments:** `locations`: a phase 0 … K−1 at each sample, or K outside.
    """
    moves = np.flatnonzero(np.diff(locations))
    cycles = [pairs(behaviour, cycle) for cycle in behaviour.cycles]
    progress: list[Progress] = [(0,) * len(cycle) for cycle in cycles]
    count = 0
    for source, target in zip(locations[moves].tolist(), locations[moves + 1].tolist(), strict=True):
        for index, cycle in enumerate(cycles):
            progress[index], completed = along_cycle(cycle, progress[index], source, target, choose)
            count += bool(completed)
    return count


def choose(condition: bool, one: Any, other: Any) -> Any:
    """`where` for Python's own values."""
    return one if condition else other
