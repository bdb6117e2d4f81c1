"""What every run of a study measured: the arrays that all statistics start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float, Int, Num

from coachable.analysis.measures import BESIDE_A_BASELINE, Measure, measures_of
from coachable.experiments.experiment import Experiment, Lane
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import DIAGNOSTICS, table_of_rule
from coachable.foundation.errors import RunFolderError
from coachable.foundation.suggestion import suggestion

WATCHED_SECONDS = 100.0
"""How long the final walkers are watched."""

GRID_STEPS = 1_000
"""Learning curves are read every 1,000 training steps."""


@dataclass(frozen=True, eq=False)
class SetupRuns:
    """The runs of one reward setup, in order of their seeds. A row of every array is a run.

    Beside a baseline, returns are normalised: divided by its return under the same setup and semantics. They
    are NaN where that is not positive, and the figures of survival are NaN where none were measured.
    """

    name: str
    seeds: Int[np.ndarray, " runs"]
    evaluations: Mapping[str, Num[np.ndarray, "runs checkpoints"]]
    """By column: means over the episodes of each evaluation."""
    final: Mapping[str, Num[np.ndarray, " runs"]]
    """By column: the same of the evaluation after the last update, and of `survival`."""
    returns: Float[np.ndarray, "runs grid"]
    """Return of the last training episode finished by each grid step; NaN before the first."""
    highest_return: Float[np.ndarray, " runs"]
    final_return: Float[np.ndarray, " runs"]
    diagnostics: Mapping[str, Float[np.ndarray, "runs checkpoints"]] = field(default_factory=dict)
    """By column of `DIAGNOSTICS`: of the update after the last training episode finished by a checkpoint."""

    def values(self, measure: Measure) -> Num[np.ndarray, "runs points"]:
        """A measure along the training, at the steps that `Measurements.steps_of` gives."""
        of_episodes = {"return": self.returns}
        tables = {"evaluations": self.evaluations, "episodes": of_episodes, "updates": self.diagnostics}
        return measure.read(tables[measure.table][measure.column])

    def last(self, measure: Measure) -> Num[np.ndarray, " runs"]:
        """A measure of the evaluations, after the last update."""
        return measure.read(self.final[measure.column])

    @property
    def num_runs(self) -> int:
        """How many runs there are."""
        return len(self.seeds)

    @property
    def distance(self) -> Num[np.ndarray, "runs checkpoints"]:
        """Distance of each evaluation [m], falls included."""
        return self.evaluations["distance"]

    @property
    def fell(self) -> Bool[np.ndarray, "runs checkpoints"]:
        """Whether each evaluation ended in a fall."""
        return self.evaluations["fell"] > 0

    @property
    def final_distance(self) -> Num[np.ndarray, " runs"]:
        """Distance of the evaluation after the last update [m]."""
        return self.final["distance"]

    @property
    def final_fell(self) -> Bool[np.ndarray, " runs"]:
        """Whether the evaluation after the last update ended in a fall."""
        return self.final["fell"] > 0

    @property
    def final_share_in_cycle(self) -> Num[np.ndarray, " runs"]:
        """Share of the final evaluation's samples that lie in the described cycle."""
        return self.final["share_in_cycle"]

    @property
    def seconds_up(self) -> Num[np.ndarray, " runs"]:
        """How long the final walker stays up [s], of 100."""
        return self.final["seconds_up"]

    @property
    def perturbed_up(self) -> Num[np.ndarray, " runs"]:
        """Share of the perturbed starts from which the final walker stays up."""
        return self.final["perturbed_up"]

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

    experiment: Experiment
    steps: int
    """Training steps of a run: as planned, or so far."""
    checkpoints: Int[np.ndarray, " checkpoints"]
    """Training steps at which the policies were evaluated; the final evaluation is kept apart."""
    grid: Int[np.ndarray, " grid"]
    measures: tuple[Measure, ...]
    """What was measured, in the order in which it is shown."""
    baseline_distance: float
    """Distance of the baseline controller [m], measured like that of the runs; NaN without one."""
    setups: tuple[SetupRuns, ...]

    def __getitem__(self, name: str) -> SetupRuns:
        return next(setup for setup in self.setups if setup.name == name)

    def of_setups(self, names: Sequence[str]) -> Measurements:
        """The same of some setups alone, in this order.

        **Raises:** `RunFolderError` for a setup that is not among them.
        """
        for name in names:
            if name not in self.setup_names:
                raise RunFolderError(f"there is no setup {name!r}; {suggestion(name, self.setup_names)}")
        return replace(self, setups=tuple(self[name] for name in names))

    @property
    def name(self) -> str:
        """The study's name."""
        return self.experiment.name

    @property
    def semantics(self) -> str:
        """The semantics of a plant's study."""
        return self.experiment.require_plant("a semantics").semantics

    @property
    def has_baseline(self) -> bool:
        """Whether there is a baseline, as in the paper's study: its tables and claims are about that."""
        return not np.isnan(self.baseline_distance)

    @property
    def setup_names(self) -> tuple[str, ...]:
        """The setups in the order of the plan."""
        return tuple(setup.name for setup in self.setups)

    @property
    def evaluated(self) -> tuple[Measure, ...]:
        """The measures that evaluations have a value of; the final one has one, too."""
        return tuple(measure for measure in self.measures if measure.table == "evaluations")

    def steps_of(self, measure: Measure) -> Int[np.ndarray, " points"]:
        """The training steps at which a measure was taken."""
        return self.grid if measure.table == "episodes" else self.checkpoints

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


def measure(run: Run, deterministic: str | None = None) -> Measurements:
    """The measurements in the folder of a run that has ended.

    **Arguments:** `deterministic`, by which of the experiment's rules the policies act that are measured; by
    default its first.

    **Raises:** `RunFolderError` if a table is missing or damaged, the study has not ended, or its policies
    were not evaluated by this rule.
    """
    first, *further = run.experiment.deterministic
    rule = first if deterministic is None else deterministic
    if rule not in (first, *further):
        raise RunFolderError(
            f"{run.path}: policies were not evaluated by {rule!r}; {suggestion(rule, (first, *further))}"
        )
    names = ("evaluations", "survival")
    evaluations, survival = names if rule == first else [table_of_rule(name, rule) for name in names]
    return measure_tables(
        replace(run.experiment, deterministic=(rule,)),
        run.baseline,
        run.table(evaluations),
        run.table("episodes"),
        run.table(survival) if run.has_table(survival) else None,
    )


def measure_tables(
    experiment: Experiment,
    baseline: Mapping[str, Any] | None,
    evaluations: pa.Table,
    episodes: pa.Table,
    survival: pa.Table | None,
) -> Measurements:
    """`measure` for tables with the columns of a run folder.

    **Arguments:** `baseline` is the baseline controller's `hip_x` and `foot_x` [m] and its `returns` by
    setup; `None` for a problem without one.

    **Raises:** `RunFolderError`, naming the lane, if one lacks evaluations that others have or, beside a
    baseline, has no finished training episode.
    """
    tables = _Tables.of(experiment, baseline, evaluations, episodes, survival)
    _require_all_evaluations(tables.evaluated, experiment.lanes)
    return _measured(experiment, baseline, tables, experiment.lanes, experiment.steps)


def measure_so_far(run: Run) -> Measurements:
    """The measurements of a study that is under way, for a look at it: "final" is the latest so far.

    Lanes are trained in turns, so that some are further than others. What is measured are the lanes that have
    come to a common step, up to that step, which is chosen for the most evaluations in all.

    **Raises:** `RunFolderError` if a table is missing or damaged, or no lane has been evaluated yet.
    """
    experiment, baseline = run.experiment, run.baseline
    tables = _Tables.of(experiment, baseline, run.table("evaluations"), run.table("episodes"), None)
    begun = [
        lane
        for lane in run.lanes
        if lane.name in tables.evaluated and (baseline is None or lane.name in tables.trained)
    ]
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
    tables = replace(tables, evaluated=cut)
    return _measured(experiment, baseline, tables, lanes, min(reached, experiment.steps))


Columns = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class _Tables:
    """The columns of each table by lane."""

    measures: tuple[Measure, ...]
    evaluated: Mapping[str, Columns]
    trained: Mapping[str, Columns]
    watched: Mapping[str, Columns]

    @staticmethod
    def of(
        experiment: Experiment,
        baseline: Mapping[str, Any] | None,
        evaluations: pa.Table,
        episodes: pa.Table,
        survival: pa.Table | None,
    ) -> _Tables:
        if experiment.problem.in_jax:
            distance = evaluations[experiment.require_plant("a distance").distance]
            # A plant's table may have a reward term of that name.
            terms = [name for name in evaluations.column_names if name != "distance"]
            evaluations = evaluations.select(terms).append_column("distance", distance)
        measures = measures_of(evaluations) if baseline is None else BESIDE_A_BASELINE
        evaluated = [*dict.fromkeys(part.column for part in measures if part.table == "evaluations")]
        reported = [name for name in DIAGNOSTICS if name in episodes.column_names]
        return _Tables(
            measures,
            _by_lane(_means(evaluations, evaluated), "step", ("step", *evaluated)),
            _by_lane(episodes, "end_step", ("end_step", "return", *reported)),
            {} if survival is None else _by_lane(survival, "lane", ("seconds_up", "perturbed_up")),
        )


def _measured(
    experiment: Experiment,
    baseline: Mapping[str, Any] | None,
    tables: _Tables,
    lanes: Sequence[Lane],
    steps: int,
) -> Measurements:
    evaluated_at = tables.evaluated[lanes[0].name]["step"]
    checkpoints = evaluated_at[evaluated_at <= steps] if evaluated_at[0] <= steps else evaluated_at
    grid = np.arange(GRID_STEPS, max(steps, GRID_STEPS) + 1, GRID_STEPS)

    def scale(setup: str) -> float:
        if baseline is None:
            return 1.0
        its_return = float(baseline["returns"][setup])
        return its_return if its_return > 0 else np.nan

    def setup_runs(name: str) -> SetupRuns:
        own = [lane for lane in lanes if lane.setup == name]
        names = [lane.name for lane in own]
        columns = [column for column in tables.evaluated[names[0]] if column != "step"]
        evaluated = {column: _stack(tables.evaluated, names, column) for column in columns}
        up = {column: _stack(tables.watched, names, column) for column in ("seconds_up", "perturbed_up")}
        trained = [_finished(tables.trained, lane, required=baseline is not None) for lane in names]
        returns = [episodes["return"] / scale(name) for episodes in trained]
        ends = [episodes["end_step"] for episodes in trained]
        return SetupRuns(
            name=name,
            seeds=np.array([lane.seed for lane in own]),
            evaluations={column: values[:, : len(checkpoints)] for column, values in evaluated.items()},
            final={column: values[:, -1] for column, values in (evaluated | up).items()},
            returns=np.stack([_last_finished(*episode, grid) for episode in zip(ends, returns, strict=True)]),
            highest_return=np.array([lane.max() if len(lane) else np.nan for lane in returns]),
            final_return=np.array([lane[-1] if len(lane) else np.nan for lane in returns]),
            diagnostics={
                column: np.stack(
                    [
                        _last_finished(episodes["end_step"], episodes[column], checkpoints)
                        for episodes in trained
                    ]
                )
                for column in DIAGNOSTICS
                if all(column in episodes for episodes in trained)
            },
        )

    return Measurements(
        experiment=experiment,
        steps=steps,
        checkpoints=checkpoints.astype(int),
        grid=grid,
        measures=tables.measures,
        baseline_distance=np.nan if baseline is None else _distance_of(experiment, baseline),
        setups=tuple(setup_runs(name) for name in dict.fromkeys(lane.setup for lane in lanes)),
    )


def _distance_of(experiment: Experiment, baseline: Mapping[str, Any]) -> float:
    return float(baseline[experiment.require_plant("a baseline").distance])


def _means(evaluations: pa.Table, columns: Sequence[str]) -> pa.Table:
    """The means of some columns over the episodes of each evaluation of a lane."""
    means = evaluations.group_by(["lane", "step"]).aggregate([(column, "mean") for column in columns])
    return means.rename_columns([name.removesuffix("_mean") for name in means.column_names])


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


def _finished(trained: Mapping[str, Columns], lane: str, required: bool) -> Columns:
    """The columns of a lane's finished training episodes, of which there may be none if not `required`."""
    if lane in trained:
        return trained[lane]
    if required:
        raise RunFolderError(f"lane {lane} has no finished training episode; run the study again to go on")
    nothing = np.zeros(0)
    return dict.fromkeys(("end_step", "return", *DIAGNOSTICS), nothing)


def _last_finished(ends: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """The value of the last episode that ended at or before each grid step; NaN before the first."""
    index = np.searchsorted(ends, grid, side="right")
    return np.concatenate([[np.nan], values])[index]
