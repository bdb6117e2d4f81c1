"""r_or, the orthant reward of the paper, in its three readings: a table of what moves between phases pay."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, Literal

import numpy as np
from jaxtyping import Int8

from coachable.automata.classifier import array_library
from coachable.automata.cycle_progress import pairs
from coachable.automata.tracker import Move
from coachable.behaviours.behaviour import Behaviour
from coachable.foundation.data import plain, real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.rewards.forms.form import BoundForm, Payment, RewardForm, Step, entry

Variant = Literal["stay", "equation", "released"]

Edges = frozenset[tuple[int, int]]


def _stay(previous: int, current: int, edges: Edges, outside: int) -> bool:
    inside = current != outside
    return inside and (current == previous or previous == outside or (previous, current) in edges)


def _equation(previous: int, current: int, edges: Edges, outside: int) -> bool:
    return current != outside and (previous == outside or (previous, current) in edges)


def _released(previous: int, current: int, edges: Edges, outside: int) -> bool:
    last, now = (-1 if phase == outside else phase + 1 for phase in (previous, current))
    return now == last or now == (last + 1) % (outside + 1)


_PAYS: Mapping[str, Callable[[int, int, Edges, int], bool]] = MappingProxyType(
    {"stay": _stay, "equation": _equation, "released": _released}
)

VARIANTS: tuple[Variant, ...] = ("stay", "equation", "released")
"""The readings of the paper's equation (r_or)."""


def reward_table(behaviour: Behaviour, variant: str) -> Int8[np.ndarray, "previous current"]:
    """What r_or pays, +1 or −1, for going from a location (row) to a location (column); the last is outside.

    With Q the phases, E the edges, p the previous and c the current location, the table holds +1 where

    - `stay`: c ∈ Q and (c = p or p ∉ Q or (p, c) ∈ E). As in the paper's figure of the reward.
    - `equation`: c ∈ Q and (p ∉ Q or (p, c) ∈ E). As in its equation (r_or): without a self-loop in
      E, staying in a phase is punished.
    - `released`: n(c) = n(p) or n(c) = (n(p) + 1) mod (K+1), with the phases numbered n = 1 … K in their
      order and n = −1 outside. What the released code does (`_reward_follow_orthant_sequence`), which
      knows no edges: staying outside pays, entering from outside does not, and neither does going from
      the last phase to the first.

    **Raises:** `ParameterError` for an unknown variant.
    """
    if variant not in _PAYS:
        raise ParameterError(f"unknown reward variant {variant!r}; {suggestion(variant, VARIANTS)}")
    outside = len(behaviour.phases)
    edges = frozenset(pairs(behaviour, behaviour.edges))
    locations = range(outside + 1)
    pays = [
        [_PAYS[variant](previous, current, edges, outside) for current in locations] for previous in locations
    ]
    return np.where(pays, 1, -1).astype(np.int8)


class TableForm(RewardForm):
    """Pays ±1 by a table of moves; see `reward_table`."""

    def bind(self, behaviour: Behaviour, dt: int | float | None) -> BoundTable:
        """The table of the behaviour."""
        return BoundTable(self, behaviour, dt)

    def paid_by(self, behaviour: Behaviour) -> Mapping[str, object]:
        """The table."""
        return {"orthant_table": reward_table(behaviour, self.name).tolist()}


@dataclass(frozen=True)
class Stay(TableForm):
    """+1 for staying in a phase, following an edge and entering a phase from outside; −1 for all else.

    A dwell time counts on through short absences from its phase, which would otherwise undo the limit.

    **Raises:** `ParameterError` for a `flicker` that is negative or not finite.
    """

    name: ClassVar[str] = "stay"

    flicker: float | None = None  # pyright: ignore[reportIncompatibleMethodOverride]
    """The longest such absence [s]; by default one step."""
    dwells: bool | None = None
    """Whether the phases' times are judged, as by default; `False` pays as if the description had none."""

    def __post_init__(self):
        if self.flicker is not None:
            real_number(self.flicker, "flicker", ParameterError, least=0.0)
            object.__setattr__(self, "flicker", plain(self.flicker))

    @property
    def judges_dwells(self) -> bool:
        """`dwells`."""
        return self.dwells is not False


@dataclass(frozen=True)
class Equation(TableForm):
    """+1 for following an edge and entering a phase from outside; −1 for all else, staying included."""

    name: ClassVar[str] = "equation"


@dataclass(frozen=True)
class Released(TableForm):
    """The rule of the code released with the paper: +1 for staying anywhere and for going on in the order."""

    name: ClassVar[str] = "released"


@dataclass(frozen=True, eq=False)
class BoundTable(BoundForm):
    """r_or of a behaviour."""

    form: TableForm

    @property
    def judges_dwells(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As the form does."""
        return self.form.judges_dwells

    @cached_property
    def table(self) -> Int8[np.ndarray, "previous current"]:
        """What a move pays. The last row is that of *none yet*, before anything was seen: it pays 0."""
        return np.pad(reward_table(self.behaviour, self.form.name), ((0, 1), (0, 0)))

    def r_or(self, move: Move) -> Int8[Any, "*batch"]:
        """r_or(𝒪(x_t), 𝒪(x_{t−1})), eq. (r_or): ±1 by the table; a violated dwell time pays −1."""
        paid = entry(self.table, move.previous, move.location)
        if move.too_short is None or move.too_long is None or not self.judges_dwells:
            return paid
        return array_library(paid).where(move.too_short | move.too_long, -1, paid)

    @property
    def least_pay(self) -> float:
        """−1."""
        return -1.0

    def pay(self, memory: tuple, step: Step) -> tuple[tuple, Payment]:
        """±1, as the term `phases`."""
        paid = self.r_or(step.move)
        return memory, Payment({"phases": step.zero + paid}, paid > 0)
