"""The paper's two figures, from a study: learning curves and walking distance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from coachable.analysis.claims import Claim
from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.paper import Figure as PaperFigure
from coachable.analysis.paper import paper_curves, paper_numbers
from coachable.analysis.sections import IN_UNIT, with_interval
from coachable.analysis.statistics import Band, learning_curve, mean_highest
from coachable.foundation.style import FAINT, INK, STANCE, drawing, save, setup_colours

WIDTH = 7.16
"""Both columns of a two-column page [in]."""
HEIGHT = 3.0


def learning_curves(runs: Measurements) -> Figure:
    """Figure 6 of the paper: the normalised return of the training episodes against the training steps.

    A solid line is the mean over runs, its band the pointwise 95 % interval, and thin and dashed behind it is
    the paper's curve. The baseline is 1 by definition.
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        axes = figure.subplots()
        for setup, colour in _coloured(runs):
            _draw_band(axes, learning_curve(runs, setup), colour, linewidth=0.9)
            _draw_paper(axes, "learning_curves", setup.name, colour)
        axes.axhline(1.0, color=INK, linewidth=0.9)
        axes.set_ylabel("return / baseline's return")
        _finish(axes, runs)
        _draw_legend(figure, runs)
    return figure


def walking_distance(runs: Measurements) -> Figure:
    """Figure 7 of the paper: the greatest distance reached so far against the training steps.

    On the left that of any run, as in the paper, whose curves are dashed behind ours; it has no interval, and
    grows with the number of runs. On the right the mean over runs of each run's own greatest distance, with
    its pointwise 95 % interval.
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout=ConstrainedLayoutEngine(wspace=0.06))
        best, average = figure.subplots(1, 2, sharey=True)
        for setup, colour in _coloured(runs):
            best.plot(runs.checkpoints, setup.highest_of_all_runs, color=colour, zorder=3)
            _draw_paper(best, "walking_distance", setup.name, colour)
            _draw_band(average, mean_highest(runs, setup), colour)
        _draw_paper(best, "walking_distance", "virtual gravity", INK)
        for axes, title in ((best, "best of all runs"), (average, "mean over runs")):
            axes.axhline(runs.baseline_distance, color=INK, linewidth=0.9)
            axes.set_title(title)
            _finish(axes, runs)
        best.set_ylabel("highest walking distance [m]")
        _draw_legend(figure, runs)
    return figure


def claims_figure(claims: Sequence[Claim]) -> Figure:
    """What the claims rest on: each comparison's difference in favour of its claim with its 95 % interval.

    Differences are drawn in shares of the greatest end of an interval of the same measure; the numbers stand
    beside them.
    """
    comparisons = [(claim, comparison) for claim in claims for comparison in claim.comparisons]
    reach = {
        measure: max(
            np.nanmax(np.abs([c.advantage.value, c.advantage.low, c.advantage.high]))
            for _, c in comparisons
            if c.measure == measure
        )
        for measure in {c.measure for _, c in comparisons}
    }
    with drawing():
        figure = Figure(figsize=(WIDTH, 0.6 + 0.17 * len(comparisons)), layout="constrained")
        axes = figure.subplots()
        labels = []
        for row, (claim, comparison) in enumerate(comparisons):
            value, low, high = (
                x / (reach[comparison.measure] or 1)
                for x in (comparison.advantage.value, comparison.advantage.low, comparison.advantage.high)
            )
            axes.plot([low, high], [row, row], color=STANCE, alpha=0.45, linewidth=2)
            axes.plot([value], [row], "o", color=STANCE, markersize=4)
            told = with_interval(comparison.advantage, IN_UNIT[comparison.unit])
            axes.annotate(
                f"{told} {comparison.unit}", (1.02, row), xycoords=("axes fraction", "data"), va="center"
            )
            labels.append(f"{claim.name}  {comparison.measure}: {comparison.relation}")
        axes.axvline(0, color=INK, linewidth=0.8)
        axes.set_yticks(range(len(labels)), labels)
        axes.set_ylim(len(labels) - 0.4, -0.6)
        axes.set_xlim(-1.05, 1.05)
        axes.set_xticks([])
        axes.set_xlabel("against the claim  ←    → in favour of it")
        axes.spines["left"].set_visible(False)
        axes.tick_params(axis="y", length=0)
    return figure


def paper_figures(runs: Measurements, claims: Sequence[Claim]) -> dict[str, Figure]:
    """The figures for a paper by name, both columns wide; that of the claims if any could be decided."""
    figures = {"learning_curves": learning_curves(runs), "walking_distance": walking_distance(runs)}
    if any(claim.comparisons for claim in claims):
        figures["claims"] = claims_figure(claims)
    return figures


def draw_figures(runs: Measurements, folder: Path) -> list[Path]:
    """Write both figures as SVG and PNG into a folder, which is made if need be; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    figures = {"learning_curves": learning_curves(runs), "walking_distance": walking_distance(runs)}
    paths = [folder / f"{name}.{suffix}" for name in figures for suffix in ("svg", "png")]
    for path in paths:
        save(figures[path.stem], path)
    return paths


def _coloured(runs: Measurements) -> list[tuple[SetupRuns, str]]:
    colours = setup_colours(runs.setup_names)
    return [(setup, colours[setup.name]) for setup in runs.setups]


def _draw_band(axes: Axes, band: Band, colour: str, linewidth: float = 1.4) -> None:
    axes.fill_between(band.steps, band.low, band.high, color=colour, alpha=0.15, linewidth=0, zorder=2)
    axes.plot(band.steps, band.value, color=colour, linewidth=linewidth, zorder=3)


def _draw_paper(axes: Axes, figure: PaperFigure, name: str, colour: str) -> None:
    if name in paper_curves(figure):
        curve = paper_curves(figure)[name]
        axes.plot(
            curve.steps, curve.value, color=colour, linewidth=0.8, linestyle=(0, (4, 2)), alpha=0.65, zorder=1
        )


def _finish(axes: Axes, runs: Measurements) -> None:
    axes.set_xlim(0, runs.steps)
    axes.set_xlabel("training steps")
    axes.xaxis.set_major_formatter(FuncFormatter(_steps_text))
    axes.grid(axis="y")


def _steps_text(steps: float, _: object = None) -> str:
    return f"{steps / 1000:g}k" if steps else "0"


def _draw_legend(figure: Figure, runs: Measurements) -> None:
    handles = [Line2D([], [], color=colour, label=setup.name) for setup, colour in _coloured(runs)]
    handles.append(Line2D([], [], color=INK, linewidth=0.9, label="virtual gravity"))
    if set(runs.setup_names) & set(paper_numbers()):
        handles.append(
            Line2D([], [], color=FAINT, linewidth=0.8, linestyle=(0, (4, 2)), label="paper, digitised")
        )
    figure.legend(
        handles=handles, loc="outside upper center", ncols=len(handles), handlelength=1.8, columnspacing=1.6
    )
