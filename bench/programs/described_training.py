"""Training a described robot of Gymnasium: by our PPO, by stable-baselines3's, and its simulator alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import jax
import mujoco as _mujoco
import numpy as np

from coachable.envs.episode_log import EndedEpisodes, EpisodeLog
from coachable.envs.side_by_side.copies import Copies
from coachable.experiments.assessment import assessment
from coachable.experiments.experiment import Experiment, Lane
from coachable.experiments.plan import load_plan
from coachable.experiments.runner import set_up_jax
from coachable.experiments.trainers.environment_ppo import EnvironmentPPO
from coachable.experiments.trainers.stable_baselines3 import StableBaselines3

mujoco: Any = _mujoco
"""Its bindings say nothing of what is in it."""

BEHAVIOURS = {
    "Walker2d-v5": "walk",
    "Hopper-v5": "hop",
    "HalfCheetah-v5": "bound",
    "Ant-v5": "trot",
    "Humanoid-v5": "walk",
}
"""What each robot is told; the rest is what `coachable train --env … --behaviour …` has by itself."""


class _Recorded(Copies):
    """Keeps what the simulators of the copies were told."""

    def begin(self, index: int) -> Any:
        """Another episode."""
        found = super().begin(index)
        self.keep_state(index)
        return found

    def step(self, actions: Any) -> Any:
        """One step."""
        found = super().step(actions)
        self.actions.append(actions)
        for told, env in zip(self.told, self.envs, strict=True):
            told.append(_simulator(env).data.ctrl.copy())
        return found

    def forget(self) -> None:
        """Keep nothing but where the simulators are."""
        self.actions: list[Any] = []
        self.told: list[list[Any]] = [[] for _ in self.envs]
        for index in range(len(self.envs)):
            self.keep_state(index)

    def keep_state(self, index: int) -> None:
        """Keep where a simulator is."""
        data = _simulator(self.envs[index]).data
        self.told[index].append((data.qpos.copy(), data.qvel.copy()))

    def simulate(self) -> None:
        """Tell simulators the same, and nobody else."""
        for all_told, env in zip(self.told, self.envs, strict=True):
            model, skip = _simulator(env).model, _simulator(env).frame_skip
            data = mujoco.MjData(model)
            for told in all_told:
                if isinstance(told, tuple):
                    mujoco.mj_resetData(model, data)
                    data.qpos[:], data.qvel[:] = told
                    mujoco.mj_forward(model, data)
                else:
                    data.ctrl[:] = told
                    mujoco.mj_step(model, data, skip)


def _simulator(env: gymnasium.Env) -> Any:
    """The environment with its model and data."""
    return env.unwrapped


def prepare(env: str, num_updates: int):
    """So many updates, then the evaluation of an episode; units are training steps.

    Both learners have the same settings. Without learning, other copies make as many steps by the same
    actions; `mj_step` is told what the simulators of ours were told.
    """
    set_up_jax()
    jax.config.update("jax_cpu_enable_async_dispatch", False)  # as in a lane's process
    ours = load_plan(None, env=env, behaviour=BEHAVIOURS[env])
    assert isinstance(ours.trainer, EnvironmentPPO)
    config = ours.trainer.config
    same = {
        name: getattr(config, name) for name in ("n_steps", "n_envs", "batch_size", "n_epochs", "normalize")
    }
    theirs = replace(ours, trainer=StableBaselines3("sb3-ppo", same))
    our_learner, our_training = _training(ours)
    _, their_training = _training(theirs)
    copies = our_learner._copies
    # The learner makes its copies itself; a wrapper around each would keep them from being stepped by layers.
    copies.__class__ = _Recorded

    others = Copies(_make(ours), [(1, number) for number in range(config.n_envs)])
    for index in range(config.n_envs):
        others.begin(index)

    def train() -> None:
        copies.forget()
        our_training(num_updates)

    def walk() -> None:
        for actions in copies.actions:
            _, _, terminated, truncated = others.step(actions)
            for index in np.flatnonzero(terminated | truncated):
                others.begin(int(index))

    return {
        "coachable": train,
        "without learning": walk,
        "stable-baselines3": lambda: their_training(num_updates),
        "mj_step": copies.simulate,
    }, num_updates * config.rollout_size


def _training(experiment: Experiment) -> tuple[Any, Callable[[int], None]]:
    """A lane of a trainer of environments, as its process runs it: its learner, and what makes updates."""
    measure = assessment(experiment, Lane(experiment.setups[0].name, 0))
    assert isinstance(experiment.trainer, EnvironmentPPO | StableBaselines3)
    learner = experiment.trainer.learner(_make(experiment), 0)

    def train(num_updates: int) -> None:
        learner.learn(learner.num_steps + num_updates * learner.steps_an_update, lambda: None)
        measure.evaluate(learner.policy())

    return learner, train


def _make(experiment: Experiment) -> Callable[[], gymnasium.Env]:
    """What makes an environment of a lane."""
    (setup,), ended = experiment.setups, EndedEpisodes()
    measure = assessment(experiment, Lane(setup.name, 0))

    def make() -> gymnasium.Env:
        env = experiment.problem.training_environment(setup, experiment.evaluate_every)
        return EpisodeLog(env, ended, measure.sums_of, measure.fell_key)

    return make
