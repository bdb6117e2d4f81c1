"""What a signal pack is made of: signals, each with a way to read it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import gymnasium

from coachable.behaviours.predicates import Signal


@runtime_checkable
class Simulation(Protocol):
    """What is behind an environment."""

    def is_of(self, env: gymnasium.Env) -> bool:
        """Whether this is still what is behind the environment, and not a model that it had before."""
        ...

    def look(self) -> None:
        """See what is so now; what is read afterwards is of this moment."""
        ...


Reading = Callable[[], float]
"""Reads one signal."""

ReadingOf = Callable[[Any], Reading]
"""Makes the reading for a simulation: names are looked up there, once."""


@dataclass(frozen=True)
class Probe:
    """A signal, and how it is read."""

    signal: Signal
    of: ReadingOf


def probe(name: str, unit: str, description: str, of: ReadingOf) -> Probe:
    """A signal that is nothing's derivative."""
    return Probe(Signal(name, unit, description), of)


def angle(name: str, description: str, of: ReadingOf, velocity_of: ReadingOf) -> tuple[Probe, Probe]:
    """An angle [rad], and `…_velocity` [rad/s] with the same sign."""
    velocity = Signal(f"{name}_velocity", "rad/s", f"how fast {name} grows", name)
    return probe(name, "rad", description, of), Probe(velocity, velocity_of)
