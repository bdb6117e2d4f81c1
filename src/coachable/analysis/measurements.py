"""What every run of a study measured: the arrays that all statistics start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float, Int

from coachable.experiments.experiment import Experiment, Lane
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import DIAGNOSTICS
from coachable.foundation.errors import RunFolderError

WATCHED_SECONDS = 100.0
"""How long the final walkers are watched."""

GRID_STEPS = 1_000
"""Learning curves are read every 1,000 training steps."""


@dataclass(frozen=True, eq=False)
class SetupRuns:
    """The runs of one reward setup, in order of their seeds. A row of every array is a run.

    Returns are normalised: divided by the baseline's return under the same setup and semantics. They are NaN
    where that is not positive, and `seconds_up` and the rest of the survival figures are NaN where none were
    measured.
    """

    name: str
    seeds: Int[np.ndarray, " runs"]
    distance: Float[np.ndarray, "runs checkpoints"]
    """Distance of each evaluation [m], falls included."""
    fell: Bool[np.ndarray, "runs checkpoints"]
    share_in_cycle: Float[np.ndarray, "runs checkpoints"]
    """Share of each evaluation's samples that lie in the described cycle."""
    final_distance: Float[np.ndarray, " runs"]
    """Distance of the evaluation after the last update [m]."""
    final_fell: Bool[np.ndarray, " runs"]
    final_share_in_cycle: Float[np.ndarray, " runs"]
    returns: Float[np.ndarray, "runs grid"]
    """Return of the last training episode finished by each grid step; NaN before the first."""
    highest_return: Float[np.ndarray, " runs"]
    final_return: Float[np.ndarray, " runs"]
    seconds_up: Float[np.ndarray, " runs"]
    """How long the final walker stays up [s], of 100."""
    perturbed_up: Float[np.ndarray, " runs"]
    """Share of the perturbed starts from which the final walker stays up."""
    diagnostics: Mapping[str, Float[np.ndarray, "runs checkpoints"]] = field(default_factory=dict)
    """By column of `DIAGNOSTICS`: of the update after the last training episode finished by a checkpoint."""

    @property
    def num_runs(self) -> int:
        """How many runs there are."""
        return len(self.seeds)

    @property
    def watched_on(self) -> bool:
        """Whether every final walker was watched for 100 s, and from perturbed starts."""
        return not (np.isnan(self.seconds_up).any() or np.isnan(self.perturbed_up).any())

    @property
    def up_to_the_end(self) -> Bool[np.ndarray, " runs"]:
        """Whether the final walker is still up after 100 s."""
        return self.seconds_up >= WATCHED_SECONDS

    @property
    def highest(self) -> Float[np.ndarray, " runs"]:
        """Highest(run): the greatest distance among a run's evaluations [m]."""
        return self.distance.max(axis=1)

    @property
    def highest_surviving(self) -> Float[np.ndarray, " surviving"]:
        """The same over the evaluations that did not end in a fall, for the runs that have any [m]."""
        highest = np.where(self.fell, -np.inf, self.distance).max(axis=1)
        return highest[np.isfinite(highest)]

    @property
    def final_surviving(self) -> Float[np.ndarray, " surviving"]:
        """The final distances of the runs whose final evaluation did not end in a fall [m]."""
        return self.final_distance[~self.final_fell]

    @property
    def highest_so_far(self) -> Float[np.ndarray, "runs checkpoints"]:
        """Highest(run) with the evaluations up to each checkpoint only [m]."""
        return np.maximum.accumulate(self.distance, axis=1)

    @property
    def highest_of_all_runs(self) -> Float[np.ndarray, " checkpoints"]:
        """The paper's curve: the greatest distance of any run so far [m]. It grows with their number."""
        return self.highest_so_far.max(axis=0)

    def late_returns(self, grid: Int[np.ndarray, " grid"], last_steps: int) -> Float[np.ndarray, " runs"]:
        """The mean of each run's normalised return over the last `last_steps` training steps."""
        return self.returns[:, grid > grid[-1] - last_steps].mean(axis=1)


@dataclass(frozen=True, eq=False)
class Measurements:
    """All runs of a study, with what they are measured against."""

    name: str
    """The study's name."""
    semantics: str
    steps: int
    """Training steps of a run, as planned."""
    checkpoints: Int[np.ndarray, " checkpoints"]
    """Training steps at which the walkers were evaluated; the final evaluation is kept apart."""
    grid: Int[np.ndarray, " grid"]
    baseline_distance: float
    """Distance of the virtual gravity controller [m], measured like that of the runs."""
    setups: tuple[SetupRuns, ...]

    def __getitem__(self, name: str) -> SetupRuns:
        return next(setup for setup in self.setups if setup.name == name)

    @property
    def setup_names(self) -> tuple[str, ...]:
        """The setups in the order of the plan."""
        return tuple(setup.name for setup in self.setups)

    def steps_to_baseline(self, setup: SetupRuns) -> Float[np.ndarray, " runs"]:
        """Training steps until a run's first evaluation passes the baseline's distance; `steps` if none does.

        Every run is observed to the end, so the mean of these is the restricted mean of the time to the
        baseline, the area under the Kaplan–Meier curve up to `steps`.
        """
        passes = setup.distance > self.baseline_distance
        return np.where(passes.any(axis=1), self.checkpoints[passes.argmax(axis=1)], self.steps).astype(float)

    def passes_baseline(self, setup: SetupRuns) -> Bool[np.ndarray, " runs"]:
        """Whether any evaluation of a run passes the baseline's distance."""
        return setup.highest > self.baseline_distance


def measure(run: Run) -> Measurements:
    """The measurements in a run folder.

    **Raises:** `RunFolderError` if a table is missing or damaged, or the study has not ended.
    """
    survival = run.table("survival") if (run.path / "survival.parquet").exists() else None
    return measure_tables(
        run.experiment, _baseline(run), run.table("evaluations"), run.table("episodes"), survival
    )


def measure_tables(
    experiment: Experiment,
    baseline: Mapping[str, Any],
    evaluations: pa.Table,
    episodes: pa.Table,
    survival: pa.Table | None,
) -> Measurements:
    """`measure` for tables with the columns of run folder format 1.

    **Arguments:** `baseline` is the virtual gravity controller's `hip_x` and `foot_x` [m] and its `returns`
    by setup.

    **Raises:** `RunFolderError`, naming the lane, if one lacks evaluations that others have or has no
    finished training episode.
    """
    tables = _Tables.of(experiment, evaluations, episodes, survival)
    _require_all_evaluations(tables.evaluated, experiment.lanes)
    return _measured(experiment, baseline, tables, experiment.lanes, experiment.steps)


def measure_so_far(run: Run) -> Measurements:
    """The measurements of a study that is under way, for a look at it: "final" is the latest so far.

    Lanes are trained in turns, so that some are further than others. What is measured are the lanes that have
    come to a common step, up to that step, which is chosen for the most evaluations in all.

    **Raises:** `RunFolderError` if a table is missing or damaged, or no lane has been evaluated yet.
    """
    tables = _Tables.of(run.experiment, run.table("evaluations"), run.table("episodes"), None)
    begun = [lane for lane in run.lanes if lane.name in tables.evaluated and lane.name in tables.trained]
    if not begun:
        raise RunFolderError(f"{run.path}: no lane has been evaluated yet; wait, and try again")
    counts = np.array([len(tables.evaluated[lane.name]["step"]) for lane in begun])
    count = max(counts.tolist(), key=lambda count: count * np.sum(counts >= count))
    lanes = [lane for lane, own in zip(begun, counts, strict=True) if own >= count]
    cut = {
        lane.name: {name: column[:count] for name, column in tables.evaluated[lane.name].items()}
        for lane in lanes
    }
    reached = int(cut[lanes[0].name]["step"][-1])
    return _measured(
        run.experiment,
        _baseline(run),
        replace(tables, evaluated=cut),
        lanes,
        min(reached, run.experiment.steps),
    )


def _baseline(run: Run) -> Mapping[str, Any]:
    if run.baseline is None:
        raise RunFolderError(f"{run.path}: {run.experiment.problem.robot} has no baseline to measure against")
    return run.baseline


Columns = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class _Tables:
    """The columns of each table by lane."""

    evaluated: Mapping[str, Columns]
    trained: Mapping[str, Columns]
    watched: Mapping[str, Columns]

    @staticmethod
    def of(
        experiment: Experiment, evaluations: pa.Table, episodes: pa.Table, survival: pa.Table | None
    ) -> _Tables:
        distance = experiment.require_plant("a study's table").distance
        reported = [name for name in DIAGNOSTICS if name in episodes.column_names]
        return _Tables(
            _by_lane(evaluations, "step", ("step", distance, "fell", "share_in_cycle")),
            _by_lane(episodes, "end_step", ("end_step", "return", *reported)),
            {} if survival is None else _by_lane(survival, "lane", ("seconds_up", "perturbed_up")),
        )


def _measured(
    experiment: Experiment, baseline: Mapping[str, Any], tables: _Tables, lanes: Sequence[Lane], steps: int
) -> Measurements:
    problem = experiment.require_plant("a study's table")
    evaluated_at = tables.evaluated[lanes[0].name]["step"]
    checkpoints = evaluated_at[evaluated_at <= steps] if evaluated_at[0] <= steps else evaluated_at
    grid = np.arange(GRID_STEPS, max(steps, GRID_STEPS) + 1, GRID_STEPS)

    def setup_runs(name: str) -> SetupRuns:
        own = [lane for lane in lanes if lane.setup == name]
        names = [lane.name for lane in own]
        evaluation = {
            column: _stack(tables.evaluated, names, column)
            for column in (problem.distance, "fell", "share_in_cycle")
        }
        up = {column: _stack(tables.watched, names, column) for column in ("seconds_up", "perturbed_up")}
        baseline_return = float(baseline["returns"][name])
        scale = baseline_return if baseline_return > 0 else np.nan
        returns = [_finished(tables.trained, lane, "return") / scale for lane in names]
        ends = [_finished(tables.trained, lane, "end_step") for lane in names]
        return SetupRuns(
            name=name,
            seeds=np.array([lane.seed for lane in own]),
            distance=evaluation[problem.distance][:, : len(checkpoints)],
            fell=evaluation["fell"][:, : len(checkpoints)].astype(bool),
            share_in_cycle=evaluation["share_in_cycle"][:, : len(checkpoints)],
            final_distance=evaluation[problem.distance][:, -1],
            final_fell=evaluation["fell"][:, -1].astype(bool),
            final_share_in_cycle=evaluation["share_in_cycle"][:, -1],
            returns=np.stack([_last_finished(*episode, grid) for episode in zip(ends, returns, strict=True)]),
            highest_return=np.array([np.max(lane) for lane in returns]),
            final_return=np.array([lane[-1] for lane in returns]),
            seconds_up=up["seconds_up"][:, -1],
            perturbed_up=up["perturbed_up"][:, -1],
            diagnostics={
                column: np.stack(
                    [
                        _last_finished(end, tables.trained[lane][column], checkpoints)
                        for lane, end in zip(names, ends, strict=True)
                    ]
                )
                for column in DIAGNOSTICS
                if column in tables.trained[names[0]]
            },
        )

    return Measurements(
        name=experiment.name,
        semantics=problem.semantics,
        steps=steps,
        checkpoints=checkpoints.astype(int),
        grid=grid,
        baseline_distance=float(baseline[problem.distance]),
        setups=tuple(setup_runs(name) for name in dict.fromkeys(lane.setup for lane in lanes)),
    )


def _by_lane(table: pa.Table, order: str, names: Sequence[str]) -> dict[str, Columns]:
    """The named columns of a table for each lane, its rows in the given order, as float64."""
    rows = table.sort_by([("lane", "ascending"), (order, "ascending")])
    lanes = rows["lane"].value_counts().to_pylist()
    ends = np.cumsum([lane["counts"] for lane in lanes])[:-1]
    parts = {name: np.split(rows[name].to_numpy().astype(float), ends) for name in names}
    return {lane["values"]: {name: parts[name][i] for name in names} for i, lane in enumerate(lanes)}


def _require_all_evaluations(evaluated: Mapping[str, Columns], lanes: Sequence[Lane]) -> None:
    """**Raises:** `RunFolderError` naming the first lane that was not evaluated where another one was."""
    steps = {lane.name: evaluated[lane.name]["step"] if lane.name in evaluated else [] for lane in lanes}
    most = max(steps.values(), key=len)
    for lane, own in steps.items():
        if not len(own) or not np.array_equal(own, most):
            raise RunFolderError(
                f"lane {lane} lacks evaluations: the study has not ended; run it again to go on"
            )


def _stack(by_lane: Mapping[str, Columns], lanes: Sequence[str], column: str) -> np.ndarray:
    return np.stack([by_lane[lane][column] if lane in by_lane else np.array([np.nan]) for lane in lanes])


def _finished(trained: Mapping[str, Columns], lane: str, column: str) -> np.ndarray:
    if lane not in trained:
        raise RunFolderError(f"lane {lane} has no finished training episode; run the study again to go on")
    return trained[lane][column]


def _last_finished(ends: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """The value of the last episode that ended at or before each grid step; NaN before the first."""
    index = np.searchsorted(ends, grid, side="right")
    return np.concatenate([[np.nan], values])[index]
