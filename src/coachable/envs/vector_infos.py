"""The infos of vector environments, as Gymnasium has them: arrays, each with the mask of its environments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool

_OF_THE_END = ("final_obs", "_final_obs", "final_info", "_final_info")


def masked(info: Mapping[str, Any], chosen: Bool[np.ndarray, " envs"]) -> dict[str, Any]:
    """The info with the mask of its environments beside every entry."""
    result: dict[str, Any] = {}
    for name, values in info.items():
        result[name] = masked(values, chosen) if isinstance(values, dict) else values
        result[f"_{name}"] = chosen.copy()
    return result


def only(info: Mapping[str, Any], chosen: Bool[np.ndarray, " envs"]) -> dict[str, Any]:
    """The info of some environments: the others' entries are 0, or None for what is no number."""
    result: dict[str, Any] = {}
    for name, values in info.items():
        if isinstance(values, dict):
            result[name] = only(values, chosen)
        else:
            result[name] = np.zeros_like(values) if values.dtype != object else np.full_like(values, None)
            result[name][chosen] = values[chosen]
    return result


def at_the_end(infos: Mapping[str, Any], ended: Bool[np.ndarray, " envs"]) -> dict[str, Any]:
    """The infos before the reset in the same step: those of `final_info` for whoever has ended."""
    return _replaced(infos, infos.get("final_info", {}), ended)


def _replaced(infos: Mapping[str, Any], last: Mapping[str, Any], ended: np.ndarray) -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for name in {**infos, **last}:
        if name in _OF_THE_END:
            continue
        if name not in infos:
            merged[name] = last[name]
            if not name.startswith("_"):
                merged.setdefault(f"_{name}", ended)
        elif name in last and isinstance(infos[name], dict):
            merged[name] = _replaced(infos[name], last[name], ended)
        elif name in last:
            merged[name] = np.where(
                ended.reshape(-1, *[1] * (np.ndim(infos[name]) - 1)), np.asarray(last[name]), infos[name]
            )
        else:  # whoever has ended had no such entry; what is there is of the next episode
            merged.setdefault(name, infos[name])
            if not name.startswith("_"):
                merged[f"_{name}"] = infos.get(f"_{name}", True) & ~ended
    return merged
