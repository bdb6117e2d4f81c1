"""Motions to be drawn: a lane's stored walk, a fresh one where that is too short, or a baseline's."""

from __future__ import annotations

from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.drawing.motion import Motion
from coachable.envs.baselines import baseline
from coachable.envs.squashing import Deterministic
from coachable.experiments.api import rollout
from coachable.experiments.experiment import Which
from coachable.experiments.run_folder.reader import Run
from coachable.plants.plant import Plant
from coachable.rewards.setup import Semantics

STORED_SECONDS = 10.0
"""How long the walks in a run folder are."""


@dataclass(frozen=True, eq=False)
class TitledMotion:
    """A motion with its title and the behaviour whose phases it is drawn with."""

    title: str
    motion: Motion
    behaviour: Behaviour


def walk_of_baseline(
    name: str,
    semantics: Semantics,
    seconds: float,
    plant: Plant,
    behaviour: Behaviour | None = None,
) -> TitledMotion:
    """A baseline's walk, in float64.

    **Arguments:** `name`, as in `controller_of`; `behaviour`, whose phases are drawn, by default the one that
    ships for the plant.
    """
    behaviour = behaviour or load_behaviour(plant.behaviour_under(semantics))
    report = baseline(name, semantics, seconds=seconds, plant=plant, behaviour=behaviour)
    motion = Motion.of(plant, report.trajectory.columns())
    return TitledMotion(f"{name}, {report.hip_x:.2f} m", motion, behaviour)


def walk_of_lane(
    run: Run,
    setup: str,
    seed: int,
    which: Which,
    seconds: float,
    deterministic: Deterministic | None = None,
) -> TitledMotion:
    """A lane's stored walk as far as it goes, a fresh one if that is not far enough.

    **Arguments:** `deterministic`, what its policy does when it does not explore, by default as it was kept.

    **Raises:** `RunFolderError` if the run has no such lane, or what is stored of it is damaged.
    """
    problem = run.experiment.require_plant("a stored walk")
    if seconds <= STORED_SECONDS and deterministic in (None, run.experiment.deterministic[0]):
        stored = run.trajectory(setup, seed, which)
        columns = {name: column[stored["t"] <= seconds + 1e-6] for name, column in stored.items()}
    else:
        columns = rollout(
            run.policy(setup, seed, which, deterministic),
            seconds,
            semantics=problem.semantics,
            plant=problem.plant,
            behaviour=run.behaviour,
        ).columns()
    return TitledMotion(f"{setup}, seed {seed}", Motion.of(problem.plant, columns), run.behaviour)
