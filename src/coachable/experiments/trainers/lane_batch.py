"""A batch of lanes between two turns: their training states, what they have logged, and their checkpoint."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from coachable.automata.cycle_progress import completed_cycles
from coachable.envs.rollout import Trajectory
from coachable.envs.squashing import Deterministic
from coachable.experiments.experiment import Experiment, Lane, Which
from coachable.experiments.layout import evaluation_steps, lane_key
from coachable.experiments.log import Columns, Log
from coachable.experiments.run_folder.checkpoint import load_arrays, save_arrays
from coachable.experiments.run_folder.schemas import DIAGNOSTICS, table_of_rule
from coachable.experiments.trainers.compiled import Programs, Tasks, stacked
from coachable.foundation.errors import RunFolderError
from coachable.foundation.trees import arrays_of, tree_from
from coachable.learning.networks import ActorCritic
from coachable.learning.policy import Policy
from coachable.learning.ppo import Diagnostics, Episodes
from coachable.rewards.setup import TERM_NAMES

SECONDS_BETWEEN_CHECKPOINTS = 30.0


class LaneBatch:
    """Lanes that are trained side by side by one program, a `Job` for `take_turns`.

    A turn is one PPO update with the evaluations due after it, or, when training is over, the survival test
    of one lane. Between turns the batch is consistent, and is saved from time to time.
    """

    def __init__(
        self, experiment: Experiment, lanes: Sequence[Lane], tasks: Tasks, programs: Programs, path: Path
    ):
        self.lanes = tuple(lanes)
        self._latest: Columns = {}
        """The latest evaluation of every lane, by column."""
        self._experiment, self._programs, self._path = experiment, programs, path
        self._training = tasks.stacked(tasks.training, lanes)
        self._evaluation = tasks.stacked(tasks.evaluation, lanes)
        self._location_at_start = int(tasks.evaluation.locate(tasks.evaluation.x0))
        self._due = evaluation_steps(experiment)
        further = experiment.deterministic[1:]
        names = [table_of_rule(table, rule) for rule in further for table in ("evaluations", "survival")]
        self._logs = {name: Log() for name in ("episodes", *names, "evaluations", "survival")}
        self._saved_at = time.monotonic()
        self._consistent = True
        self.num_updates = 0
        self._states = stacked(
            [programs.init(lane_key(lane), tasks.weighted(tasks.training, lane)) for lane in lanes]
        )
        self._best = jax.tree.map(np.asarray, self._states.networks)
        self._best_return = np.full(len(lanes), -np.inf, np.float32)
        if path.exists():
            self._restore()
        else:
            self._evaluate_if_due()

    @property
    def num_steps(self) -> int:
        """Training steps of each lane so far."""
        return self.num_updates * self._experiment.trainer.steps_an_update

    @property
    def num_measured(self) -> int:
        """Lanes whose final walker has been put to the survival test."""
        return self._logs["survival"].num_rows

    @property
    def turns(self) -> int:
        """Updates and survival tests so far."""
        return self.num_updates + self.num_measured

    @property
    def done(self) -> bool:
        """Whether every lane is trained and tested."""
        return self.turns == self._experiment.num_updates + len(self.lanes)

    def latest(self) -> dict[Lane, Columns]:
        """The latest evaluation of each lane, a row; empty before the first."""
        columns = {name: np.asarray(values) for name, values in self._latest.items()}
        return {
            lane: {name: values[index : index + 1] for name, values in columns.items()}
            for index, lane in enumerate(self.lanes)
            if columns
        }

    def take_turn(self) -> None:
        """One update, or one survival test; a checkpoint if the last one is old."""
        self._consistent = False
        if self.num_updates < self._experiment.num_updates:
            self._update()
        else:
            self._test_one_lane()
        self._consistent = True
        if self.done or time.monotonic() - self._saved_at > SECONDS_BETWEEN_CHECKPOINTS:
            self.save()

    def table(self, name: str) -> Columns:
        """What was logged for `episodes`, `evaluations` or `survival`, lane by lane in order of training."""
        columns = self._logs[name].columns()
        if not columns:
            return {}
        order = np.argsort(columns["lane"], kind="stable")
        columns = {column: values[order] for column, values in columns.items()}
        return columns | {"lane": np.array([lane.name for lane in self.lanes])[columns["lane"]]}

    def networks(self) -> Mapping[Which, ActorCritic]:
        """The networks, stacked over lanes: after the `last` update, and at the `best` evaluation return."""
        return {"last": self._states.networks, "best": self._best}

    def policies(self) -> Mapping[tuple[Lane, Which], Policy]:
        """The last policy of every lane, and the best by evaluation return."""
        return {
            (lane, which): self._policy(
                jax.tree.map(lambda leaf, i=index: jnp.asarray(leaf[i]), networks), lane
            )
            for which, networks in self.networks().items()
            for index, lane in enumerate(self.lanes)
        }

    def trajectories(self) -> Mapping[tuple[Lane, Which], Trajectory]:
        """The evaluation episode of every lane with its last and with its best networks."""
        found = {}
        for which, networks in self.networks().items():
            first = self._experiment.deterministic[0]
            _, episodes = self._programs.evaluate[first](self._evaluation, networks)
            for index, lane in enumerate(self.lanes):
                task, episode = jax.tree.map(
                    lambda leaf, index=index: leaf[index], (self._evaluation, episodes)
                )
                found[lane, which] = Trajectory.of(task, episode)
        return found

    def save(self) -> None:
        """Write the checkpoint, unless a turn broke off half-way: then the last one stands."""
        if not self._consistent:
            return
        arrays = (
            arrays_of(self._states, "states")
            | arrays_of(self._best, "best")
            | {"best_return": self._best_return}
        )
        for name, log in self._logs.items():
            arrays |= log.arrays(f"{name}.")
        about = {"lanes": [lane.name for lane in self.lanes], "num_updates": self.num_updates}
        save_arrays(self._path, arrays, about)
        self._saved_at = time.monotonic()

    def _restore(self) -> None:
        arrays, about = load_arrays(self._path)
        if about["lanes"] != [lane.name for lane in self.lanes]:
            raise RunFolderError(
                f"{self._path} holds the lanes {about['lanes']}, not {self.lanes}; remove it"
            )
        try:
            self._states = jax.tree.map(jnp.asarray, tree_from(self._states, arrays, "states"))
            self._best = tree_from(self._best, arrays, "best")
            self._best_return = arrays["best_return"]
        except KeyError as error:
            raise RunFolderError(
                f"{self._path} is of another version of coachable: {error}; remove it"
            ) from None
        self.num_updates = about["num_updates"]
        self._logs = {name: Log.of(arrays, f"{name}.") for name in self._logs}
        self._latest = self._logs["evaluations"].last(len(self.lanes))

    def _update(self) -> None:
        self._states, *logged = self._programs.update(self._training, self._states)
        self._log_episodes(*jax.tree.map(np.asarray, logged))
        self.num_updates += 1
        self._evaluate_if_due()

    def _log_episodes(self, episodes: Episodes, diagnostics: Diagnostics) -> None:
        lane, step = np.nonzero(episodes.ended)
        if len(lane):
            end_step = self.num_steps + step + 1
            columns = {"lane": lane.astype(np.int32), "end_step": end_step}
            columns |= {"return": episodes.episode_return, "length": episodes.length, "fell": episodes.fell}
            columns |= {name: getattr(diagnostics, name)[lane] for name in DIAGNOSTICS}
            self._logs["episodes"].add(
                {name: column if column.ndim == 1 else column[lane, step] for name, column in columns.items()}
            )

    def _evaluate_if_due(self) -> None:
        steps = self._due.get(self.num_updates, ())
        if not steps:
            return
        first, *further = self._experiment.deterministic
        for rule in further:
            self._log_evaluation(table_of_rule("evaluations", rule), self._evaluated(rule), steps)
        self._latest = columns = self._evaluated(first)
        self._log_evaluation("evaluations", columns, steps)
        better = columns["return"] > self._best_return
        self._best_return = np.where(better, columns["return"], self._best_return)
        self._best = jax.tree.map(
            lambda new, old: np.where(better.reshape(-1, *[1] * (old.ndim - 1)), new, old),
            self._states.networks,
            self._best,
        )

    def _log_evaluation(self, table: str, columns: Columns, steps: Sequence[int]) -> None:
        for step in steps:
            self._logs[table].add(columns | {"step": np.full(len(self.lanes), step)})

    def _evaluated(self, rule: Deterministic) -> Columns:
        """An evaluation of every lane, a row each."""
        found, episodes = self._programs.evaluate[rule](self._evaluation, self._states.networks)
        found, phases, alive = jax.device_get((found, episodes.timesteps.phase, episodes.alive))
        cycles = [
            completed_cycles(self._experiment.behaviour, np.append(self._location_at_start, phase[taken]))
            for phase, taken in zip(phases, alive, strict=True)
        ]
        return {
            "lane": np.arange(len(self.lanes), dtype=np.int32),
            "return": found.episode_return,
            "hip_x": found.hip_x,
            "foot_x": found.foot_x,
            "length": found.length,
            "fell": found.fell,
            "share_in_cycle": found.share_in_cycle,
            "cycles": np.array(cycles, np.int32),
            **dict(zip(TERM_NAMES, found.terms.T, strict=True)),
        }

    def _test_one_lane(self) -> None:
        index = self.num_measured
        networks = jax.tree.map(lambda leaf: leaf[index], self._states.networks)
        first, *further = self._experiment.deterministic
        # The first one's table counts the lanes that are done, so it is the last to grow.
        tables: dict[str, Deterministic] = {table_of_rule("survival", rule): rule for rule in further}
        tables["survival"] = first
        for table, rule in tables.items():
            seconds_up, perturbed_up = self._programs.survive[rule](networks)
            self._logs[table].add(
                {
                    "lane": np.array([index], np.int32),
                    "seconds_up": np.asarray(seconds_up)[None],
                    "perturbed_up": np.asarray(perturbed_up)[None],
                }
            )

    def _policy(self, networks: ActorCritic, lane: Lane) -> Policy:
        task, experiment = self._evaluation, self._experiment
        about = experiment.problem.policy_description(experiment.setup(lane.setup))
        # Not read by `Policy.of`, which refuses weights that are not finite: a lane that diverged is kept.
        return Policy(
            weights=tuple(weight for weight, _ in networks.policy_layers),
            biases=tuple(bias for _, bias in networks.policy_layers),
            low=jnp.asarray(task.low[0], jnp.float32),
            high=jnp.asarray(task.high[0], jnp.float32),
            std=jnp.exp(networks.log_std) if task.squashing == "clip" else None,
            squashing=task.squashing,
            deterministic=experiment.deterministic[0],
            observation_names=about["observation_names"],
            clock=about["clock"],
            memory=json.dumps(about["memory"], sort_keys=True) if "memory" in about else "",
        )
