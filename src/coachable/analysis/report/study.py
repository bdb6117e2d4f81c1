"""One run folder as the page shows it: read once, every statistic taken from `coachable.analysis`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coachable.analysis.claims import Claim, decide
from coachable.analysis.gait_table import gait_sections
from coachable.analysis.measurements import Measurements, measure, measure_so_far
from coachable.analysis.report.curves import curves, updates
from coachable.analysis.report.walks import (
    Walks,
    baseline_walk,
    can_draw_walks,
    even_selection,
    packed_poses,
    packed_walk,
    stored_walks,
)
from coachable.analysis.sections import Section, sections_of, settings
from coachable.analysis.table import diverged_lanes
from coachable.behaviours.expressions import Number, Variable
from coachable.behaviours.predicates import Comparison, Predicate
from coachable.behaviours.rewriting import conjuncts
from coachable.experiments.run_folder.reader import Run, open_run
from coachable.foundation.data import parse_json, structure
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import read_text

Progress = Callable[[str], None]
"""Is called with what is under way."""


@dataclass(frozen=True, eq=False)
class StudyReport:
    """What there is to say of one run folder."""

    label: str
    """What sets it apart from the others in the report."""
    run: Run
    runs: Measurements | None
    """Of the finished part, if the study is under way; None if nothing could be measured."""
    claims: tuple[Claim, ...]
    sections: tuple[Section, ...]
    walks: Walks
    problems: tuple[str, ...]
    """What could not be read, and why."""

    @property
    def complete(self) -> bool:
        """Whether the study has ended."""
        return self.run.status == "complete"

    @property
    def standing(self) -> str:
        """How far a study under way has come, in a sentence; empty for a complete one."""
        if self.complete:
            return ""
        plan, word = self.run.experiment, "interrupted" if self.run.status == "interrupted" else "under way"
        if self.runs is None:
            return f"{self.label} is {word}; nothing can be shown of it yet."
        num_lanes = sum(setup.num_runs for setup in self.runs.setups)
        return (
            f"{self.label} is {word}: shown are {num_lanes} of {len(plan.lanes)} lanes up to step "
            f"{self.runs.steps:,} of {plan.steps:,}. "
            f"{'Claims and tables' if self.runs.has_baseline else 'Tables'} come when it is complete."
        )

    @property
    def draws_walks(self) -> bool:
        """Whether its walks can be drawn."""
        return can_draw_walks(self.run.experiment)

    @property
    def absent(self) -> str:
        """Why there are no claims and no walks, where there can be none."""
        robot = self.run.experiment.problem.robot
        if not self.run.experiment.problem.in_jax:
            return (
                f"{robot} is a Gymnasium environment: its runs keep no walks that a page could draw, and no "
                "baseline that the paper’s claims could be about."
            )
        return f"This page draws walkers with two straight legs, and {robot} is none."

    @property
    def watch_command(self) -> str:
        """What shows a policy of this run moving."""
        plan = self.run.experiment
        return (
            f"coachable watch runs/{self.run.path.resolve().name} --setup {plan.setups[0].name} "
            f"--seed {plan.first_seed} -o gait.gif"
        )

    def data(self, most_walks: int) -> dict[str, Any]:
        """What the page's script reads, with at most so many walks."""
        experiment, lanes = self.run.experiment, self._lanes()
        data = {
            "label": self.label,
            "steps": experiment.steps,
            "wallSeconds": self.run.manifest.get("wall_seconds") if self.complete else None,
            "setups": list(self.setup_names),
            "curves": curves(self.runs) if self.runs else [],
            "updates": updates(self.runs) if self.runs else [],
            "lanes": lanes,
            "plant": None,
        }
        return data | self._drawn(lanes, most_walks) if self.draws_walks else data

    def _drawn(self, lanes: list[dict[str, Any]], most_walks: int) -> dict[str, Any]:
        """What the walkers are drawn from; the lanes whose walk is in the page get it."""
        problem = self.run.experiment.require_plant("a walk")
        by_setup = {name: [lane for lane in lanes if lane["setup"] == name] for name in self.setup_names}
        share = most_walks // max(1, len(by_setup))
        chosen = {
            id(own[rank])
            for lanes_of_setup in by_setup.values()
            if (own := [lane for lane in lanes_of_setup if lane["name"] in self.walks])
            for rank in even_selection(len(own), share)
        }
        for lane in lanes:
            lane["walk"] = packed_walk(self.walks[lane["name"]], self.run) if id(lane) in chosen else None
        plant: Any = problem.plant.parameters
        return {
            "distance": "hip" if problem.distance == "hip_x" else "stance foot",
            "plant": {
                "leg": plant.leg_length,
                "a": plant.a,
                "b": plant.b,
                "hip": plant.hip_mass,
                "mass": plant.leg_mass,
            },
            "phases": [
                {"name": phase.name, "title": phase.title, "box": _box(phase.predicate)}
                for phase in self.run.behaviour.phases
            ],
            "poses": packed_poses([self.walks.get(lane["name"]) for lane in lanes]),
            "baseline": baseline_walk(self.walks, (self.run.baseline or {}).get("controller", ""), self.run),
        }

    @property
    def setup_names(self) -> tuple[str, ...]:
        """The plan's setups, in its order."""
        return tuple(setup.name for setup in self.run.experiment.setups)

    def _lanes(self) -> list[dict[str, Any]]:
        """Every lane that was measured or whose walk is stored, the farthest of each setup first."""
        lanes = {
            lane.name: {"name": lane.name, "setup": lane.setup, "seed": lane.seed} for lane in self.run.lanes
        }
        for setup in self.runs.setups if self.runs else ():
            for row, seed in enumerate(setup.seeds.tolist()):
                lanes[f"{setup.name}-{seed}"] |= {
                    name: _rounded(setup.final[column][row], digits)
                    for name, column, digits in _OF_A_LANE
                    if column in setup.final
                } | ({"fell": bool(setup.final_fell[row])} if "fell" in setup.final else {})
        known = [lane for lane in lanes.values() if len(lane) > 3 or lane["name"] in self.walks]
        order = {name: place for place, name in enumerate(self.setup_names)}
        return sorted(
            known, key=lambda lane: (order[lane["setup"]], -(lane.get("distance") or 0.0), lane["seed"])
        )


_OF_A_LANE = (
    ("distance", "distance", 4),
    ("inCycle", "share_in_cycle", 4),
    ("secondsUp", "seconds_up", 2),
    ("perturbedUp", "perturbed_up", 4),
)
"""What the page's script knows of a lane's last policy: its name there, the column, and how many decimals."""


def read_study(path: Path, progress: Progress) -> StudyReport:
    """Read a run folder and decide its claims. What is damaged within it is named among the problems.

    **Raises:** `RunFolderError` if the folder itself, its plan or its behaviour cannot be read.
    """
    progress(f"{path}: reading")
    run = open_run(path)
    problems: list[str] = []
    runs, claims, sections, walks = None, (), (), {}
    try:
        runs = measure(run) if run.status == "complete" else measure_so_far(run)
    except RunFolderError as error:
        problems.append(str(error))
    if runs and run.status == "complete":
        if runs.has_baseline:
            progress(f"{path}: deciding the claims")
            claims = decide(runs)
        progress(f"{path}: statistics")
        sections = sections_of(runs, claims)
    if can_draw_walks(run.experiment) and (run.status == "complete" or run.has_table("trajectories")):
        progress(f"{path}: walks")
        try:
            walks = stored_walks(run)
        except RunFolderError as error:
            problems.append(str(error))
    problems += diverged_lanes(run)
    for more in (_gaits, _passports):
        try:
            sections = (*sections, *more(run))
        except RunFolderError as error:
            problems.append(str(error))
    if run.baseline is None:
        sections = (*sections, *settings(run.experiment))
    return StudyReport(run.experiment.name, run, runs, claims, sections, walks, tuple(problems))


def labels(studies: Sequence[StudyReport]) -> tuple[str, ...]:
    """A short name for each study: the first thing in which they all differ."""
    plans = [study.run.experiment for study in studies]
    problems = [plan.problem.to_data() for plan in plans]
    for names in (
        [plan.name for plan in plans],
        [plan.problem.robot for plan in plans],
        [
            f"{problem['semantics']} semantics" if "semantics" in problem else plan.problem.robot
            for plan, problem in zip(plans, problems, strict=True)
        ],
        [f"trained by {plan.trainer.name}" for plan in plans],
        [f"reward read as {problem.get('reward_variant', 'described')}" for problem in problems],
        [study.run.path.resolve().name for study in studies],
    ):
        if len(set(names)) == len(studies):
            return tuple(names)
    return tuple(f"{plan.name} ({place})" for place, plan in enumerate(plans, start=1))


def _gaits(run: Run) -> tuple[Section, ...]:
    """The tables of the gaits, if `coachable gait` has measured them."""
    return gait_sections(run) if run.has_table("gaits") else ()


def _passports(run: Run) -> tuple[Section, ...]:
    """The table of gait passports, if `coachable verify` has written one.

    Nothing in it is measured or proven here, so it is shown as what the file claims.
    """
    file = run.path / "passports" / "summary.json"
    if not file.exists():
        return ()
    try:
        table = structure(
            _Table, parse_json(read_text(file), str(file), RunFolderError), str(file), RunFolderError
        )
    except RunFolderError as error:
        raise RunFolderError(f"{error}; verify the run again") from None
    header = tuple("proof claimed" if name == "proven" else name for name in table.header)
    if any(len(row) != len(header) for row in table.rows):
        raise RunFolderError(
            f"{file} is damaged: its rows are not as long as its header; verify the run again"
        )
    title = f"{table.title} (claimed, not re-checked)"
    return (Section(title, header, table.rows, (_CLAIMED, table.note)),)


@dataclass(frozen=True)
class _Table:
    """What `coachable verify --all` writes beside the passports."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str


_CLAIMED = (
    "This page has re-checked none of these numbers: they are what passports/summary.json claims. "
    "`coachable verify --recheck` proves a certificate anew."
)


def _box(predicate: Predicate) -> dict[str, list[float | None]]:
    """Between which bounds a phase keeps each signal, as far as its comparisons are joined by "and"."""
    box: dict[str, list[float | None]] = {}
    for part in conjuncts(predicate):
        match part:
            case Comparison(Variable(signal), relation, Number(value)):
                bounds = box.setdefault(signal, [None, None])
                side = 0 if relation.startswith(">") else 1
                bound, tighter = bounds[side], max if side == 0 else min
                bounds[side] = value if bound is None else tighter(bound, value)
    return box


def _rounded(value: float, digits: int) -> float | None:
    return None if value != value else round(float(value), digits)
