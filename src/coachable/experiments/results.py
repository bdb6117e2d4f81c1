"""What an experiment leaves behind: logs, policies and trajectories, gathered from its lanes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import numpy as np
from safetensors.numpy import save

from coachable.envs.problem import PlantProblem
from coachable.envs.rollout import Trajectory, rollout, summary
from coachable.envs.walking_task import NO_BOX
from coachable.experiments.experiment import Experiment
from coachable.experiments.run_folder.schemas import schemas
from coachable.experiments.run_folder.writer import RunFolder
from coachable.experiments.trainers.trainer import TrainedLanes
from coachable.foundation.tables import table_of
from coachable.rewards.setup import TERM_NAMES


def roll_out_baseline(experiment: Experiment) -> tuple[dict[str, Any], Trajectory] | None:
    """The episode of the plant's baseline under the experiment's rewards and clock, in float64.

    `None` for a Gymnasium environment, which has no baseline.
    """
    problem = experiment.problem
    if not isinstance(problem, PlantProblem):
        return None
    with jax.enable_x64(True):
        name, controller = next(iter(problem.plant.under(problem.semantics).controllers().items()))
        walked = {}
        for setup in experiment.reward_setups:
            if (program := problem.program_of(setup)) not in walked:
                # Whatever a policy observes, the baseline is a state feedback.
                task = problem.task(replace(setup, observe="nothing"), box=NO_BOX)
                walked[program] = task, jax.jit(partial(rollout, task, controller))()
        terms = {program: np.asarray(summary(*walk).terms) for program, walk in walked.items()}
        task, episode = next(iter(walked.values()))
        numbers = summary(task, episode)
        return {
            "controller": name,
            "hip_x": float(numbers.hip_x),
            "foot_x": float(numbers.foot_x),
            "length": int(numbers.length),
            "fell": bool(numbers.fell),
            "share_in_cycle": float(numbers.share_in_cycle),
            "terms": dict(zip(TERM_NAMES, np.asarray(numbers.terms).tolist(), strict=True)),
            "returns": {
                setup.name: float(np.dot(setup.weights, terms[problem.program_of(setup)]))
                for setup in experiment.reward_setups
            },
        }, Trajectory.of(task, episode)


def write_logs(folder: RunFolder, experiment: Experiment, lanes: Sequence[TrainedLanes]) -> None:
    """Write what has been logged so far: every table but the trajectories."""
    for name, schema in schemas(experiment).items():
        if name != "trajectories":
            parts = [part for some in lanes if (part := some.table(name))]
            columns = {
                column: np.concatenate([part[column] for part in parts]) if parts else []
                for column in schema.names
                if all(column in part for part in parts)  # a checkpoint may be older than a column
            }
            folder.write_table(name, table_of(schema, columns))


def write_policies(folder: RunFolder, lanes: Sequence[TrainedLanes]) -> None:
    """Write the last and the best policy of every lane."""
    for some in lanes:
        for (lane, which), policy in some.policies().items():
            stem = f"policies/{lane.name}-{which}"
            tensors = {name: np.asarray(array, order="C") for name, array in policy.tensors().items()}
            folder.write(f"{stem}.safetensors", save(tensors))
            folder.write(f"{stem}.json", json.dumps(policy.description(), indent=2) + "\n")


def write_trajectories(folder: RunFolder, experiment: Experiment, lanes: Sequence[TrainedLanes]) -> None:
    """Write the evaluation episode of every lane with its last and its best policy, and the baseline's.

    Nothing is written for a problem without that table.
    """
    schema = schemas(experiment).get("trajectories")
    if schema is None:
        return
    rows = [
        _rows(lane.name, which, trajectory)
        for some in lanes
        for (lane, which), trajectory in some.trajectories().items()
    ]
    if (baseline := roll_out_baseline(experiment)) is not None:
        rows.append(_rows(baseline[0]["controller"], "baseline", baseline[1]))
    columns = {name: np.concatenate([row[name] for row in rows]) for name in schema.names}
    folder.write_table("trajectories", table_of(schema, columns))


def _rows(lane: str, which: str, trajectory: Trajectory) -> dict[str, np.ndarray]:
    length = len(trajectory.time)
    columns = {**trajectory.states, **trajectory.controls, "foot_x": trajectory.foot_x}
    return {
        "lane": np.full(length, lane),
        "which": np.full(length, which),
        "t": trajectory.time.astype(np.float32),
        "phase": trajectory.phase.astype(np.int8),
        **{name: column.astype(np.float32) for name, column in columns.items()},
        **{name: trajectory.terms[name].astype(np.float32) for name in TERM_NAMES},
    }
