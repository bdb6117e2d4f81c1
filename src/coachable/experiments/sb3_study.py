"""A study of the compass walker trained by stable-baselines3: the same run folder, for confirmation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.gymnasium_env import PlantEnv
from coachable.envs.rollout import Summary, Trajectory, rollout, summary
from coachable.experiments.compiled import Tasks
from coachable.experiments.lane_processes import News, Tell, run_lanes
from coachable.experiments.layout import evaluation_steps, num_cores
from coachable.experiments.log import Columns
from coachable.experiments.plan import Lane, Study
from coachable.experiments.run_folder.reader import Which
from coachable.experiments.sb3_lane import EpisodeLog, Episodes, finished, load_lane, train_lane
from coachable.experiments.survival import share_up, time_up
from coachable.learning.policy import Policy
from coachable.plants.compass import STATE_NAMES
from coachable.rewards.setup import TERM_NAMES


@dataclass(frozen=True, eq=False)
class CompassLane:
    """One lane, to be trained in a process of its own."""

    study: Study
    behaviour: Behaviour
    lane: Lane
    path: Path
    """Its checkpoint, and in the end all that came of it."""

    @property
    def name(self) -> str:
        """`setup-seed`."""
        return self.lane.name

    def finished(self) -> News | None:
        """What there was to tell last, if the lane was trained to its end."""
        return finished(self.path)

    def run(self, tell: Tell) -> None:
        """Train, evaluate and test the lane."""
        from coachable.learning.sb3 import Learner

        study = self.study
        setup = next(setup for setup in study.setups if setup.name == self.lane.setup)
        jax.config.update("jax_cpu_enable_async_dispatch", False)
        episodes = Episodes()

        def make_env() -> EpisodeLog:
            env = PlantEnv(
                setup,
                study.semantics,
                study.reward_variant,
                study.clock,
                study.plant,
                self.behaviour,
                shared_evaluation_every=study.evaluate_every if study.semantics == "released-code" else 0,
            )
            return EpisodeLog(env, episodes, lambda info: {}, fell_key="fell")

        tasks = Tasks.of(study, self.behaviour)
        evaluation = tasks.weighted(tasks.evaluation, self.lane)
        learner = Learner(study.trainer, make_env, study.sb3, self.lane.seed)
        walk = eqx.filter_jit(lambda policy: summary(evaluation, rollout(evaluation, policy)))
        survive = eqx.filter_jit(
            lambda policy: (
                time_up(tasks.long, policy, tasks.long.x0)[0],
                share_up(tasks.perturbed, policy, jnp.asarray(tasks.starts)),
            )
        )

        def evaluate(policy: Policy) -> Columns:
            return _row(jax.device_get(walk(policy)))

        def finish(policy: Policy) -> Mapping[str, Columns]:
            seconds_up, perturbed_up = survive(policy)
            columns = {
                "seconds_up": np.asarray(seconds_up)[None],
                "perturbed_up": np.asarray(perturbed_up)[None],
            }
            return {"survival": columns}

        due = evaluation_steps(study)
        train_lane(learner, episodes, evaluate, due, study.total_steps, self.path, tell, finish)


class SB3Lane:
    """A lane as the study that trains it sees it: how far it is, and what came of it so far."""

    def __init__(self, work: CompassLane):
        self.work = work
        self.lanes = (work.lane,)
        self.latest: Columns = {}
        """Its latest evaluation, by column."""
        self.num_steps = 0
        self.num_measured = 0
        self._loaded: tuple[float, dict[str, Columns], dict[Which, Policy]] | None = None

    def hear(self, news: News) -> None:
        """Take note of how far the lane is."""
        self.num_steps, self.latest, self.num_measured = news.steps, news.latest, int(news.done)

    def save(self) -> None:
        """Nothing is to be done: the lane's own process has saved."""

    def table(self, name: str) -> Columns:
        """What was logged for `episodes`, `evaluations` or `survival`, as of the last checkpoint."""
        columns = self._load()[0].get(name, {}) if self.work.path.exists() else {}
        if not columns:
            return {}
        return columns | {"lane": np.full(len(next(iter(columns.values()))), self.work.name)}

    def policies(self) -> Mapping[tuple[Lane, Which], Policy]:
        """The last policy and the best."""
        about = {"observation_names": STATE_NAMES, "clock": self.work.study.clock}
        return {
            (self.work.lane, which): Policy.of(policy.tensors(), policy.description() | about)
            for which, policy in self._load()[1].items()
        }

    def trajectories(self) -> Mapping[tuple[Lane, Which], Trajectory]:
        """The evaluation episode of each of them."""
        tasks = Tasks.of(self.work.study, self.work.behaviour)
        task = tasks.weighted(tasks.evaluation, self.work.lane)
        walk = eqx.filter_jit(lambda policy: rollout(task, policy))
        return {key: Trajectory.of(task, walk(policy)) for key, policy in self.policies().items()}

    def _load(self) -> tuple[dict[str, Columns], dict[Which, Policy]]:
        # Once for each checkpoint, for a replay buffer is long to read.
        written = self.work.path.stat().st_mtime
        if self._loaded is None or self._loaded[0] != written:
            self._loaded = (written, *load_lane(self.work.path))
        return self._loaded[1:]


def train_with_sb3(lanes: Sequence[SB3Lane], watch: Callable[[], None]) -> None:
    """Train every lane, as many at once as there are cores, and call `watch` in between."""
    run_lanes([lane.work for lane in lanes], num_cores(), lambda index, news: lanes[index].hear(news), watch)


def _row(walk: Summary) -> Columns:
    numbers = {
        "return": walk.episode_return,
        "hip_x": walk.hip_x,
        "foot_x": walk.foot_x,
        "length": walk.length,
        "fell": walk.fell,
        "share_in_cycle": walk.share_in_cycle,
        **dict(zip(TERM_NAMES, walk.terms, strict=True)),
    }
    return {name: np.asarray(number)[None] for name, number in numbers.items()}
