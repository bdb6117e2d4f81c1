"""The figures of a study: the paper's two beside a baseline, else the curves of every measure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, PercentFormatter

from coachable.analysis.claims import Claim
from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.measures import DISTANCE, HIGHEST, RETURN, Measure
from coachable.analysis.paper import Figure as PaperFigure
from coachable.analysis.paper import paper_curves, paper_numbers
from coachable.analysis.sections import IN_UNIT, with_interval
from coachable.analysis.statistics import Band, mean_curve
from coachable.foundation.style import FAINT, INK, STANCE, drawing, save, setup_colours

WIDTH = 7.16
"""Both columns of a two-column page [in]."""
HEIGHT = 3.0
PANELS_A_ROW = 3
_MOST_IN_A_LINE = 6
"""More entries of a legend take two lines."""


def learning_curves(runs: Measurements) -> Figure:
    """Figure 6 of the paper: the normalised return of the training episodes against the training steps.

    A solid line is the mean over runs, its band the pointwise 95 % interval, and thin and dashed behind it is
    the paper's curve. The baseline is 1 by definition.
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        axes = figure.subplots()
        for setup, colour in _coloured(runs):
            draw_band(axes, mean_curve(runs, setup, RETURN), colour, linewidth=0.9)
            _draw_paper(axes, "learning_curves", setup.name, colour)
        axes.axhline(1.0, color=INK, linewidth=0.9)
        axes.set_ylabel("return / baseline's return")
        _finish(axes, runs.steps)
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
            draw_band(average, mean_curve(runs, setup, HIGHEST), colour)
        _draw_paper(best, "walking_distance", "virtual gravity", INK)
        for axes, title in ((best, "best of all runs"), (average, "mean over runs")):
            axes.axhline(runs.baseline_distance, color=INK, linewidth=0.9)
            axes.set_title(title)
            _finish(axes, runs.steps)
        best.set_ylabel("highest walking distance [m]")
        _draw_legend(figure, runs)
    return figure


def rules_figure(studies: Sequence[Measurements]) -> Figure:
    """The distance of each evaluation by what policies do when they do not explore, side by side.

    A line is the mean over runs, its band the pointwise 95 % interval. The runs are the same in all panels.
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout=ConstrainedLayoutEngine(wspace=0.06))
        places = figure.subplots(1, len(studies), sharey=True, squeeze=False)[0]
        for runs, axes in zip(studies, places, strict=True):
            for setup, colour in _coloured(runs):
                draw_band(axes, mean_curve(runs, setup, DISTANCE), colour)
            axes.axhline(runs.baseline_distance, color=INK, linewidth=0.9)
            axes.set_title(runs.experiment.deterministic[0].replace("-", " "))
            _finish(axes, runs.steps)
        places[0].set_ylabel("walking distance [m]")
        _draw_legend(figure, studies[0], of_paper=False)
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
            estimate = with_interval(comparison.advantage, IN_UNIT[comparison.unit])
            axes.annotate(
                f"{estimate} {comparison.unit}", (1.02, row), xycoords=("axes fraction", "data"), va="center"
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


def training_curves(runs: Measurements) -> Figure:
    """A panel for each measure of the evaluations, against the training steps.

    A line is the mean over runs, its band the pointwise 95 % interval; with one run there is no band.
    """
    colours = setup_colours(runs.setup_names)

    def draw(axes: Axes, measure: Measure) -> None:
        for setup in runs.setups:
            draw_band(axes, mean_curve(runs, setup, measure), colours[setup.name])

    handles = [Line2D([], [], color=colour, label=name) for name, colour in colours.items()]
    return panels(runs.evaluated, draw, handles)


def panels(
    measures: Sequence[Measure], draw: Callable[[Axes, Measure], None], handles: Sequence[Line2D]
) -> Figure:
    """A figure with a panel for each measure, three in a row, against the training steps.

    **Arguments:** `draw` draws a measure's curves into its panel; `handles` go into the legend.
    """
    num_rows = -(-len(measures) // PANELS_A_ROW)
    num_columns = min(PANELS_A_ROW, len(measures))
    with drawing():
        figure = Figure(figsize=(WIDTH, 0.5 + 2.0 * num_rows), layout="constrained")
        places = figure.subplots(num_rows, num_columns, squeeze=False).flat
        for measure, axes in zip(measures, places, strict=False):
            draw(axes, measure)
            axes.set_title(measure.heading, fontsize="medium")
            if measure.unit == "%":
                axes.set_ylim(0, 1.02)
                axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=""))
            _finish(axes)
        for axes in list(places):
            axes.set_visible(False)
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def figures(
    runs: Measurements, claims: Sequence[Claim] = (), others: Sequence[Measurements] = ()
) -> dict[str, Figure]:
    """The figures of a study by name, both columns of a paper wide.

    Beside a baseline, the paper's two and that of the claims if any could be decided; without one, the curves
    of every measure. With the same runs by `others` of their rules, one of them all.
    """
    if not runs.has_baseline:
        return {"learning_curves": training_curves(runs)}
    drawn = {"learning_curves": learning_curves(runs), "walking_distance": walking_distance(runs)}
    if any(claim.comparisons for claim in claims):
        drawn["claims"] = claims_figure(claims)
    if others:
        drawn["rules"] = rules_figure([runs, *others])
    return drawn


def draw_figures(runs: Measurements, folder: Path, others: Sequence[Measurements] = ()) -> list[Path]:
    """Write the figures as SVG and PNG into a folder, which is made if need be; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = figures(runs, others=others)
    paths = [folder / f"{name}.{suffix}" for name in drawn for suffix in ("svg", "png")]
    for path in paths:
        save(drawn[path.stem], path)
    return paths


def _coloured(runs: Measurements) -> list[tuple[SetupRuns, str]]:
    colours = setup_colours(runs.setup_names)
    return [(setup, colours[setup.name]) for setup in runs.setups]


def draw_band(axes: Axes, band: Band, colour: str, linewidth: float = 1.4) -> None:
    """A mean as a line in its interval."""
    axes.fill_between(band.steps, band.low, band.high, color=colour, alpha=0.15, linewidth=0, zorder=2)
    axes.plot(band.steps, band.value, color=colour, linewidth=linewidth, zorder=3)


def _draw_paper(axes: Axes, figure: PaperFigure, name: str, colour: str) -> None:
    if name in paper_curves(figure):
        curve = paper_curves(figure)[name]
        axes.plot(
            curve.steps, curve.value, color=colour, linewidth=0.8, linestyle=(0, (4, 2)), alpha=0.65, zorder=1
        )


def _finish(axes: Axes, steps: int | None = None) -> None:
    axes.set_xlim(0, steps)
    axes.set_xlabel("training steps")
    axes.xaxis.set_major_formatter(FuncFormatter(_steps_text))
    axes.grid(axis="y")


def _steps_text(steps: float, _: object = None) -> str:
    return f"{steps / 1000:g}k" if steps else "0"


def _draw_legend(figure: Figure, runs: Measurements, *, of_paper: bool = True) -> None:
    handles = [Line2D([], [], color=colour, label=setup.name) for setup, colour in _coloured(runs)]
    handles.append(Line2D([], [], color=INK, linewidth=0.9, label="virtual gravity"))
    if of_paper and set(runs.setup_names) & set(paper_numbers()):
        handles.append(
            Line2D([], [], color=FAINT, linewidth=0.8, linestyle=(0, (4, 2)), label="paper, digitised")
        )
    columns = len(handles) if len(handles) <= _MOST_IN_A_LINE else -(-len(handles) // 2)
    figure.legend(
        handles=handles, loc="outside upper center", ncols=columns, handlelength=1.8, columnspacing=1.6
    )
