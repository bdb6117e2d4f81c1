"""The gaits of a training: every lane's policy walks some episodes, and each is measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from coachable.automata.monitor import Monitor
from coachable.behaviours.behaviour import Behaviour
from coachable.envs.problem import PlantProblem
from coachable.experiments.experiment import Which
from coachable.experiments.plant_walks import num_starts
from coachable.experiments.recorded_episodes import RecordedWalk, recorded_walk
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import GAITS
from coachable.foundation.data import whole_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.files import write_atomic
from coachable.foundation.tables import table_bytes, table_of
from coachable.gaits.classify import gait
from coachable.gaits.footfalls import CONTACT, feet
from coachable.gaits.measures import measures


@dataclass(frozen=True, eq=False)
class Footfalls:
    """When the feet of a walk are on the ground."""

    title: str
    time: Float[np.ndarray, " samples"]
    """[s]"""
    feet: Mapping[str, Bool[np.ndarray, " samples"]]
    """By their names."""


@dataclass(frozen=True, eq=False)
class Survey:
    """What a survey has to show beside the numbers in `gaits.parquet`."""

    footfalls: Mapping[str, list[Footfalls]]
    """Of each seed's first episode, by setup; empty where it is not known which foot stands."""
    absent: tuple[str, ...]
    """Sentences about what could not be measured."""


def survey(
    run: Run,
    episodes: int,
    which: Which = "last",
    report: Callable[[str, float], None] = lambda name, share: None,
) -> Survey:
    """Walk every lane's policy through so many episodes, each from another start; write `gaits.parquet`.

    A plant that has one start walks one episode.

    **Arguments:** `report`, called with a lane whenever another share of its episodes is done.

    **Raises:** as `recorded_walk`, and `ParameterError` for an environment without signals of its feet, and
    for no episode.
    """
    episodes = whole_number(episodes, "episodes", ParameterError, 1, 10**5)
    rows: list[dict[str, Any]] = []
    first: dict[str, list[Footfalls]] = {}
    absent: dict[str, None] = {}
    problem = run.experiment.problem
    if isinstance(problem, PlantProblem):
        episodes = num_starts(problem.plant, episodes)
    for setup in run.experiment.setups:
        for seed in run.experiment.seeds:
            for episode in range(episodes):
                walk = recorded_walk(run, setup.name, seed, which, episode)
                absent |= dict.fromkeys(walk.absent)
                on_ground = feet(walk.trace)
                if not on_ground and not isinstance(problem, PlantProblem):
                    raise ParameterError(
                        f"{problem.robot} has no signal that ends in {CONTACT}, so there are "
                        "no footfalls; give the plan one for every foot, 1 while it is on the ground"
                    )
                rows.append(
                    {"lane": run.lane(setup.name, seed).name, "episode": episode, **_row(run.behaviour, walk)}
                )
                if episode == 0 and on_ground:
                    shown = Footfalls(f"seed {seed}: {rows[-1]['gait']}", walk.time, on_ground)
                    first.setdefault(setup.name, []).append(shown)
                report(f"{setup.name}, seed {seed}", 1 / episodes)
    table = table_of(GAITS, {name: [row[name] for row in rows] for name in GAITS.names})
    write_atomic(run.path / "gaits.parquet", table_bytes(table))
    return Survey(first, tuple(absent))


def _row(behaviour: Behaviour, walk: RecordedWalk) -> dict[str, Any]:
    outside = len(walk.phases)
    monitor = Monitor(behaviour)
    monitor.feed_rows(walk.time, walk.trace.values)
    cycles = monitor.report().cycles
    return {
        "gait": gait(walk.trace),
        "dt": walk.dt,
        "length": len(walk.time) - 1,
        "environment": walk.environment_return,
        "fell": walk.fell,
        "share_in_cycle": float((walk.phase[1:] != outside).mean()),
        "follows": float(walk.follows[1:].mean()),
        "cycles": sum(cycles) / float(walk.time[-1]) if cycles else math.nan,
        **measures(walk.trace),
    }
