"""Mirror images of rows of numbers: some change places, some change their sign."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from coachable.automata.classifier import array_library


@dataclass(frozen=True)
class SignedPermutation:
    """y_i = signs_i · x[sources_i].

    **Raises:** at construction `ValueError` for what is no permutation, or no signs.
    """

    sources: tuple[int, ...]
    signs: tuple[int, ...]

    def __post_init__(self) -> None:
        if sorted(self.sources) != [*range(len(self.sources))]:
            raise ValueError(f"{self.sources} is no permutation")
        if len(self.signs) != len(self.sources) or not {*self.signs} <= {-1, 1}:
            raise ValueError(f"{self.signs} are not one sign, 1 or -1, for each of {len(self.sources)}")

    def __call__(self, x: Float[Any, "*batch numbers"]) -> Float[Any, "*batch numbers"]:
        """The image, in the library and type of x: NumPy, JAX or another of the array API standard."""
        (sources, signs), xp = self._arrays, array_library(x)
        if xp is np:
            return x[..., sources] * signs.astype(x.dtype)
        return xp.take(x, xp.asarray(sources), axis=-1) * xp.asarray(signs, dtype=x.dtype)

    def around(self, other: SignedPermutation, place: int) -> SignedPermutation:
        """That of a row in which another one stands in this one, before a place of it."""
        size = len(other.sources)
        ours = tuple(source if source < place else source + size for source in self.sources)
        theirs = tuple(place + source for source in other.sources)
        return SignedPermutation(
            ours[:place] + theirs + ours[place:], self.signs[:place] + other.signs + self.signs[place:]
        )

    @property
    def is_involution(self) -> bool:
        """Whether the image of an image is the original."""
        sources, signs = self._arrays
        return bool(
            (sources[sources] == np.arange(len(sources))).all() and (signs * signs[sources] == 1).all()
        )

    @property
    def moved(self) -> tuple[int, ...]:
        """The places whose number comes from another place."""
        return tuple(place for place, source in enumerate(self.sources) if place != source)

    @cached_property
    def _arrays(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.sources, int), np.array(self.signs, int)
