"""Our PPO, which trains tasks in JAX: many lanes side by side in one compiled program."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, groupby, pairwise
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
    from coachable.experiments.experiment import Experiment, Lane


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

    @property
    def compiled(self) -> bool:
        """They are."""
        return True

    def cannot_train(self, problem: Problem) -> str:
        """It needs the physics in JAX."""
        if problem.in_jax:
            return ""
        return f"trainer = 'ppo' trains plants in JAX, not {problem.robot}; take sb3-ppo"

    def to_data(self) -> dict[str, Any]:
        """The table `ppo`."""
        return {"ppo": dataclasses.asdict(self.config)}

    def batch_sizes(self, experiment: Experiment, num_workers: int) -> tuple[int, ...]:
        """As wide as fills the processor's vectors, with a share for every worker.

        Lanes of a batch are trained by one program.
        """
        sizes: list[int] = []
        for _, lanes in _by_program(experiment):
            sizes += batch_sizes(len(lanes), num_workers)
        return tuple(sizes)

    def start(self, work: Work) -> tuple[Sequence[LaneBatch], Callable[[Watch], None]]:
        """Lane batches that take turns on worker threads."""
        experiment, folder = work.experiment, work.folder
        ends = accumulate(folder.batch_sizes, initial=0)
        of_batches = [experiment.lanes[start:end] for start, end in pairwise(ends)]
        keys = [program_of(experiment, lanes[0]) for lanes in of_batches]
        tasks, programs = {}, {}
        for key, lanes in zip(keys, of_batches, strict=True):
            if key not in tasks:
                widths = {len(each) for other, each in zip(keys, of_batches, strict=True) if other == key}
                tasks[key] = Tasks.of(experiment, lanes[0].setup)
                programs[key] = compile_programs(
                    experiment, self.config, tasks[key], widths, work.num_workers
                )
        batches = [
            LaneBatch(experiment, lanes, tasks[key], programs[key][len(lanes)], folder.checkpoint(index))
            for index, (key, lanes) in enumerate(zip(keys, of_batches, strict=True))
        ]
        return batches, lambda watch: take_turns(batches, work.num_workers, watch)


def program_of(experiment: Experiment, lane: Lane) -> str:
    """What the compiled programs of a lane depend on; see `PlantProblem.program_of`."""
    return experiment.require_plant("a compiled task").program_of(experiment.setup(lane.setup))


def _by_program(experiment: Experiment) -> list[tuple[str, list[Lane]]]:
    """Runs of lanes that share a program, in the order of training."""
    runs = groupby(experiment.lanes, key=lambda lane: program_of(experiment, lane))
    return [(key, list(lanes)) for key, lanes in runs]
