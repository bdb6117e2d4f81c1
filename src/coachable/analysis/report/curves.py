"""The curves in a page: bands of every measure, each run's own curve, and the paper's."""

from __future__ import annotations

from typing import Any

import numpy as np

from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.measures import DISTANCE, HIGHEST, RETURN, UPDATES, Measure
from coachable.analysis.paper import Figure, paper_curves
from coachable.analysis.report.packing import pack
from coachable.analysis.statistics import Band, mean_curve

_OF_THE_PAPER: dict[Measure, Figure] = {RETURN: "learning_curves", HIGHEST: "walking_distance"}


def updates(runs: Measurements) -> list[dict[str, Any]]:
    """The diagnostics of the updates along the training steps, for the page; empty where there are none."""
    return [
        _curve(runs, measure)
        for measure in UPDATES
        if all(_is_known(setup.diagnostics.get(measure.column)) for setup in runs.setups)
    ]


def _is_known(values: np.ndarray | None) -> bool:
    """Whether every run has the diagnostic at one checkpoint at least."""
    return values is not None and bool((~np.isnan(values)).all(axis=0).any())


def curves(runs: Measurements) -> list[dict[str, Any]]:
    """Every measure along the training steps, for the page."""
    return [_curve(runs, measure) for measure in runs.measures]


def _curve(runs: Measurements, measure: Measure) -> dict[str, Any]:
    baselines = {RETURN: 1.0, HIGHEST: runs.baseline_distance, DISTANCE: runs.baseline_distance}
    return {
        "key": measure.name,
        "title": measure.title,
        "unit": measure.axis,
        "share": measure.unit == "%",
        "steps": runs.steps_of(measure).tolist(),
        "baseline": baselines.get(measure) if runs.has_baseline else None,
        "setups": [_of_setup(runs, setup, measure) for setup in runs.setups],
    }


def _of_setup(runs: Measurements, setup: SetupRuns, measure: Measure) -> dict[str, Any]:
    axis, band, own = runs.steps_of(measure), mean_curve(runs, setup, measure), setup.values(measure)
    columns = {name: _on(axis, band, getattr(band, name)) for name in ("value", "low", "high")}
    if measure == HIGHEST:  # the paper's curve: the greatest value of any run
        columns["best"] = own.max(axis=0)
    paper, figure = None, _OF_THE_PAPER.get(measure)
    if figure and setup.name in paper_curves(figure):
        curve = paper_curves(figure)[setup.name]
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
