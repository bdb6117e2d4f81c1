"""In which ways a plant may be disturbed, by name, and how far at most: what verification tries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Kick:
    """A sudden change of the state's velocities, right after a touchdown."""

    name: str
    direction: tuple[float, ...]
    """Of the state, of length 1."""
    greatest: float
    """The greatest length tried."""
    unit: str


@dataclass(frozen=True)
class Change:
    """A constant of the plant or of its surroundings that is other than nominal."""

    name: str
    what: str
    """Which of `Disturbances.nominal`."""
    greatest: float
    """The greatest change tried, with its sign."""
    unit: str


@dataclass(frozen=True)
class Disturbances:
    """What a plant is tried with, beside torque noise and delay, which any plant can meet."""

    kicks: tuple[Kick, ...]
    changes: tuple[Change, ...] = ()
    nominal: Mapping[str, float] = field(default_factory=dict)
    """What `Plant.disturbed` can change, and the values that change nothing."""
    section_half_widths: tuple[float, ...] = ()
    """Half the widths of the box around a gait's section point in which falls are searched for."""
    control_bound: float = 0.2
    """Bound of the added controls with which falls are searched for."""
