"""Training a described robot of Gymnasium: by our PPO, by stable-baselines3's, and its simulator alone."""

from __future__ import annotations

from typing import Any

import gymnasium
import mujoco as _mujoco

from coachable.behaviours.text.parser import parse
from coachable.envs.problem import EnvironmentProblem
from coachable.experiments.assessment import assessment
from coachable.experiments.experiment import Experiment, Lane
from coachable.experiments.runner import set_up_jax
from coachable.experiments.trainers.environment_ppo import EnvironmentPPO
from coachable.experiments.trainers.process_lane import EpisodeLog, Episodes
from coachable.experiments.trainers.stable_baselines3 import StableBaselines3
from coachable.experiments.trainers.trainer import Trainer
from coachable.learning.config import EnvironmentPPOConfig
from coachable.rewards.setup import DescribedSetup

mujoco: Any = _mujoco
"""Its bindings say nothing of what is in it."""

SIGNALS = {
    "Walker2d-v5": ("right_foot_contact", {}),
    "Hopper-v5": ("foot_contact", {}),
    "HalfCheetah-v5": ("back_foot_contact", {}),
    "Ant-v5": ("hip_angle", {"hip_angle": 5}),
    "Humanoid-v5": ("right_foot_contact", {}),
}
"""What the description reads of each robot, and where it is found if not in the robot's pack."""

STEPS = """
behaviour "steps"

signals
  {signal}

phases
  down: {signal} > 0.5
  up:   not {signal} > 0.5

cycle
  down -> up -> down
"""


class _Recorded(gymnasium.Wrapper):
    """Keeps what the simulator of an environment was told."""

    def __init__(self, env: gymnasium.Env):
        super().__init__(env)
        self.told: list[Any] = []

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode."""
        found = self.env.reset(seed=seed, options=options)
        self.keep_state()
        return found

    def step(self, action: Any) -> Any:
        """One step."""
        self.told.append(action)
        return self.env.step(action)

    def keep_state(self) -> None:
        """Keep where the simulator is."""
        data = self.simulator.data
        self.told.append((data.qpos.copy(), data.qvel.copy()))

    @property
    def simulator(self) -> Any:
        """The environment with its model and data."""
        return self.unwrapped

    def simulate(self) -> None:
        """Tell the simulator once more, and nobody else."""
        model, skip = self.simulator.model, self.simulator.frame_skip
        data = mujoco.MjData(model)
        for told in self.told:
            if isinstance(told, tuple):
                mujoco.mj_resetData(model, data)
                data.qpos[:], data.qvel[:] = told
                mujoco.mj_forward(model, data)
            else:
                data.ctrl[:] = told
                mujoco.mj_step(model, data, skip)


def prepare(env: str, num_updates: int):
    """So many updates, then the evaluation of an episode; units are training steps.

    Both learners have the same settings. `mj_step` is told what the simulators of ours were told.
    """
    set_up_jax()
    signal, sources = SIGNALS[env]
    problem = EnvironmentProblem(behaviour=parse(STEPS.format(signal=signal)), env=env, signals=sources)
    ours = EnvironmentPPOConfig()
    theirs = {
        name: getattr(ours, name) for name in ("n_steps", "n_envs", "batch_size", "n_epochs", "normalize")
    }
    recorded: list[_Recorded] = []

    def recording(env: gymnasium.Env) -> gymnasium.Env:
        recorded.append(_Recorded(env))
        return recorded[-1]

    our_training = _training(problem, EnvironmentPPO(ours), recording)
    their_training = _training(problem, StableBaselines3("sb3-ppo", theirs), lambda env: env)

    def train() -> None:
        for each in recorded:
            each.told.clear()
            if each.simulator.data.time:
                each.keep_state()
        our_training(num_updates)

    def simulate() -> None:
        for each in recorded:
            each.simulate()

    return {
        "coachable": train,
        "stable-baselines3": lambda: their_training(num_updates),
        "mj_step": simulate,
    }, num_updates * ours.rollout_size


def _training(problem: EnvironmentProblem, trainer: Trainer, around: Any) -> Any:
    """A lane of a trainer of environments, as its process runs it."""
    setup, episodes = DescribedSetup(name="both"), Episodes()
    experiment = Experiment(
        name="bench",
        problem=problem,
        setups=(setup,),
        trainer=trainer,
        described_by="steps",
    )
    measure = assessment(experiment, Lane(setup.name, 0))

    def make() -> gymnasium.Env:
        env = problem.training_environment(setup, experiment.evaluate_every)
        return EpisodeLog(around(env), episodes, measure.sums_of, measure.fell_key)

    assert isinstance(trainer, EnvironmentPPO | StableBaselines3)
    learner = trainer.learner(make, 0)

    def train(num_updates: int) -> None:
        learner.learn(learner.num_steps + num_updates * learner.steps_an_update, lambda: None)
        measure.evaluate(learner.policy())

    return train
