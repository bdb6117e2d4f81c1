"""A reset map as plain arithmetic, so that a solver can reason about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ImpactAlgebra:
    """The touchdown's reset map with c = cos(first − second) of two angles; nothing but arithmetic is done.

    It is linear in some coordinates, and `scale(c)`, which is positive, times it is a polynomial in c, of
    degree two at most.
    """

    angles: tuple[str, str]
    """The two angles whose difference has the cosine c."""
    mirrored: bool
    """Whether first = −second at every touchdown; else they are equal."""
    bounded: str
    """A coordinate that is bounded at touchdowns."""
    usual: tuple[float, float]
    """Its lowest and highest value at usual ones."""
    possible: tuple[float, float]
    """Its lowest and highest value at all possible ones."""
    linear: Mapping[str, str]
    """The coordinates in which the map is linear, and which it gives; and what each is the velocity of."""
    after: Callable[[Any, Sequence[Any]], tuple[Any, ...]]
    """From c and the values of `linear` before to those after: floats, arrays or a solver's terms."""
    swapped: Mapping[str, str]
    """Each other coordinate after the impact, by the name of the one before that it equals."""
    scale: Callable[[Any], Any]
