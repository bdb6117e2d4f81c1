"""The numbers behind the printed tables, as plain data for programs: of one run, and of two."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from coachable.analysis import gait_table
from coachable.analysis.claims import decide
from coachable.analysis.comparison import compared, pairs
from coachable.analysis.measurements import Measurements, measure, measure_so_far
from coachable.analysis.statistics import at_the_end, statistics_of
from coachable.experiments.run_folder.reader import Run


def table_numbers(run: Run, deterministic: str | None = None) -> dict[str, Any]:
    """The numbers of `coachable table`: estimates over seeds with 95 % intervals, by setup.

    Of a run with a baseline they are `SetupStatistics` and the claims with their comparisons; of any other
    the measures of `measures`, at each seed's last evaluation so far. `deterministic` as in `measure`.

    **Raises:** what `measure` raises.
    """
    plan = run.experiment
    about = {"name": plan.name, "robot": plan.problem.robot, "status": run.status, "steps": plan.steps}
    if run.baseline is None:
        complete = run.status == "complete"
        runs = measure(run, deterministic) if complete else measure_so_far(run)
        return about | {
            "setups": [
                {"name": setup.name, "num_runs": setup.num_runs}
                | {measure.name: at_the_end(setup, measure) for measure in runs.evaluated}
                for setup in runs.setups
            ]
        }
    runs = measure(run, deterministic)
    return about | {
        "semantics": runs.semantics,
        "baseline_distance": runs.baseline_distance,
        "setups": [statistics_of(runs, setup) for setup in runs.setups],
        "claims": decide(runs),
    }


def comparison_numbers(studies: Mapping[str, Measurements]) -> dict[str, Any]:
    """The numbers of `coachable compare`: every measure that two setups of two studies share, pair by pair.

    **Raises:** what `pairs` raises.
    """
    (title, first), (other, second) = studies.items()
    return {
        "first": title,
        "second": other,
        "setups": [
            {"name": pair.name, "measures": compared(first, second, pair)} for pair in pairs(first, second)
        ],
    }


def gait_numbers(run: Run, speed: float) -> dict[str, Any]:
    """The numbers of `coachable gait`, from `gaits.parquet`: by setup, how many episodes show which gait,
    when each seed first reached a speed, and the measures of `gait_table` over seeds with 95 % intervals.

    **Arguments:** `speed`, for how soon it was reached in the evaluations [m/s].
    """
    gaits, names = run.columns("gaits"), [setup.name for setup in run.experiment.setups]
    dt = float(gaits["dt"][0])
    return {
        "name": run.experiment.name,
        "robot": run.experiment.problem.robot,
        "speed": speed,
        "setups": [
            {
                "name": name,
                "gaits": _gaits(run, gaits, name),
                "steps_to_speed": gait_table.steps_to_speed(run, name, speed * dt),
            }
            | {measure: gait_table.over_seeds(run, gaits, name, measure) for measure in gait_table.MEASURES}
            for name in names
        ],
    }


def _gaits(run: Run, gaits: Mapping[str, np.ndarray], setup: str) -> dict[str, int]:
    """How many episodes of all seeds show which gait, the most frequent first."""
    lanes = [run.lane(setup, seed).name for seed in run.experiment.seeds]
    return dict(Counter(gaits["gait"][np.isin(gaits["lane"], lanes)].tolist()).most_common())
