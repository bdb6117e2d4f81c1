"""Observations with what a reward remembers: appended to a row of numbers, or an entry of a `Dict`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import gymnasium
import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion

Observe = Literal["nothing", "memory"]


@dataclass(frozen=True, eq=False)
class MemoryObserver:
    """Puts the numbers that a form shows of its memory into observations of one environment."""

    space: gymnasium.Space
    """The space of one environment's observations with the numbers in them."""
    key: str | None
    """Their entry in a `Dict`; `None` where they are appended to a row of numbers."""
    dtype: np.dtype

    @staticmethod
    def of(observe: str, names: tuple[str, ...], space: gymnasium.Space, key: str) -> MemoryObserver | None:
        """The observer for a space of observations; `None` to observe `"nothing"`.

        **Arguments:** `names`, of the numbers; `key`, for their entry in a `Dict`.

        **Raises:** `ParameterError` for an unknown `observe`, and a space that they cannot be put into.
        """
        if observe not in ("nothing", "memory"):
            raise ParameterError(f"unknown observe {observe!r}; {suggestion(observe, ('nothing', 'memory'))}")
        if observe == "nothing":
            return None
        if isinstance(space, gymnasium.spaces.Dict):
            if key in space.spaces:
                raise ParameterError(f"observations have an entry {key!r} already; give another key")
            numbers = gymnasium.spaces.Box(0.0, 1.0, (len(names),), np.float32)
            return MemoryObserver(
                gymnasium.spaces.Dict({**space.spaces, key: numbers}), key, np.dtype(np.float32)
            )
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise ParameterError(
                f"observe = 'memory' needs observations that are a row of numbers or a Dict, but they are "
                f"{space}; put gymnasium.wrappers.FlattenObservation around the environment first"
            )
        low, high = np.zeros(len(names), space.dtype), np.ones(len(names), space.dtype)
        appended = gymnasium.spaces.Box(
            np.concatenate([space.low, low]), np.concatenate([space.high, high]), dtype=space.dtype.type
        )
        return MemoryObserver(appended, None, np.dtype(appended.dtype))

    @property
    def place(self) -> int | None:
        """Where they begin in a flattened `Dict`, whose entries follow one another; `None` if at the end."""
        if self.key is None or not isinstance(self.space, gymnasium.spaces.Dict):
            return None
        names = [*self.space.spaces]
        before = names[: names.index(self.key)]
        return (
            None
            if len(before) == len(names) - 1
            else sum(gymnasium.spaces.flatdim(self.space[name]) for name in before)
        )

    def append(self, observation: Any, numbers: Float[np.ndarray, "*batch numbers"]) -> Any:
        """One environment's observation, or a batch of them, with the numbers in it."""
        numbers = numbers.astype(self.dtype)
        if self.key is not None:
            return {**observation, self.key: numbers}
        return np.concatenate([observation, numbers], -1)
