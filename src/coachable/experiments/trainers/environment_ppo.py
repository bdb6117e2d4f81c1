"""Our PPO on Gymnasium environments: a lane a process, each with many copies of its environment."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from coachable.envs.squashing import Squashing
from coachable.envs.symmetry.derived import RobotMirror
from coachable.experiments.trainers.environment_trainer import EnvironmentTrainer
from coachable.experiments.trainers.trainer import Learner, MakeEnv
from coachable.learning.config import EnvironmentPPOConfig


@dataclass(frozen=True)
class EnvironmentPPO(EnvironmentTrainer):
    """Proximal policy optimisation as of `PPO`, for environments that are not in JAX."""

    config: EnvironmentPPOConfig = field(default_factory=EnvironmentPPOConfig)

    @property
    def name(self) -> str:
        """`ppo`."""
        return "ppo"

    @property
    def steps_an_update(self) -> int:
        """One rollout of all environments."""
        return self.config.rollout_size

    @property
    def squashing(self) -> Squashing:
        """As configured."""
        return self.config.squashing

    @property
    def mirrors_samples(self) -> bool:
        """It does."""
        return True

    def to_data(self) -> dict[str, Any]:
        """The table `ppo`."""
        return {"ppo": dataclasses.asdict(self.config)}

    def learner(self, make_env: MakeEnv, seed: int, mirror: RobotMirror | None = None) -> Learner:
        """The algorithm on `n_envs` environments; in a `mirror`, on the images of its samples, too."""
        from coachable.learning.environment_ppo import Learner as EnvironmentLearner

        return EnvironmentLearner(make_env, self.config, seed, mirror)
