"""What tables of a run's episodes are made of: means by seed, cells, and the printed table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from coachable.analysis.intervals import Estimate
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.files import write_atomic

_COLUMNS = 100


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
    write_atomic(path, f"# {title}\n\n" + "\n".join(lines) + f"\n\n{note}\n")
    return path


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


def cell(told: Estimate, factor: float = 1.0) -> str:
    """An estimate times a factor, with its interval, as it stands in a table."""

    def text(value: float) -> str:
        value *= factor
        return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"

    if np.isnan(told.value):
        return "–"
    ends = f" [{text(told.low)}, {text(told.high)}]" if told.has_interval else ""
    return text(told.value) + ends
