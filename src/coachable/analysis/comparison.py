"""Two studies of the same setup beside each other, say of two trainers: do their curves agree?"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coachable.analysis.figures import draw_band, panels
from coachable.analysis.intervals import Estimate, estimate, mean
from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.measures import DISTANCE, RETURN, Measure
from coachable.analysis.sections import Section
from coachable.analysis.significance import difference, two_sample
from coachable.analysis.statistics import LATE_STEPS, Band, mean_curve
from coachable.analysis.table import as_markdown, console, rendered
from coachable.experiments.experiment import Experiment
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import write_atomic
from coachable.foundation.style import INK, STANCE, SWING, save
from coachable.foundation.suggestion import in_a_row

Values = Callable[[Measurements, SetupRuns], np.ndarray]

_BESIDE_A_BASELINE: Mapping[str, Values] = {
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


@dataclass(frozen=True)
class Pair:
    """A setup of each of two studies, to be compared."""

    first: str
    second: str

    @property
    def name(self) -> str:
        """The setup's name, or both."""
        return self.first if self.first == self.second else f"{self.first}-{self.second}"


def compared(first: Measurements, second: Measurements, pair: Pair) -> list[Compared]:
    """Every measure of two setups that means the same in both studies."""
    ours, theirs = first[pair.first], second[pair.second]
    found = []
    for name, values in _final_values(first, second, pair).items():
        x, y = values(first, ours), values(second, theirs)
        if np.isnan(x).any() or np.isnan(y).any():
            continue
        p = min(1.0, 2 * min(two_sample(mean, x, y))) if np.ptp([*x, *y]) else 1.0
        by = estimate(partial(difference, mean), x, y)
        found.append(Compared(name, estimate(mean, x), estimate(mean, y), by, p))
    return found


def _final_values(first: Measurements, second: Measurements, pair: Pair) -> Mapping[str, Values]:
    if first.has_baseline:
        return _BESIDE_A_BASELINE
    return {
        f"final {measure.heading}": lambda _, setup, measure=measure: (
            setup.last(measure) * (100 if measure.unit == "%" else 1)
        )
        for measure in shared_measures(first, second, pair)
        if measure.table == "evaluations"
    }


def shared_measures(first: Measurements, second: Measurements, pair: Pair) -> list[Measure]:
    """The measures along the training that both studies have and that mean the same in both.

    The share in the cycle is about the described behaviour, and what a description pays about the setup, too.
    """
    if first.has_baseline:
        return [RETURN, DISTANCE]
    ours, theirs = first.experiment, second.experiment
    same = {"environment"}
    if _described(ours) == _described(theirs):
        same.add("behaviour")
    if ours.reward_hashes()[pair.first] == theirs.reward_hashes()[pair.second]:
        same.add("reward")
    return [
        measure for measure in first.measures if measure in second.measures and measure.depends_on in same
    ]


def _described(experiment: Experiment) -> tuple[Any, ...]:
    """The behaviour, and where its signals are read."""
    data = experiment.problem.to_data()
    return experiment.behaviour, data.get("signals"), data.get("dt")


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


def pairs(first: Measurements, second: Measurements) -> list[Pair]:
    """The setups to be compared: those that both studies have.

    Two studies of one Gymnasium environment without a setup in common are compared setup by setup, each with
    each: what the environment measures is the same, whatever was paid.

    **Raises:** `RunFolderError` if the studies are about different problems, follow different semantics, or,
    beside a baseline, have no setup in common.
    """
    robots = [_world(runs.experiment) for runs in (first, second)]
    if robots[0] != robots[1]:
        raise RunFolderError(
            f"the studies are of {robots[0]} and of {robots[1]}; nothing that was measured in one can be "
            "compared with the other"
        )
    if first.has_baseline != second.has_baseline:
        raise RunFolderError("only one of the studies has a baseline, by which its returns are divided")
    if first.experiment.problem.in_jax and first.semantics != second.semantics:
        raise RunFolderError(
            f"the studies follow {first.semantics} and {second.semantics} semantics; their distances are "
            "measured differently and cannot be compared"
        )
    common = [Pair(name, name) for name in first.setup_names if name in second.setup_names]
    if not common and not first.has_baseline:
        return [Pair(ours, theirs) for ours in first.setup_names for theirs in second.setup_names]
    if not common:
        raise RunFolderError("the studies have no setup in common")
    return common


def _world(experiment: Experiment) -> str:
    """The robot, with the options of its environment."""
    options = experiment.problem.to_data().get("env_options")
    given = ", ".join(f"{name} = {value!r}" for name, value in sorted(options.items())) if options else ""
    return experiment.problem.robot + (f" with {given}" if given else "")


def comparison_figure(studies: Mapping[str, Measurements], pair: Pair) -> Figure:
    """Both studies' curves of one setup laid over each other, with pointwise 95 % intervals."""
    (_, first), (_, second) = studies.items()
    measures = shared_measures(first, second, pair)
    drawn = list(zip(studies.items(), (pair.first, pair.second), (STANCE, SWING), strict=True))
    baselines = {RETURN: 1.0, DISTANCE: first.baseline_distance} if first.has_baseline else {}

    def draw(axes: Axes, measure: Measure) -> None:
        for (_, runs), setup, colour in drawn:
            draw_band(axes, mean_curve(runs, runs[setup], measure), colour, linewidth=1.2)
        if measure in baselines:
            axes.axhline(baselines[measure], color=INK, linewidth=0.9)

    handles = [
        Line2D([], [], color=colour, label=f"{title}, {runs[setup].num_runs} seeds")
        for (title, runs), setup, colour in drawn
    ]
    if baselines:
        handles.append(Line2D([], [], color=INK, linewidth=0.9, label="virtual gravity"))
    return panels(measures, draw, handles)


def write_comparison(studies: Mapping[str, Measurements], folder: Path) -> None:
    """Print the comparison of two studies, given by title; write it as Markdown, with figures."""
    (title, first), (other, second) = studies.items()
    compare = pairs(first, second)
    folder.mkdir(parents=True, exist_ok=True)
    out = console()
    pieces, written = [f"# {title} beside {other}"], []
    for pair in compare:
        section = Section(
            pair.name,
            ("measure", title, other, "difference", "p"),
            tuple(
                (row.measure, *map(_text, (row.first, row.second, row.difference)), f"{row.p:.3f}")
                for row in compared(first, second, pair)
            ),
            (_overlaps(first, second, pair),),
        )
        out.print(*rendered(section), sep="\n")
        pieces.append(as_markdown(section))
        figure = comparison_figure(studies, pair)
        for suffix in ("svg", "png"):
            written.append(folder / f"comparison-{pair.name}.{suffix}")
            save(figure, written[-1])
    out.print(NOTE, style="dim italic", highlight=False)
    written.append(folder / "comparison.md")
    write_atomic(written[-1], "\n\n".join([*pieces, NOTE]) + "\n")
    for path in written:
        print(f"wrote {path}")


def _overlaps(first: Measurements, second: Measurements, pair: Pair) -> str:
    """In how much of each curve the two intervals overlap, as a sentence."""
    ours, theirs = first[pair.first], second[pair.second]
    shared = shared_measures(first, second, pair)
    shares = [
        _overlap(
            share_of_overlap(mean_curve(first, ours, measure), mean_curve(second, theirs, measure)),
            _POINTS[measure] if first.has_baseline else f"the steps in {measure.words}",
        )
        for measure in shared
    ]
    runs = f"{ours.num_runs} and {theirs.num_runs} runs"
    sentence = f"{pair.name}, {runs}: the curves' 95 % intervals overlap at {in_a_row(shares)}."
    both = [measure for measure in first.measures if measure in second.measures]
    left = [measure.words for measure in both if measure not in shared]
    if first.has_baseline or not left:
        return sentence
    return f"{sentence} Not comparable, since described or paid otherwise: {', '.join(left)}."


NOTE = (
    "Means over runs with 95 % bootstrap intervals; difference: first − second; p: permutation test, "
    "two-sided, not corrected for the number of measures."
)
_POINTS = {RETURN: "the learning curve's points", DISTANCE: "the evaluations"}


def _overlap(share: float, points: str) -> str:
    if math.isnan(share):
        return f"none of {points}, which have no step in common"
    return f"{share:.0%} of {points}"


def _text(shown: Estimate) -> str:
    value = f"{shown.value:.2f}"
    return f"{value} [{shown.low:.2f}, {shown.high:.2f}]" if shown.has_interval else value
