"""Our PPO, which trains tasks in JAX: many lanes side by side in one compiled program."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any

from coachable.envs.problem import Problem
from coachable.envs.squashing import Squashing
from coachable.experiments.layout import batch_sizes
from coachable.experiments.trainers.compiled import Tasks, compile_programs
from coachable.experiments.trainers.lane_batch import LaneBatch
from coachable.experiments.trainers.trainer import Trainer, Watch, Work
from coachable.experiments.trainers.workers import take_turns
from coachable.learning.config import PPOConfig

if TYPE_CHECKING:
    from coachable.experiments.experiment import Experiment


@dataclass(frozen=True)
class PPO(Trainer):
    """Proximal policy optimisation with stable-baselines3's meaning; see `learning.ppo`."""

    config: PPOConfig = field(default_factory=PPOConfig)

    @property
    def name(self) -> str:
        """`ppo`."""
        return "ppo"

    @property
    def steps_an_update(self) -> int:
        """One rollout."""
        return self.config.n_steps

    @property
    def squashing(self) -> Squashing:
        """As configured."""
        return self.config.squashing

    def cannot_train(self, problem: Problem) -> str:
        """It needs the physics in JAX."""
        if problem.in_jax:
            return ""
        return f"trainer = 'ppo' trains plants in JAX, not {problem.robot}; take sb3-ppo"

    def to_data(self) -> dict[str, Any]:
        """The table `ppo`."""
        return {"ppo": dataclasses.asdict(self.config)}

    def batch_sizes(self, experiment: Experiment, num_workers: int) -> tuple[int, ...]:
        """As wide as fills the processor's vectors, with a share for every worker."""
        return batch_sizes(len(experiment.lanes), num_workers)

    def start(self, work: Work) -> tuple[Sequence[LaneBatch], Callable[[Watch], None]]:
        """Lane batches that take turns on worker threads."""
        experiment, folder = work.experiment, work.folder
        tasks = Tasks.of(experiment)
        programs = compile_programs(experiment, self.config, tasks, folder.batch_sizes, work.num_workers)
        ends = accumulate(folder.batch_sizes, initial=0)
        batches = []
        for index, (start, end) in enumerate(pairwise(ends)):
            lanes = experiment.lanes[start:end]
            batches.append(
                LaneBatch(experiment, lanes, tasks, programs[len(lanes)], folder.checkpoint(index))
            )
        return batches, lambda watch: take_turns(batches, work.num_workers, watch)
