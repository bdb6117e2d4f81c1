"""How much the numbers of a reward matter: how far the walkers of each choice come, and how soon.

    python -m bench.sensitivity runs/sensitivity runs/gamma-098 runs/gamma-0995 --out docs/results/sensitivity

The first run's setups are the arms, the first of them the one that the others are beside; further runs are of
that setup alone, with other settings, and are called by their folders' names. Needs nothing but the runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coachable.analysis.intervals import Estimate, estimate, mean, std
from coachable.analysis.measurements import Measurements, SetupRuns, measure
from coachable.analysis.sections import steps, with_interval
from coachable.experiments.run_folder.reader import open_run
from coachable.foundation.style import HAIRLINE, INK, STANCE, drawing, save


@dataclass(frozen=True)
class Arm:
    """One choice of the numbers, and what its walkers came to."""

    name: str
    num_runs: int
    final: Estimate
    """Of the evaluation after the last update [m]."""
    spread: Estimate
    num_up: int
    """After 100 s."""
    steps_to_baseline: Estimate
    num_passing: int

    @property
    def group(self) -> str:
        """What is varied."""
        return self.name.partition("-")[0]


def arms(paths: Sequence[Path]) -> list[Arm]:
    """The setups of the first run, and the first setup of each further one."""
    first, *others = [measure(open_run(path)) for path in paths]
    found = [_arm(setup.name, first, setup) for setup in first.setups]
    return found + [
        _arm(path.name, runs, runs.setups[0]) for path, runs in zip(paths[1:], others, strict=True)
    ]


def markdown(found: Sequence[Arm]) -> str:
    """A row an arm, with 95 % intervals over seeds."""
    rows = [
        (
            "arm",
            "final distance [m]",
            "its spread [m]",
            "up after 100 s",
            "steps to the baseline",
            "pass it",
        ),
        ("---", *["---:"] * 5),
        *(
            (
                arm.name,
                with_interval(arm.final),
                with_interval(arm.spread),
                f"{arm.num_up} of {arm.num_runs}",
                with_interval(arm.steps_to_baseline, steps),
                f"{arm.num_passing} of {arm.num_runs}",
            )
            for arm in found
        ),
    ]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows) + "\n"


def draw(found: Sequence[Arm], path: Path) -> None:
    """Distance and steps to the baseline, an arm a row; the band behind is the first arm's interval."""
    places, place = [], 0.0
    for before, arm in zip([found[0], *found], found, strict=False):
        place += 1.0 if arm.group == before.group else 1.6
        places.append(-place)
    with drawing():
        figure = Figure(figsize=(7.16, 0.9 + 0.22 * -places[-1]), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.4, 1))
        _dots(left, places, [arm.final for arm in found])
        _dots(right, places, [_scaled(arm.steps_to_baseline, 1e-3) for arm in found])
        for arm, at in zip(found, places, strict=True):
            left.annotate(
                f"{arm.num_up}/{arm.num_runs} up",
                (1.0, at),
                xycoords=("axes fraction", "data"),
                xytext=(-4, 0),
                textcoords="offset points",
                ha="right",
                va="center",
                fontsize=7,
            )
        left.set_yticks(places, [arm.name for arm in found])
        low, high = left.get_xlim()
        left.set(xlabel="final distance [m]", xlim=(low, high + 0.18 * (high - low)))
        right.set(xlabel="steps to the baseline [thousand]")
    save(figure, path)


def main() -> None:
    """Draw the runs of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    found = arms(arguments.runs)
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "sensitivity.md").write_text(markdown(found), encoding="utf-8")
    for suffix in ("svg", "png"):
        draw(found, arguments.out / f"sensitivity.{suffix}")
    print(markdown(found), end="")


def _arm(name: str, runs: Measurements, setup: SetupRuns) -> Arm:
    return Arm(
        name=name,
        num_runs=setup.num_runs,
        final=estimate(mean, setup.final_distance),
        spread=estimate(std, setup.final_distance),
        num_up=int(setup.up_to_the_end.sum()),
        steps_to_baseline=estimate(mean, runs.steps_to_baseline(setup)),
        num_passing=int(runs.passes_baseline(setup).sum()),
    )


def _dots(axes: Axes, places: Sequence[float], found: Sequence[Estimate]) -> None:
    first = found[0]
    axes.axvspan(first.low, first.high, color=HAIRLINE, lw=0, zorder=0)
    values = np.array([one.value for one in found])
    errors = np.abs(np.array([(one.low, one.high) for one in found]).T - values)
    axes.errorbar(values, places, xerr=errors, fmt="o", ms=4, color=STANCE, ecolor=INK, elinewidth=0.8)
    axes.grid(axis="x")


def _scaled(one: Estimate, factor: float) -> Estimate:
    return Estimate(one.value * factor, one.low * factor, one.high * factor)


if __name__ == "__main__":
    main()
