"""Where an episode starts: at the plant's x₀, or near it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.plant import Plant

Distribution = Literal["normal", "uniform"]

_DISTRIBUTIONS: tuple[Distribution, ...] = ("normal", "uniform")
_WIDEST_NORMAL = 10.0
"""Nobody has ever drawn a normal number further out than so many standard deviations: one in 10²³ is."""


@dataclass(frozen=True)
class Start:
    """x₀ + scale · z, z independent draws: standard normal ones, or uniform ones in [−1, 1).

    So `scale` is a standard deviation or half the width of a box, in the units of the plant's state: one
    number for all coordinates or one for each.

    **Raises:** `ParameterError` for a scale that is negative or not finite, that is not one number or one a
    coordinate, and for an unknown distribution.
    """

    plant: Plant
    scale: int | float | Sequence[int | float] = 0.0
    distribution: Distribution = "normal"

    def __post_init__(self):
        if self.distribution not in _DISTRIBUTIONS:
            hint = suggestion(str(self.distribution), _DISTRIBUTIONS)
            raise ParameterError(f"unknown start_distribution {self.distribution!r}; {hint}")
        names = self.plant.state_names
        numbers = [self.scale] * len(names) if isinstance(self.scale, int | float) else list(self.scale)
        if len(numbers) != len(names) or not all(math.isfinite(n) and n >= 0 for n in numbers):
            raise ParameterError(
                f"start_noise is {self.scale!r}; give one number, not negative, or one each for "
                + ", ".join(names)
            )
        object.__setattr__(self, "scale", tuple(float(number) for number in numbers))

    def draw(self, generator: np.random.Generator) -> Float[np.ndarray, " state"]:
        """The next start, in float32; without noise nothing is drawn."""
        size = len(self._scales)
        if not any(self._scales):
            return np.array(self.plant.start, np.float32)
        normal = self.distribution == "normal"
        z = generator.standard_normal(size) if normal else generator.uniform(-1.0, 1.0, size)
        return (np.array(self.plant.start) + self._scales * z).astype(np.float32)

    @property
    def largest(self) -> tuple[float, ...]:
        """The largest magnitude of each coordinate."""
        widest = _WIDEST_NORMAL if self.distribution == "normal" else 1.0
        return tuple((np.abs(self.plant.start) + widest * self._scales).tolist())

    @property
    def _scales(self) -> Float[np.ndarray, " state"]:
        return np.array(self.scale)
