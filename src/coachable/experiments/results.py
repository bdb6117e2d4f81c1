"""What a study leaves behind: logs, policies and trajectories, gathered from its groups into the folder."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import jax
import numpy as np
from safetensors.numpy import save

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.rollout import Trajectory, rollout, summary
from coachable.envs.walking_task import NO_BOX, make_task
from coachable.experiments.log import Columns
from coachable.experiments.plan import Lane, Study
from coachable.experiments.run_folder.reader import BASELINE, Which
from coachable.experiments.run_folder.schemas import SCHEMAS, table_of
from coachable.experiments.run_folder.writer import RunFolder
from coachable.learning.policy import Policy
from coachable.rewards.setup import TERM_NAMES

LOGS = ("episodes", "evaluations", "survival")


def walk_baseline(study: Study, behaviour: Behaviour) -> tuple[dict[str, Any], Trajectory]:
    """The episode of the plant's baseline controller under a study's rewards and clock, in float64."""
    with jax.enable_x64(True):
        setup = study.setups[0]
        arguments = (setup, study.semantics, study.reward_variant, study.clock, study.plant, behaviour)
        task = make_task(*arguments, box=NO_BOX)
        controller = next(iter(task.plant.controllers().values()))
        episode = jax.jit(lambda: rollout(task, controller))()
        numbers = summary(task, episode)
        terms = np.asarray(numbers.terms)
        return {
            "controller": BASELINE,
            "hip_x": float(numbers.hip_x),
            "foot_x": float(numbers.foot_x),
            "length": int(numbers.length),
            "fell": bool(numbers.fell),
            "share_in_cycle": float(numbers.share_in_cycle),
            "terms": dict(zip(TERM_NAMES, terms.tolist(), strict=True)),
            "returns": {setup.name: float(np.dot(setup.weights, terms)) for setup in study.setups},
        }, Trajectory.of(task, episode)


@runtime_checkable
class Trained(Protocol):
    """Lanes that were trained, or are: what came of them so far."""

    def table(self, name: str) -> Columns:
        """What was logged for `episodes`, `evaluations` or `survival`, lane by lane in order of training."""
        ...

    def policies(self) -> Mapping[tuple[Lane, Which], Policy]:
        """The last policy of every lane, and the best by evaluation return."""
        ...

    def trajectories(self) -> Mapping[tuple[Lane, Which], Trajectory]:
        """The evaluation episode of each of them."""
        ...


def write_logs(folder: RunFolder, groups: Sequence[Trained]) -> None:
    """Write what has been logged so far: episodes, evaluations, survival."""
    for name in LOGS:
        parts = [part for group in groups if (part := group.table(name))]
        columns = {
            c: np.concatenate([part[c] for part in parts]) if parts else [] for c in SCHEMAS[name].names
        }
        folder.write_table(name, table_of(SCHEMAS[name], columns))


def write_policies(folder: RunFolder, groups: Sequence[Trained]) -> None:
    """Write the last and the best policy of every lane."""
    for group in groups:
        for (lane, which), policy in group.policies().items():
            write_policy(folder, lane, which, policy)


def write_policy(folder: RunFolder, lane: Lane, which: Which, policy: Policy) -> None:
    """Write a policy of a lane."""
    stem = f"policies/{lane.name}-{which}"
    tensors = {name: np.asarray(array, order="C") for name, array in policy.tensors().items()}
    folder.write(f"{stem}.safetensors", save(tensors))
    folder.write(f"{stem}.json", json.dumps(policy.description(), indent=2) + "\n")


def write_trajectories(folder: RunFolder, baseline: Trajectory, groups: Sequence[Trained]) -> None:
    """Write the evaluation episode of every lane with its last and its best policy, and the baseline's."""
    rows = [
        _rows(lane.name, which, t) for group in groups for (lane, which), t in group.trajectories().items()
    ]
    rows.append(_rows(BASELINE, "baseline", baseline))
    columns = {name: np.concatenate([row[name] for row in rows]) for name in SCHEMAS["trajectories"].names}
    folder.write_table("trajectories", table_of(SCHEMAS["trajectories"], columns))


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
