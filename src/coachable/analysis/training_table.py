"""What came out of a training in somebody's environment: a table, and the learning curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from coachable.analysis.figures import WIDTH
from coachable.analysis.intervals import Estimate, estimate, interval, mean
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.errors import RunFolderError
from coachable.foundation.style import drawing, save, setup_colours

_RESAMPLES = 999
_COLUMNS = 100

MEASURES = {
    "environment": ("environment's return", 1.0),
    "behaviour": ("behaviour's return", 1.0),
    "share_in_cycle": ("steps in the cycle [%]", 100.0),
    "fell": ("episodes that fell [%]", 100.0),
    "length": ("episode's length [steps]", 1.0),
    "distance": ("distance [m]", 1.0),
}
"""What is told of evaluations: a column, its name with the unit, and what it is multiplied with."""


def tell_training(run: Run, folder: Path) -> None:
    """Print a training's table; write it as Markdown, with its learning curves as SVG and PNG."""
    header, rows = _rows(run)
    written = tell_table(heading(run), header, rows, NOTE, folder / "table.md")
    figure = learning_curves(run)
    paths = [folder / f"learning_curves.{suffix}" for suffix in ("svg", "png")]
    for path in paths:
        save(figure, path)
    for path in (*paths, written):
        print(f"wrote {path}")


def tell_table(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str, path: Path
) -> Path:
    """Print a table, and write it as Markdown; where it is written."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=_COLUMNS)
    grid = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in header:
        grid.add_column(Text(name))
    for row in rows:
        grid.add_row(*map(Text, row))
    console.print(Text(title, style="bold"))
    console.print(grid)
    console.print(note, style="dim italic", highlight=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)]
    path.write_text(f"# {title}\n\n" + "\n".join(lines) + f"\n\n{note}\n", encoding="utf-8")
    return path


NOTE = (
    "Last evaluation of each seed, deterministic episodes from starts that training never sees; means over "
    "seeds with 95 % bootstrap intervals over seeds. The environment's return is what it pays by itself."
)


def heading(run: Run) -> str:
    """What was trained, in one line."""
    plan = run.experiment
    status = "" if run.status == "complete" else f", {run.status}"
    return (
        f"{plan.name}: {plan.problem.robot}, {run.behaviour.name}, {plan.trainer.name}, "
        f"{len(plan.setups)} setup"
        f"{'s' * (len(plan.setups) != 1)} × {plan.num_seeds} seed{'s' * (plan.num_seeds != 1)} × "
        f"{plan.steps:,} steps{status}"
    )


def by_seed(run: Run, setup: str, measure: str) -> tuple[np.ndarray, np.ndarray]:
    """Training steps, and the mean over episodes of a measure at each evaluation, a row a seed.

    Seeds that have not been evaluated as often as others end in NaN.
    """
    columns = run.columns("evaluations")
    values = {}
    for seed in run.experiment.seeds:
        mine = columns["lane"] == run.lane(setup, seed).name
        steps = columns["step"][mine]
        for step in np.unique(steps):
            values[seed, int(step)] = float(np.mean(columns[measure][mine][steps == step]))
    steps = sorted({step for _, step in values})
    rows = [[values.get((seed, step), np.nan) for step in steps] for seed in run.experiment.seeds]
    return np.array(steps), np.array(rows).reshape(len(run.experiment.seeds), len(steps))


def final(run: Run, setup: str, measure: str) -> Estimate:
    """The mean over seeds of a measure at each seed's last evaluation, with its interval."""
    _, rows = by_seed(run, setup, measure)
    last = [row[~np.isnan(row)][-1] for row in rows if not np.isnan(row).all()]
    return estimate(mean, np.array(last))


def learning_curves(run: Run) -> Figure:
    """Three panels against training steps: the environment's return, the behaviour's, the share in the cycle.

    A line is the mean over seeds, its band the pointwise 95 % interval; with one seed there is no band.
    """
    colours = setup_colours([setup.name for setup in run.experiment.setups])
    panels = ("environment", "behaviour", "share_in_cycle")
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
        for axes, measure in zip(figure.subplots(1, len(panels)), panels, strict=True):
            name, factor = MEASURES[measure]
            for setup in run.experiment.setups:
                steps, rows = by_seed(run, setup.name, measure)
                complete = ~np.isnan(rows).any(axis=0)
                steps, rows = steps[complete] / 1_000, rows[:, complete] * factor
                if not len(steps):
                    continue
                axes.plot(steps, rows.mean(axis=0), color=colours[setup.name], label=setup.name)
                if len(rows) > 1:
                    low, high = interval(mean, rows, resamples=_RESAMPLES)
                    axes.fill_between(steps, low, high, color=colours[setup.name], alpha=0.15, linewidth=0)
            axes.set_xlabel("training steps [thousands]")
            axes.set_title(name, fontsize="medium")
            axes.set_xlim(0, None)
            if measure == "share_in_cycle":
                axes.set_ylim(0, 100)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc="outside upper center", ncols=len(handles))
    return figure


def measured(run: Run) -> list[str]:
    """The columns of `MEASURES` that a training has.

    **Raises:** `RunFolderError` if nothing has been evaluated yet.
    """
    evaluations = run.columns("evaluations")
    if not len(evaluations["return"]):
        raise RunFolderError(
            f"{run.path}: nothing has been evaluated yet; give the command that began it again to go on"
        )
    return [name for name in MEASURES if not np.isnan(evaluations[name].astype(float)).all()]


def _rows(run: Run) -> tuple[list[str], list[list[str]]]:
    shown = measured(run)
    header = ["setup", *(MEASURES[name][0] for name in shown)]
    rows = []
    for setup in run.experiment.setups:
        cells = []
        for measure in shown:
            told, factor = final(run, setup.name, measure), MEASURES[measure][1]
            cells.append(cell(told, factor))
        rows.append([setup.name, *cells])
    return header, rows


def cell(told: Estimate, factor: float = 1.0) -> str:
    """An estimate times a factor, with its interval, as it stands in a table."""

    def text(value: float) -> str:
        value *= factor
        return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"

    if np.isnan(told.value):
        return "–"
    ends = f" [{text(told.low)}, {text(told.high)}]" if told.has_interval else ""
    return text(told.value) + ends
