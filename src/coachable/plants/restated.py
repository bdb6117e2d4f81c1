"""What a second statement of a plant gives: the same physics written down again, for NumPy and SciPy.

A fall that a search finds is shown only after it was simulated once more with it. So it uses nothing of the
plant, the integrator and the event search that the search ran on, and no JAX.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

State = Float[np.ndarray, " state"]
Control = Float[np.ndarray, " control"]


@dataclass(frozen=True)
class RestatedEvent:
    """An event of a plant: a falling zero of its guard."""

    name: str
    guard: Callable[[State], float]
    admissible: Callable[[State], bool]
    """Whether a zero there counts."""
    reset: Callable[[State], State]
    displacement: Callable[[State], float]
    """By how much the stance foot moves [m]."""
    restarts_clock: bool
    """Whether it ends a control step under the touchdown clock."""


@dataclass(frozen=True)
class Restated:
    """A plant's flow and events in float64, one state at a time."""

    flow: Callable[[State, Control], Sequence[float]]
    """ẋ at a state under a control."""
    events: tuple[RestatedEvent, ...]
    fall_margin: Callable[[State], float]
    """Positive while the plant is up, zero where it has fallen."""
