"""Walks to look at: a lane's stored one, a fresh one where that is too short, or a baseline's."""

from __future__ import annotations

from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.baselines import baseline
from coachable.experiments.api import rollout
from coachable.experiments.experiment import Which
from coachable.experiments.plan import IMPLIED
from coachable.experiments.run_folder.reader import Run
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters
from coachable.rewards.setup import Semantics

STORED_SECONDS = 10.0
"""How long the walks in a run folder are."""


@dataclass(frozen=True, eq=False)
class WalkToShow:
    """A trajectory with what is needed to draw it."""

    title: str
    trajectory: object
    """Arrays by name, as a rollout gives or a run folder stores them."""
    behaviour: Behaviour
    parameters: CompassParameters


def walk_of_baseline(name: str, semantics: Semantics, seconds: float) -> WalkToShow:
    """A baseline's walk, in float64."""
    report = baseline(name, semantics, seconds=seconds)
    behaviour = load_behaviour(IMPLIED[semantics]["behaviour"])
    return WalkToShow(f"{name}, {report.hip_x:.2f} m", report.trajectory, behaviour, PAPER_PARAMETERS)


def walk_of_lane(run: Run, setup: str, seed: int, which: Which, seconds: float) -> WalkToShow:
    """A lane's stored walk as far as it goes, a fresh one if that is not far enough.

    **Raises:** `RunFolderError` if the run has no such lane, or what is stored of it is damaged.
    """
    problem = run.experiment.require_plant("a walk to draw")
    title = f"{setup}, seed {seed}"
    if seconds <= STORED_SECONDS:
        stored = run.trajectory(setup, seed, which)
        walk = {name: column[stored["t"] <= seconds + 1e-6] for name, column in stored.items()}
        return WalkToShow(title, walk, run.behaviour, problem.plant)
    walk = rollout(
        run.policy(setup, seed, which),
        seconds,
        semantics=problem.semantics,
        parameters=problem.plant,
        behaviour=run.behaviour,
    )
    return WalkToShow(title, walk, run.behaviour, problem.plant)
