"""Where an episode starts: at the paper's x₀, or near it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.compass import START, STATE_NAMES

Distribution = Literal["normal", "uniform"]

_DISTRIBUTIONS: tuple[Distribution, ...] = ("normal", "uniform")
_WIDEST_NORMAL = 10.0
"""Nobody has ever drawn a normal number further out than so many standard deviations: one in 10²³ is."""


@dataclass(frozen=True)
class Start:
    """x₀ + scale · z, z four independent draws: standard normal ones, or uniform ones in [−1, 1).

    So `scale` is a standard deviation or half the width of a box, in the units of (θ1, θ2, θ̇1, θ̇2): one
    number for all four or one for each.

    **Raises:** `ParameterError` for a scale that is negative or not finite, that is not one number or four,
    and for an unknown distribution.
    """

    scale: int | float | Sequence[int | float] = 0.0
    distribution: Distribution = "normal"

    def __post_init__(self):
        if self.distribution not in _DISTRIBUTIONS:
            hint = suggestion(str(self.distribution), _DISTRIBUTIONS)
            raise ParameterError(f"unknown start_distribution {self.distribution!r}; {hint}")
        numbers = [self.scale] * 4 if isinstance(self.scale, int | float) else list(self.scale)
        if len(numbers) != len(START) or not all(math.isfinite(n) and n >= 0 for n in numbers):
            raise ParameterError(
                f"start_noise is {self.scale!r}; give one number, not negative, or one each for "
                + ", ".join(STATE_NAMES)
            )
        object.__setattr__(self, "scale", tuple(float(number) for number in numbers))

    def draw(self, generator: np.random.Generator) -> Float[np.ndarray, "4"]:
        """The next start, in float32; without noise nothing is drawn."""
        if not any(self._scales):
            return np.array(START, np.float32)
        normal = self.distribution == "normal"
        z = generator.standard_normal(4) if normal else generator.uniform(-1.0, 1.0, 4)
        return (np.array(START) + self._scales * z).astype(np.float32)

    @property
    def largest(self) -> tuple[float, ...]:
        """The largest magnitude of each coordinate."""
        widest = _WIDEST_NORMAL if self.distribution == "normal" else 1.0
        return tuple((np.abs(START) + widest * self._scales).tolist())

    @property
    def _scales(self) -> Float[np.ndarray, "4"]:
        return np.array(self.scale)
