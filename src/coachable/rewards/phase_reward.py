"""r_or, the orthant reward, for any behaviour: a tracker, and a table of what steps between phases pay."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Int8

from coachable.automata.classifier import Classifier, array_library
from coachable.automata.tracker import Memory, Move, Tracker
from coachable.behaviours.behaviour import Behaviour
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion

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


_PAYS: Mapping[Variant, Callable[[int, int, Edges, int], bool]] = MappingProxyType(
    {"stay": _stay, "equation": _equation, "released": _released}
)

VARIANTS: tuple[Variant, ...] = tuple(_PAYS)
"""The readings of the paper's equation (r_or)."""


def reward_table(behaviour: Behaviour, variant: Variant) -> Int8[np.ndarray, "previous current"]:
    """What r_or pays, +1 or −1, for going from a location (row) to a location (column); the last is outside.

    With Q the phases, E the edges, p the previous and c the current location, the table holds +1 where

    - `stay`: c ∈ Q and (c = p or p ∉ Q or (p, c) ∈ E). What the paper's figure of the reward says.
    - `equation`: c ∈ Q and (p ∉ Q or (p, c) ∈ E). What its equation (r_or) says: without a self-loop in
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
    index = {name: position for position, name in enumerate(behaviour.phase_names)}
    edges = frozenset((index[edge.source], index[edge.target]) for edge in behaviour.edges)
    locations = range(outside + 1)
    pays = [
        [_PAYS[variant](previous, current, edges, outside) for current in locations] for previous in locations
    ]
    return np.where(pays, 1, -1).astype(np.int8)


def beside(table: np.ndarray, like: Any) -> Any:
    """A table in the library of an array, and in torch on its device, so that it can be looked up there."""
    xp = array_library(like)
    if xp is np:
        return table
    return xp.asarray(table, device=like.device) if xp.__name__ == "torch" else xp.asarray(table)


class PhaseReward(eqx.Module):
    """r_or of a behaviour: where a state is, and what it pays to have come there.

    A location is a phase 0 … K−1, K outside all of them, or, only as the previous one, K+1: *none yet*,
    before anything was seen. The row of *none yet* is all 0, so whoever steps an environment never asks
    whether there is a previous location. A run that starts from a known state starts from that state's
    location; one that starts like the released code starts from *none yet*, and its first step pays nothing.

    What a run has to remember is one small `Memory`. `start`, `before_all` and `advance` take arrays of
    NumPy, JAX and torch, in any batch shape.
    """

    table: Int8[Array, "previous current"]
    tracker: Tracker = eqx.field(static=True)

    @staticmethod
    def of(behaviour: Behaviour, variant: Variant = "stay") -> "PhaseReward":
        """The phase reward of a behaviour; see `reward_table` for the variants."""
        table = np.pad(reward_table(behaviour, variant), ((0, 1), (0, 0)))
        return PhaseReward(jnp.asarray(table), Tracker.of(behaviour))

    @property
    def classifier(self) -> Classifier:
        """𝒪, which knows no memory."""
        return self.tracker.classifier

    @property
    def outside(self) -> int:
        """K, the location of a state in no phase."""
        return self.classifier.outside

    @property
    def none_yet(self) -> int:
        """K+1, the previous location before anything was seen."""
        return self.tracker.none_yet

    def locate(self, signals: Float[Array, "*batch num_signals"]) -> Int[Array, "*batch"]:
        """𝒪(x): the location of a state of which nothing is remembered; see `Classifier`."""
        return jnp.asarray(self.classifier(signals))

    def start(self, signals: Float[Any, "*batch num_signals"]) -> Memory:
        """The memory of a run that starts from these signals."""
        return self.tracker.start(signals)

    def before_all(self, signals: Float[Any, "*batch num_signals"]) -> Memory:
        """The memory of a run of which nothing was seen yet, for signals like these."""
        return self.tracker.initial(signals)

    def advance(
        self, memory: Memory, signals: Float[Any, "*batch num_signals"], dt: Float[Any, "..."] | float
    ) -> tuple[Memory, Move, Int8[Any, "*batch"]]:
        """The memory after one more sample, what the sample brought, and what it pays: +1, −1, or 0 at first.

        **Arguments:** `memory`, from the last sample; `signals`, in the order of the classifier's, along
        the last axis; `dt`, the time between the two samples [s].
        """
        memory, move = self.tracker.advance(memory, signals, dt)
        return memory, move, self.pay(move)

    def pay(self, move: Move) -> Int8[Any, "*batch"]:
        """r_or(𝒪(x_t), 𝒪(x_{t−1})), by the table; a violated dwell time pays −1."""
        table = self.table
        if not isinstance(move.location, Array):
            table = beside(np.array(table), move.location)
        paid = table[move.previous, move.location]
        if move.too_short is None or move.too_long is None:
            return paid
        return array_library(paid).where(move.too_short | move.too_long, -1, paid)

    def __call__(
        self, current: Int[Array, "*batch"], previous: Int[Array, "*batch"]
    ) -> Int8[Array, "*batch"]:
        """r_or for locations alone, without memory; the previous one may be `none_yet`."""
        return self.pay(Move(previous, current))
