"""The gaits that came out of a training, as a table with intervals."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from coachable.analysis.intervals import Estimate, estimate, mean
from coachable.analysis.sections import Section
from coachable.analysis.table import as_markdown, console, rendered
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.files import write_atomic

MEASURES = {
    "environment": ("environment's return", 1.0),
    "speed": ("speed [m/s]", 1.0),
    "share_in_cycle": ("in the cycle [%]", 100.0),
    "follows": ("follows [%]", 100.0),
    "cycles": ("whole cycles [1/s]", 1.0),
    "strides": ("strides", 1.0),
    "step_time": ("step time [s]", 1.0),
    "step_length": ("step length [m]", 1.0),
    "alternation": ("alternation [%]", 100.0),
    "asymmetry": ("asymmetry [%]", 1.0),
    "step_asymmetry": ("asymmetry of steps [%]", 1.0),
    "duty": ("duty factor [%]", 100.0),
    "overlap": ("two feet down [%]", 100.0),
    "flight": ("flight [%]", 100.0),
    "transport": ("cost of transport", 1.0),
    "fell": ("fell [%]", 100.0),
}
"""What is measured of episodes: a column, its name with the unit, and what it is multiplied with."""

NOTE = (
    "Deterministic episodes of one policy a seed; means over seeds of means over episodes, with 95 % "
    "bootstrap intervals over seeds. A seed's gait is that of most of its episodes, told by its footfalls. "
    "Follows: steps that the description pays +1. Whole cycles: all edges of one gone along, one after "
    "another. Strides: of the busiest foot, an episode. Alternation: steps from a landing of one foot alone "
    "to one of the other alone; feet that touch down within 0.15 of the time after which the footfalls "
    "repeat land together. (In a table that does not say when two feet are down: touchdowns by the other "
    "foot than the last.) Asymmetry: the feet's times on the ground, difference over mean; of steps: the "
    "lengths of those onto one foot and onto the other, the same. Duty factor: a foot's share of the time on "
    "the ground. Cost of transport: work of the motors, braking counted as driving, per weight and distance. "
    "A speed was reached after the steps of the first evaluation that was so fast."
)


def print_gaits(run: Run, speed: float, folder: Path) -> None:
    """Print the table of the gaits in `gaits.parquet`, and write it as Markdown.

    **Arguments:** `speed`, for how soon it was reached in the evaluations [m/s].
    """
    by_setup, by_lane = gait_sections(run, speed)
    titled = {
        "gaits": replace(by_setup, title=heading(run)),
        "gaits-by-seed": replace(by_lane, title="Seed by seed"),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, section in titled.items():
        console().print(*rendered(section), sep="\n")
        # A section that is a file by itself has the file's title.
        write_atomic(folder / f"{name}.md", as_markdown(section).removeprefix("#") + "\n")
        print(f"wrote {folder / name}.md")


def gait_sections(run: Run, speed: float = 1.0) -> tuple[Section, Section]:
    """The table of the gaits in `gaits.parquet` by setup, and that by seed; `speed` as in `print_gaits`."""
    gaits = run.columns("gaits")
    names = [setup.name for setup in run.experiment.setups]
    table = [("gaits of the seeds", *(usual_gaits(run, gaits, name) for name in names))]
    for measure, (title, factor) in MEASURES.items():
        if not np.isnan(gaits[measure].astype(float)).all():
            table.append((title, *(cell(over_seeds(run, gaits, name, measure), factor) for name in names)))
    dt = float(gaits["dt"][0])
    table.append((f"{speed:g} m/s after", *(_reached(run, name, speed * dt) for name in names)))
    lanes = tuple(tuple(_lane(gaits, lane.name)) for lane in run.lanes)
    return (
        Section("Gaits", ("", *names), tuple(table), (NOTE,)),
        Section("Gaits, seed by seed", LANE_HEADER, lanes, (LANE_NOTE,)),
    )


LANE_HEADER = (
    "lane",
    "gaits",
    "speed [m/s]",
    "follows [%]",
    "cycles [1/s]",
    "lag",
    "asymmetry [%]",
    "fell [%]",
    "seconds",
)
LANE_NOTE = (
    "Means over a seed's episodes. Lag: when in a stride of the first foot the second one lands, a circular "
    "mean; 0.5 if they alternate evenly; of four feet, a fore foot after the hind foot of its side. Seconds: "
    "how long an episode lasted."
)


def _lane(gaits: dict[str, np.ndarray], lane: str) -> list[str]:
    mine = gaits["lane"] == lane
    words = Counter(gaits["gait"][mine].tolist()).most_common()
    turns = np.exp(2j * np.pi * gaits["lag"][mine & ~np.isnan(gaits["lag"])])
    lag = np.angle(turns.mean()) / (2 * np.pi) % 1 if len(turns) else np.nan
    numbers = [
        (gaits["speed"], 1.0),
        (gaits["follows"], 100.0),
        (gaits["cycles"], 1.0),
        (np.full(len(mine), lag), 1.0),
        (gaits["asymmetry"], 1.0),
        (gaits["fell"].astype(float), 100.0),
        (gaits["length"] * gaits["dt"], 1.0),
    ]
    found = [values[mine][~np.isnan(values[mine])] for values, _ in numbers]
    cells = [
        cell(Estimate(float(some.mean())), factor) if len(some) else "–"
        for some, (_, factor) in zip(found, numbers, strict=True)
    ]
    return [lane, ", ".join(f"{count} {word}" for word, count in words), *cells]


def usual_gaits(run: Run, gaits: dict[str, np.ndarray], setup: str) -> str:
    """How many seeds do what; a seed does what most of its episodes show, of several as many the first."""
    usual = Counter()
    for seed in run.experiment.seeds:
        mine = gaits["gait"][gaits["lane"] == run.lane(setup, seed).name]
        usual[Counter(mine.tolist()).most_common(1)[0][0]] += 1
    return ", ".join(f"{count} {word}" for word, count in usual.most_common())


def over_seeds(run: Run, gaits: dict[str, np.ndarray], setup: str, measure: str) -> Estimate:
    """The mean over seeds of the mean over those of their episodes that have the measure."""
    values = gaits[measure].astype(float)
    mine = [values[gaits["lane"] == run.lane(setup, seed).name] for seed in run.experiment.seeds]
    return estimate(mean, np.array([np.nanmean(each) for each in mine if not np.isnan(each).all()], float))


def steps_to_speed(run: Run, setup: str, metres_a_step: float) -> list[int | None]:
    """Training steps of each seed's first evaluation that was so fast; `None` for a seed without one."""
    steps, distance = by_seed(run, setup, run.experiment.problem.distance)
    _, length = by_seed(run, setup, "length")
    return [int(steps[row.argmax()]) if row.any() else None for row in distance >= metres_a_step * length]


def _reached(run: Run, setup: str, metres_a_step: float) -> str:
    """After how many thousand steps the evaluations were so fast, and of how many seeds."""
    seeds = steps_to_speed(run, setup, metres_a_step)
    first = [steps for steps in seeds if steps is not None]
    if not first:
        return f"never, {len(seeds)} seed{'s' * (len(seeds) > 1)}"
    shown = cell(estimate(mean, np.array(first, float)), 1e-3) + "k"
    return shown if len(first) == len(seeds) else f"{shown}, {len(first)} of {len(seeds)} seeds"


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


def cell(shown: Estimate, factor: float = 1.0) -> str:
    """An estimate times a factor, with its interval, as it stands in a table."""

    def text(value: float) -> str:
        value *= factor
        return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"

    if np.isnan(shown.value):
        return "–"
    ends = f" [{text(shown.low)}, {text(shown.high)}]" if shown.has_interval else ""
    return text(shown.value) + ends
