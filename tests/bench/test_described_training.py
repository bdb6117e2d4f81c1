"""What described training is measured with is what ships, and can be made."""

import pytest

pytest.importorskip("mujoco")

from bench.programs.described_training import BEHAVIOURS
from coachable.experiments.plan import load_plan
from coachable.experiments.trainers.environment_ppo import EnvironmentPPO


@pytest.mark.parametrize("env", BEHAVIOURS)
def test_every_robot_can_be_told_so(env):
    experiment = load_plan(None, env=env, behaviour=BEHAVIOURS[env])
    assert isinstance(experiment.trainer, EnvironmentPPO)
    made = experiment.problem.environment(experiment.setups[0])
    observation, _ = made.reset(seed=0)
    assert made.observation_space.contains(observation)
    made.close()
