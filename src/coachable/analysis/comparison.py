"""Two studies of the same setup beside each other, say of two trainers: do their curves agree?"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from coachable.analysis.figures import HEIGHT, WIDTH
from coachable.analysis.intervals import Estimate, estimate, mean
from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.significance import difference, two_sample
from coachable.analysis.statistics import LATE_STEPS, Band, learning_curve, mean_distance
from coachable.foundation.errors import RunFolderError
from coachable.foundation.style import INK, STANCE, SWING, drawing, save

Values = Callable[[Measurements, SetupRuns], np.ndarray]

MEASURES: Mapping[str, Values] = {
    "highest distance [m]": lambda runs, setup: setup.highest,
    "final distance [m]": lambda runs, setup: setup.final_distance,
    "steps to the baseline [thousands]": lambda runs, setup: runs.steps_to_baseline(setup) / 1_000,
    "normalised return, last 50k": lambda runs, setup: setup.late_returns(runs.grid, LATE_STEPS),
    "samples in the cycle, final": lambda runs, setup: setup.final_share_in_cycle,
    "time up [s], of 100": lambda runs, setup: setup.seconds_up,
}


@dataclass(frozen=True)
class Compared:
    """One measure of a setup in two studies; means over runs with 95 % BCa intervals."""

    measure: str
    first: Estimate
    second: Estimate
    difference: Estimate
    """First − second."""
    p: float
    """Two-sided, of a permutation test of equal distributions; not corrected for the number of measures."""


def compared(first: Measurements, second: Measurements, setup: str) -> list[Compared]:
    """Every measure of a setup that both studies have."""
    ours, theirs = first[setup], second[setup]
    found = []
    for name, values in MEASURES.items():
        x, y = values(first, ours), values(second, theirs)
        if np.isnan(x).any() or np.isnan(y).any():
            continue
        p = min(1.0, 2 * min(two_sample(mean, x, y))) if np.ptp([*x, *y]) else 1.0
        by = estimate(partial(difference, mean), x, y)
        found.append(Compared(name, estimate(mean, x), estimate(mean, y), by, p))
    return found


def share_of_overlap(first: Band, second: Band) -> float:
    """At which share of the training steps that both have the two 95 % intervals overlap.

    Where a mean has no interval, as that of a single run, it stands for one. NaN without a common step.
    """
    _, ours, theirs = np.intersect1d(first.steps, second.steps, return_indices=True)
    if not len(ours):
        return math.nan
    (low, high), (least, most) = _ends(first, ours), _ends(second, theirs)
    return float(np.mean((low <= most) & (least <= high)))


def _ends(band: Band, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = (np.where(np.isnan(end), band.value, end)[at] for end in (band.low, band.high))
    return low, high


def common_setups(first: Measurements, second: Measurements) -> list[str]:
    """Setups that both studies have.

    **Raises:** `RunFolderError` if there is none, or the studies follow different semantics.
    """
    if first.semantics != second.semantics:
        raise RunFolderError(
            f"the studies follow {first.semantics} and {second.semantics} semantics; their distances are "
            "measured differently and cannot be compared"
        )
    common = [name for name in first.setup_names if name in second.setup_names]
    if not common:
        raise RunFolderError("the studies have no setup in common")
    return common


def comparison_figure(studies: Mapping[str, Measurements], setup: str) -> Figure:
    """Both studies' learning curve and distance of one setup, with pointwise 95 % intervals."""
    panels = {"return / baseline's return": learning_curve, "distance of an evaluation [m]": mean_distance}
    with drawing():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        for axes, (name, curve) in zip(figure.subplots(1, 2), panels.items(), strict=True):
            for (title, runs), colour in zip(studies.items(), (STANCE, SWING), strict=True):
                band = curve(runs, runs[setup])
                steps = np.asarray(band.steps) / 1_000
                axes.fill_between(steps, band.low, band.high, color=colour, alpha=0.18, linewidth=0)
                label = f"{title}, {runs[setup].num_runs} seeds"
                axes.plot(steps, band.value, color=colour, linewidth=1.2, label=label)
            baseline = 1.0 if curve is learning_curve else next(iter(studies.values())).baseline_distance
            axes.axhline(baseline, color=INK, linewidth=0.9, label="virtual gravity")
            axes.set_xlabel("training steps [thousands]")
            axes.set_ylabel(name)
            axes.set_xlim(0, None)
            axes.grid(axis="y")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def tell_comparison(studies: Mapping[str, Measurements], folder: Path) -> None:
    """Print the comparison of two studies, given by title; write it as Markdown, with figures."""
    (title, first), (other, second) = studies.items()
    console = Console()
    if not console.is_terminal:
        console = Console(width=100)
    folder.mkdir(parents=True, exist_ok=True)
    pieces = [f"# {title} beside {other}"]
    written = []
    header = ["measure", title, other, "difference", "p"]
    for setup in common_setups(first, second):
        rows = [
            [row.measure, *map(_text, (row.first, row.second, row.difference)), f"{row.p:.3f}"]
            for row in compared(first, second, setup)
        ]
        overlaps = [
            _overlap(share_of_overlap(curve(first, first[setup]), curve(second, second[setup])), name)
            for name, curve in _CURVES.items()
        ]
        runs = f"{first[setup].num_runs} and {second[setup].num_runs} runs"
        note = f"{setup}, {runs}: the curves' 95 % intervals overlap at {' and '.join(overlaps)}."
        grid = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
        for name in header:
            grid.add_column(Text(name))
        for row in rows:
            grid.add_row(*map(Text, row))
        console.print(setup, style="bold", highlight=False)
        console.print(grid)
        console.print(note, highlight=False, markup=False)
        lines = ["| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)]
        pieces += [f"## {setup}", "\n".join(lines), note]
        figure = comparison_figure(studies, setup)
        for suffix in ("svg", "png"):
            written.append(folder / f"comparison-{setup}.{suffix}")
            save(figure, written[-1])
    console.print(NOTE, style="dim italic", highlight=False)
    written.append(folder / "comparison.md")
    written[-1].write_text("\n\n".join([*pieces, NOTE]) + "\n", encoding="utf-8")
    for path in written:
        print(f"wrote {path}")


NOTE = (
    "Means over runs with 95 % bootstrap intervals; difference: first − second; p: permutation test, "
    "two-sided, not corrected for the number of measures."
)
_CURVES = {"the learning curve's points": learning_curve, "the evaluations": mean_distance}


def _overlap(share: float, points: str) -> str:
    if math.isnan(share):
        return f"none of {points}, which have no step in common"
    return f"{share:.0%} of {points}"


def _text(told: Estimate) -> str:
    value = f"{told.value:.2f}"
    return f"{value} [{told.low:.2f}, {told.high:.2f}]" if told.has_interval else value
