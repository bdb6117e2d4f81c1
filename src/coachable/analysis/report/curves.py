"""The curves in a page: bands of every measure, each run's own curve, and the paper's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.paper import Figure, paper_curves
from coachable.analysis.report.packing import pack
from coachable.analysis.statistics import (
    Band,
    learning_curve,
    mean_diagnostic,
    mean_distance,
    mean_highest,
    mean_share_in_cycle,
    share_up,
)


@dataclass(frozen=True)
class _Measure:
    key: str
    title: str
    unit: str
    band: Callable[[Measurements, SetupRuns], Band]
    of_runs: Callable[[SetupRuns], np.ndarray]
    """A row for each run, a column for each step of the band's axis."""
    baseline: Callable[[Measurements], float | None] = lambda runs: None
    best: bool = False
    """Whether the greatest value of any run is drawn, too: the paper's curve."""
    paper: Figure | None = None


_MEASURES = (
    _Measure(
        "reward",
        "Normalised reward",
        "return / baseline's return",
        learning_curve,
        lambda setup: setup.returns,
        lambda runs: 1.0,
        paper="learning_curves",
    ),
    _Measure(
        "highest",
        "Highest distance",
        "m",
        mean_highest,
        lambda setup: setup.highest_so_far,
        lambda runs: runs.baseline_distance,
        best=True,
        paper="walking_distance",
    ),
    _Measure(
        "distance",
        "Distance",
        "m",
        mean_distance,
        lambda setup: setup.distance,
        lambda runs: runs.baseline_distance,
    ),
    _Measure(
        "up", "Survival", "share of runs up after the episode", share_up, lambda setup: (~setup.fell) * 1.0
    ),
    _Measure(
        "cycle",
        "Share in cycle",
        "share of samples in the cycle",
        mean_share_in_cycle,
        lambda s: s.share_in_cycle,
    ),
)


_UPDATE_MEASURES = tuple(
    _Measure(
        key, title, unit, partial(mean_diagnostic, name=key), lambda setup, key=key: setup.diagnostics[key]
    )
    for key, title, unit in (
        ("approx_kl", "Approximate KL", "KL divergence of the new policy"),
        ("clip_fraction", "Clip fraction", "share of samples outside the clip range"),
        ("explained_variance", "Explained variance", "share of the returns' variance"),
        ("entropy", "Entropy", "entropy of the policy"),
    )
)


def updates(runs: Measurements) -> list[dict[str, Any]]:
    """The diagnostics of PPO's updates along the training steps, for the page; empty where there are none."""
    return [
        _curve(runs, measure)
        for measure in _UPDATE_MEASURES
        if all(_is_known(setup.diagnostics.get(measure.key)) for setup in runs.setups)
    ]


def _is_known(values: np.ndarray | None) -> bool:
    """Whether every run has the diagnostic at one checkpoint at least."""
    return values is not None and bool((~np.isnan(values)).all(axis=0).any())


def curves(runs: Measurements) -> list[dict[str, Any]]:
    """Every measure along the training steps, for the page."""
    return [_curve(runs, measure) for measure in _MEASURES]


def _curve(runs: Measurements, measure: _Measure) -> dict[str, Any]:
    axis = runs.grid if measure.key == "reward" else runs.checkpoints
    return {
        "key": measure.key,
        "title": measure.title,
        "unit": measure.unit,
        "steps": axis.tolist(),
        "baseline": measure.baseline(runs),
        "setups": [_of_setup(runs, setup, measure, axis) for setup in runs.setups],
    }


def _of_setup(runs: Measurements, setup: SetupRuns, measure: _Measure, axis: np.ndarray) -> dict[str, Any]:
    band = measure.band(runs, setup)
    own = measure.of_runs(setup)
    columns = {name: _on(axis, band, getattr(band, name)) for name in ("value", "low", "high")}
    if measure.best:
        columns["best"] = own.max(axis=0)
    paper = None
    if measure.paper and setup.name in paper_curves(measure.paper):
        curve = paper_curves(measure.paper)[setup.name]
        inside = curve.steps <= max(runs.steps, axis[-1])
        paper = {
            "steps": np.round(curve.steps[inside]).astype(int).tolist(),
            "value": np.round(curve.value[inside], 4).tolist(),
        }
    return {
        "name": setup.name,
        "band": pack(columns),
        "runs": pack({str(seed): row for seed, row in zip(setup.seeds.tolist(), own, strict=True)}),
        "paper": paper,
    }


def _on(axis: np.ndarray, band: Band, values: np.ndarray) -> np.ndarray:
    """A band's values on the whole axis, NaN where the band has not begun."""
    whole = np.full(len(axis), np.nan)
    whole[np.searchsorted(axis, band.steps)] = values
    return whole
