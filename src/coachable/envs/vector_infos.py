"""The infos of vector environments, as Gymnasium has them: arrays, each with a mask of whom it tells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool

_OF_THE_END = ("final_obs", "_final_obs", "final_info", "_final_info")


def masked(info: Mapping[str, Any], chosen: Bool[np.ndarray, " envs"]) -> dict[str, Any]:
    """The info with a mask beside every entry that says for whom it is."""
    told: dict[str, Any] = {}
    for name, values in info.items():
        told[name] = masked(values, chosen) if isinstance(values, dict) else values
        told[f"_{name}"] = chosen.copy()
    return told


def only(info: Mapping[str, Any], chosen: Bool[np.ndarray, " envs"]) -> dict[str, Any]:
    """The info of some environments: the others' entries are 0, or None for what is no number."""
    told: dict[str, Any] = {}
    for name, values in info.items():
        if isinstance(values, dict):
            told[name] = only(values, chosen)
        else:
            told[name] = np.zeros_like(values) if values.dtype != object else np.full_like(values, None)
            told[name][chosen] = values[chosen]
    return told


def at_the_end(infos: Mapping[str, Any], ended: Bool[np.ndarray, " envs"]) -> dict[str, Any]:
    """The infos before the reset in the same step: those of `final_info` for whoever has ended."""
    return _replaced(infos, infos.get("final_info", {}), ended)


def _replaced(infos: Mapping[str, Any], last: Mapping[str, Any], ended: np.ndarray) -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for name in {**infos, **last}:
        if name in _OF_THE_END:
            continue
        if name not in infos or name not in last:
            merged[name] = last[name] if name in last else infos[name]
        elif isinstance(infos[name], dict):
            merged[name] = _replaced(infos[name], last[name], ended)
        else:
            merged[name] = np.array(infos[name])
            merged[name][ended] = np.asarray(last[name])[ended]
    return merged
