"""The walks in a page: which are embedded, and what of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow.compute as pc

from coachable.analysis.report.packing import pack
from coachable.experiments.experiment import Experiment
from coachable.experiments.run_folder.reader import Run

MOST_WALKS = 128
"""Walks in a page, all studies together; of more an even selection is embedded."""

POSE_EVERY = 0.1
"""Time between two poses of a small picture [s]."""
POSE_SECONDS = 2.0
"""How much of a walk, counted from its end, a small picture shows."""

_STATE = ("theta_1", "theta_2", "dtheta_1", "dtheta_2", "u1", "u2", "foot_x")
_TERMS = ("jerk", "forward", "orthant")
_SCALES = {"phase": 1.0, "expected": 1.0, "forward": 1.0, "orthant": 1.0}
_TICK = 0.0005
"""To which times are rounded [s]: walks of up to 16 s."""

Walks = Mapping[str, dict[str, np.ndarray]]
"""The columns of each stored walk, by lane."""


def can_draw_walks(experiment: Experiment) -> bool:
    """Whether the page can draw the walks of an experiment: it knows walkers with two straight legs."""
    if not experiment.problem.in_jax:
        return False
    plant = experiment.require_plant("a walk").plant
    return set(_STATE) <= {*plant.state_names, *plant.control_names, "foot_x"}


def stored_walks(run: Run) -> Walks:
    """The last policy's walk of every lane, and the baseline's under its own name.

    **Raises:** `RunFolderError` if the table is missing or damaged.
    """
    table = run.table("trajectories")
    table = table.filter(pc.field("which") != "best")
    lanes = table["lane"].combine_chunks().dictionary_encode()
    names = lanes.dictionary.to_pylist()
    order = lanes.indices.to_numpy()
    starts = [0, *(np.flatnonzero(np.diff(order)) + 1).tolist(), len(order)]
    columns = {
        name: table[name].to_numpy().astype(float)
        for name in table.column_names
        if name not in ("lane", "which")
    }
    return {
        names[order[start]]: {name: column[start:stop] for name, column in columns.items()}
        for start, stop in pairwise(starts)
        if stop > start
    }


def packed_walk(walk: Mapping[str, np.ndarray], run: Run | None = None) -> dict[str, Any]:
    """A walk for the page; what is paid only once, for distance and a fall, as sums.

    **Arguments:** `run`, whose expected run, if its behaviour has one, stands beside the phases.
    """
    time = walk["t"] - walk["t"][0]
    columns = {"t": time} | {name: walk[name] for name in (*_STATE, "phase", *_TERMS)}
    if run is not None and run.follower is not None:
        columns["expected"] = run.follower.along(time, walk["phase"].astype(int)).astype(float)
    tick = max(_TICK, float(time[-1]) / 32_000)
    paid = {name: round(float(walk[name].sum()), 4) for name in ("distance", "fall")}
    return pack(columns, _SCALES | {"t": tick}) | {"paid": paid}


def packed_poses(walks: Sequence[Mapping[str, np.ndarray] | None]) -> dict[str, Any]:
    """The last poses of each walk in one piece; `starts` tells where each begins, and where the last ends."""
    parts, starts = [], [0]
    for walk in walks:
        rows = np.arange(0) if walk is None else _last_poses(walk["t"])
        starts.append(starts[-1] + len(rows))
        if walk is not None:
            parts.append(np.stack([walk[name][rows] for name in ("theta_1", "theta_2", "foot_x")]))
    together = np.concatenate(parts, axis=1) if parts else np.zeros((3, 0))
    theta_1, theta_2, foot_x = together
    return pack({"theta_1": theta_1, "theta_2": theta_2, "foot_x": foot_x}) | {"starts": starts}


def _last_poses(time: np.ndarray) -> np.ndarray:
    """Rows at even intervals that end with the last one, in order."""
    times = np.arange(time[-1], max(time[0], time[-1] - POSE_SECONDS) - 1e-6, -POSE_EVERY)[::-1]
    return np.unique(np.searchsorted(time, times - 1e-4))


def even_selection(count: int, most: int) -> list[int]:
    """At most `most` ranks out of `count`, evenly spread, the first and the last among them."""
    if count <= most:
        return list(range(count))
    if most <= 1:
        return [0][:most]
    return sorted({round(rank) for rank in np.linspace(0, count - 1, most)})


def baseline_walk(walks: Walks, controller: str, run: Run | None = None) -> dict[str, Any] | None:
    """The walk of the baseline controller of this name for the page, if it is stored; see `packed_walk`."""
    return packed_walk(walks[controller], run) if controller in walks else None
