"""Infos as functions of signals get them: an absent entry is noticed, in one environment or in many."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from jaxtyping import Bool

Envs = Bool[np.ndarray, " envs"]
"""Which of them."""


class AbsentEntry(KeyError):
    """An info lacks the entry that was asked for."""


class Info(dict[str, Any]):
    """The info of one environment; asked for an entry that it lacks, it raises `AbsentEntry`."""

    def __init__(self, info: Mapping[str, Any]):
        super().__init__(
            {key: Info(value) if isinstance(value, dict) else value for key, value in info.items()}
        )

    def __missing__(self, key: Any) -> Any:
        raise AbsentEntry(key)


class Infos(dict[str, Any]):
    """The infos of many environments, as Gymnasium has them: `x` and the mask `_x` of who has it.

    It notes what is read. An entry of which some environments have none is read without complaint, and
    `absent` says afterwards where that was, unless its mask was read as well.
    """

    def __init__(self, infos: Mapping[str, Any], num_envs: int):
        self._num_envs = num_envs
        self._read: dict[str, Envs] = {}
        super().__init__(infos)
        for key, value in infos.items():
            if isinstance(value, dict):
                nested = Infos(value, num_envs)
                nested._read = self._read
                super().__setitem__(key, nested)

    def __missing__(self, key: Any) -> Any:
        raise AbsentEntry(key)

    def __getitem__(self, key: Any) -> Any:
        value = super().__getitem__(key)
        self._read[key] = self._present(key) & self._read.get(key, True)
        return value

    def get(self, key: Any, default: Any = None) -> Any:
        """The entry, with the default for every environment that lacks it."""
        if key not in self:
            return default if default is None else self._of_each(default)
        value = self[key]
        if default is None or isinstance(value, dict):
            return value
        return _where(self._read.pop(key), value, default)

    def followed(self, path: Sequence[str | int], other: Any) -> Any:
        """The entry on a path, with the other value for every environment that lacks it."""
        value: Any = self
        present = np.ones(self._num_envs, bool)
        for part in path:
            if isinstance(value, Infos):
                if part not in value:
                    return self._of_each(other)
                present &= value._present(part)
                value = dict.__getitem__(value, part)
            else:
                value = entry_of(value, part, many=True)
        return _where(present, value, other)

    def _of_each(self, value: Any) -> Any:
        """A number for every environment; whatever else it is stays as it is."""
        return np.full(self._num_envs, value) if isinstance(value, Real) else value

    def forget(self) -> None:
        """Nothing has been read."""
        self._read.clear()

    def absent(self) -> tuple[str, Envs]:
        """The keys that were read where they are absent, in words, and the environments that lack any."""
        lacking = {
            key: ~present
            for key, present in self._read.items()
            if not present.all() and f"_{key}" not in self._read
        }
        return " and ".join(map(repr, lacking)), np.any(
            [*lacking.values(), np.zeros(self._num_envs, bool)], 0
        )

    def _present(self, key: Any) -> Envs:
        mask = dict.get(self, f"_{key}")
        if isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self._num_envs,):
            return mask
        return np.ones(self._num_envs, bool)


def entry_of(value: Any, part: str | int, many: bool) -> Any:
    """An entry of a list or of an array, of whose last axis; with `many`, of that of each environment."""
    if not isinstance(value, np.ndarray):
        return value[part]
    if many and value.dtype == object:  # lists, of which Gymnasium makes no array; None where there is none
        return np.array([math.nan if one is None else one[part] for one in value])
    index: Any = (..., part)
    return value[index]


def _where(chosen: Envs, value: Any, other: Any) -> Any:
    if chosen.all():
        return value
    value = np.asarray(value)
    return np.where(chosen.reshape(-1, *[1] * (value.ndim - 1)), value, other)
