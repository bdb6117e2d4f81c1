"""The gaits that came out of a training, as a table with intervals."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from coachable.analysis.intervals import Estimate, estimate, mean
from coachable.analysis.sections import Section
from coachable.analysis.training_table import by_seed, cell, heading, tell_table
from coachable.experiments.run_folder.reader import Run

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
    "flight": ("flight [%]", 100.0),
    "transport": ("cost of transport", 1.0),
    "fell": ("fell [%]", 100.0),
}
"""What is told of episodes: a column, its name with the unit, and what it is multiplied with."""

NOTE = (
    "Deterministic episodes of one policy a seed; means over seeds of means over episodes, with 95 % "
    "bootstrap intervals over seeds. A seed's gait is that of most of its episodes, told by its footfalls. "
    "Follows: steps that the description pays +1. Whole cycles: all edges of one gone along, one after "
    "another. Strides: of the busiest foot, an episode. Alternation: touchdowns by the other foot than the "
    "last. Asymmetry: the feet's times on the ground, difference over mean. Cost of transport: work of the "
    "motors, braking counted as driving, per weight and distance. A speed was reached after the steps of the "
    "first evaluation that was so fast."
)


def tell_gaits(run: Run, speed: float, folder: Path) -> None:
    """Print the table of the gaits in `gaits.parquet`, and write it as Markdown.

    **Arguments:** `speed`, for how soon it was reached in the evaluations [m/s].
    """
    by_setup, by_lane = gait_sections(run, speed)
    tables = {"gaits": (heading(run), by_setup), "gaits-by-seed": ("Seed by seed", by_lane)}
    for name, (title, section) in tables.items():
        written = tell_table(title, section.header, section.rows, section.notes[0], folder / f"{name}.md")
        print(f"wrote {written}")


def gait_sections(run: Run, speed: float = 1.0) -> tuple[Section, Section]:
    """The table of the gaits in `gaits.parquet` by setup, and that by seed; `speed` as in `tell_gaits`."""
    gaits = run.columns("gaits")
    names = [setup.name for setup in run.experiment.setups]
    table = [("gaits of the seeds", *(_gaits(run, gaits, name) for name in names))]
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
    "Means over a seed's episodes. Lag: when in a stride of the first foot the second one touches down, a "
    "circular mean; 0.5 if they alternate evenly. Seconds: how long an episode lasted."
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


def _gaits(run: Run, gaits: dict[str, np.ndarray], setup: str) -> str:
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
    told = cell(estimate(mean, np.array(first, float)), 1e-3) + "k"
    return told if len(first) == len(seeds) else f"{told}, {len(first)} of {len(seeds)} seeds"
