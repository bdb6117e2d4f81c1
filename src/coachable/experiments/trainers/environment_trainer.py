"""Trainers of Gymnasium environments: each lane in a process of its own."""

from __future__ import annotations

import abc
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from coachable.envs.problem import EnvironmentProblem, Problem
from coachable.experiments.assessment import LONGEST_EPISODE, most_steps
from coachable.experiments.trainers.lane_processes import run_lanes
from coachable.experiments.trainers.process_lane import LaneWork, ProcessLane
from coachable.experiments.trainers.trainer import Learner, MakeEnv, Trainer, Watch, Work
from coachable.foundation.errors import CoachableError, PlanError
from coachable.rewards.setup import DescribedSetup

if TYPE_CHECKING:
    from coachable.experiments.experiment import Experiment


class EnvironmentTrainer(Trainer):
    """A trainer that learns from Gymnasium environments, and so trains any problem.

    A concrete one gives a `Learner` for one lane; checkpoints, evaluations and resuming are here.
    """

    @abc.abstractmethod
    def learner(self, make_env: MakeEnv, seed: int) -> Learner:
        """A lane before its first step; where it `mirrors_samples`, it may be given `mirror` as well.

        **Raises:** `PlanError` for spaces or settings that the algorithm cannot work with.
        """

    def cannot_train(self, problem: Problem) -> str:
        """Every problem gives a Gymnasium environment."""
        return ""

    def check(self, experiment: Experiment) -> None:
        """Make every setup's environment once, a learner in it, and take a step."""
        for setup in experiment.setups:
            make = partial(experiment.problem.environment, setup)
            env = make()
            try:
                if isinstance(experiment.problem, EnvironmentProblem) and isinstance(setup, DescribedSetup):
                    experiment.problem.mirror(setup)
                learner = self.learner(make, experiment.first_seed)
                learner.policy().acting(experiment.deterministic[0])
                learner.close()
                env.reset(seed=0)
                env.step(env.action_space.sample())
            except CoachableError as error:
                raise PlanError(f"setup {setup.name!r}: {error}") from None
            finally:
                env.close()
        self._say_what_is_not_mirrored(experiment)
        if experiment.setups and most_steps(env) == LONGEST_EPISODE:
            name = experiment.problem.robot
            print(
                f"coachable: {name} has no time limit; an evaluation ends its episodes after "
                f"{LONGEST_EPISODE:,} steps",
                file=sys.stderr,
            )

    def _say_what_is_not_mirrored(self, experiment: Experiment) -> None:
        problem = experiment.problem
        if isinstance(problem, EnvironmentProblem):
            setups = (setup for setup in experiment.setups if isinstance(setup, DescribedSetup))
            for reason in filter(None, dict.fromkeys(map(problem.why_not_mirrored, setups))):
                print(f"coachable: trained without mirroring by phase: {reason}", file=sys.stderr)

    def batch_sizes(self, experiment: Experiment, num_workers: int) -> tuple[int, ...]:
        """Every lane by itself."""
        return (1,) * len(experiment.lanes)

    def start(self, work: Work) -> tuple[Sequence[ProcessLane], Callable[[Watch], None]]:
        """Lanes in processes, as many at once as there are workers."""
        lanes = [
            ProcessLane(
                LaneWork(
                    work.experiment,
                    self.learner,
                    lane,
                    work.folder.checkpoint(index),
                    None if work.track is None else work.track / lane.name,
                )
            )
            for index, lane in enumerate(work.experiment.lanes)
        ]

        def train(watch: Watch) -> None:
            run_lanes(
                [lane.work for lane in lanes],
                work.num_workers,
                lambda index, progress: lanes[index].receive(progress),
                watch,
            )

        return lanes, train
