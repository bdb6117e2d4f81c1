"""stable-baselines3's PPO, SAC and TD3 as trainers. Needs the [sb3] extra."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from math import prod
from typing import TYPE_CHECKING, Any, Literal

from coachable.envs.problem import PlantProblem, Problem
from coachable.experiments.trainers.environment_trainer import EnvironmentTrainer
from coachable.experiments.trainers.trainer import Learner, MakeEnv
from coachable.foundation.data import whole_number
from coachable.foundation.errors import PlanError

if TYPE_CHECKING:
    from coachable.experiments.experiment import Experiment

Algorithm = Literal["sb3-ppo", "sb3-sac", "sb3-td3"]


@dataclass(frozen=True)
class StableBaselines3(EnvironmentTrainer):
    """An algorithm of stable-baselines3 with the settings that differ from its defaults; see `learning.sb3`.

    **Raises:** `PlanError` for settings that make no update.
    """

    algorithm: Algorithm
    settings: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        _ = self.steps_an_update

    @property
    def name(self) -> str:
        """`sb3-ppo`, `sb3-sac` or `sb3-td3`."""
        return self.algorithm

    @property
    def steps_an_update(self) -> int:
        """A rollout of PPO from all of its environments, or `train_freq` steps of the others."""
        defaults = {"n_steps": 2048, "n_envs": 1} if self.algorithm == "sb3-ppo" else {"train_freq": 1}
        return prod(
            whole_number(self.settings.get(name, default), f"sb3.{name}", PlanError, 1, 10**7)
            for name, default in defaults.items()
        )

    def cannot_train(self, problem: Problem) -> str:
        """`released-code` evaluates in the one environment that it trains in."""
        released = isinstance(problem, PlantProblem) and problem.semantics == "released-code"
        if released and self.settings.get("n_envs", 1) != 1:
            return "released-code evaluates in the one environment it trains in: n_envs must be 1"
        return ""

    def to_data(self) -> dict[str, Any]:
        """The table `sb3`."""
        return {"sb3": dict(self.settings)}

    def check(self, experiment: Experiment) -> None:
        """The packages, the settings, and each setup's environment."""
        if any(find_spec(package) is None for package in ("stable_baselines3", "torch")):
            raise PlanError(f"{self.name} needs stable-baselines3: pip install 'coachable[sb3]'")
        from coachable.learning.sb3 import check_settings, process_as_it_was

        check_settings(self.algorithm, self.settings)
        if experiment.problem.in_jax:
            return  # the environment is ours
        with process_as_it_was():
            super().check(experiment)

    def learner(self, make_env: MakeEnv, seed: int) -> Learner:
        """The algorithm on one environment, or on `n_envs` of them."""
        from coachable.learning.sb3 import Learner as SB3Learner

        return SB3Learner(self.algorithm, make_env, self.settings, seed)
