"""Our PPO on Gymnasium environments as an experiment: what the folder holds, and going on to the bit."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict

from coachable.experiments.assessment import actor, assessment
from coachable.experiments.experiment import EVALUATION_SEED
from coachable.experiments.plan import parse_plan, trainer_settings
from coachable.experiments.runner import run_experiment
from coachable.experiments.trainers import process_lane
from coachable.experiments.trainers.environment_ppo import EnvironmentPPO
from coachable.experiments.trainers.process_lane import LaneWork, load_lane
from coachable.foundation.errors import PlanError
from coachable.learning.config import EnvironmentPPOConfig
from tests.experiments.swing import SWING

PLAN = """
env = "Pendulum-v1"
behaviour = "swing.behaviour"
steps = 1200
evaluate_every = 600
evaluation_episodes = 2
[signals]
height = 0
speed = 2
[setups.alone]
weight = 0
[setups.both]
weight = 0.5
observe = "memory"
[ppo]
n_steps = 100
n_envs = 3
batch_size = 50
n_epochs = 1
"""

NESTED = "coachable-tests/NestedPendulum-v0"


class Nested(gymnasium.ObservationWrapper):
    """A pendulum that is seen in parts."""

    def __init__(self):
        super().__init__(gymnasium.make("Pendulum-v1").unwrapped)
        parts = {"angle": Box(-1.0, 1.0, (2,)), "moves": Dict({"speed": Box(-8.0, 8.0, (1, 1))})}
        self.observation_space = Dict(parts)

    def observation(self, observation):
        return {"angle": observation[:2], "moves": {"speed": observation[2:, None]}}


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plans")
    (folder / "swing.behaviour").write_text(SWING)
    return parse_plan(PLAN, "swing.toml", folder)


@pytest.fixture(scope="module")
def run(experiment, tmp_path_factory):
    return run_experiment(experiment, tmp_path_factory.mktemp("runs") / "swing", progress=False)


def trained(experiment, path, lane=0, stop_at=None):
    """What a lane's process does, in this one; `stop_at`, steps after which it is killed."""

    class Killed(BaseException):
        pass

    def report(progress):
        if stop_at is not None and progress.steps >= stop_at:
            raise Killed

    work = LaneWork(experiment, experiment.trainer.learner, experiment.lanes[lane], path)
    if stop_at is None:
        work.run(report)
    else:
        with pytest.raises(Killed):
            work.run(report)
    return load_lane(path)


def test_it_is_what_an_environment_is_trained_with(experiment):
    assert isinstance(experiment.trainer, EnvironmentPPO)
    assert experiment.trainer.name == "ppo"
    assert experiment.trainer.config.n_envs == 3
    assert experiment.total_steps == 1200
    assert (
        parse_plan(experiment.to_toml(), "again", described=experiment.behaviour).trainer
        == experiment.trainer
    )


def test_the_folder_holds_what_was_trained(run, experiment):
    assert run.status == "complete"
    assert run.experiment.trainer == experiment.trainer
    columns = run.columns("evaluations")
    assert sorted(set(columns["step"])) == [600, 1200]
    for lane in experiment.lanes:
        policy = run.policy(lane.setup, lane.seed)
        assert policy.scale is not None
        again = assessment(experiment, lane).evaluate(policy)
        mine = (columns["lane"] == lane.name) & (columns["step"] == 1200)
        for name in ("return", "behaviour", "length", "share_in_cycle"):
            np.testing.assert_allclose(columns[name][mine], again[name], rtol=1e-4, err_msg=name)
    assert run.policy("both", 0).weights[0].shape[1] == 3 + 3
    episodes = run.columns("episodes")
    assert [*episodes["end_step"]] == 2 * [598, 599, 600, 1198, 1199, 1200], "200 steps of three pendulums"
    assert np.isfinite(episodes["approx_kl"]).all()


def test_a_lane_that_was_killed_goes_on_to_the_bit(experiment, tmp_path, monkeypatch):
    monkeypatch.setattr(process_lane, "SECONDS_BETWEEN_CHECKPOINTS", 0.0)
    monkeypatch.setattr(process_lane, "MOST_TIME_FOR_SAVING", np.inf)
    whole = trained(experiment, tmp_path / "whole", lane=1)
    trained(experiment, tmp_path / "killed", lane=1, stop_at=900)
    tables, policies = trained(experiment, tmp_path / "killed", lane=1)
    for name, columns in whole[0].items():
        for column, values in columns.items():
            np.testing.assert_array_equal(tables[name][column], values, err_msg=f"{name}: {column}")
    for which, policy in whole[1].items():
        for name, array in policy.tensors().items():
            np.testing.assert_array_equal(policies[which].tensors()[name], array, err_msg=name)


def test_observations_in_parts_are_laid_in_a_row(experiment, tmp_path):
    gymnasium.register(NESTED, Nested, max_episode_steps=200)
    try:
        problem = replace(
            experiment.problem,
            env=NESTED,
            signals={
                "height": {"observation": ["angle", 0]},
                "speed": {"observation": ["moves", "speed", 0, 0]},
            },
        )
        parts = trained(replace(experiment, problem=problem, steps=600), tmp_path / "parts")
    finally:
        del gymnasium.registry[NESTED]
    row = trained(replace(experiment, steps=600), tmp_path / "row")
    for name, array in row[1]["last"].tensors().items():
        np.testing.assert_array_equal(parts[1]["last"].tensors()[name], array, err_msg=name)


def test_a_lane_that_diverges_is_named(experiment, tmp_path):
    wild = replace(experiment, trainer=EnvironmentPPO(replace(experiment.trainer.config, learning_rate=1e30)))
    with pytest.raises(PlanError, match=r"(alone|both)-0: the training diverged after \d+ steps"):
        run_experiment(wild, tmp_path / "wild", progress=False)


@pytest.mark.parametrize("name", ["ppo-mujoco", "ppo-walker2d"])
def test_settings_that_stable_baselines3_takes_are_ours_too(name):
    settings = trainer_settings(name)
    config = EnvironmentPPOConfig(**settings)
    assert {name: getattr(config, name) for name in settings} == settings


MIRRORED = """
env = "Walker2d-v5"
behaviour = "steps.behaviour"
steps = 400
evaluate_every = 400
evaluation_episodes = 1
[setups.seeing]
reward_variant = "schedule"
observe = "memory"
[setups.blind]
reward_variant = "schedule"
[setups.plain]
reward_variant = "schedule"
mirror = false
[ppo]
n_steps = 100
n_envs = 2
batch_size = 50
n_epochs = 1
"""

STEPS = """
behaviour "steps"

signals
  left_foot_x   [m]
  right_foot_x  [m]

mirror left <-> right

phases
  left_ahead for at most 0.1 s: left_foot_x > right_foot_x

cycle
  left_ahead -> right_ahead
"""


def test_a_mirrored_policy_is_evaluated_as_it_was_trained(tmp_path):
    """The bare policy, in the environment that mirrors, does what the mirrored one does in the plain one."""
    pytest.importorskip("mujoco")
    (tmp_path / "steps.behaviour").write_text(STEPS)
    experiment = parse_plan(MIRRORED, "steps.toml", tmp_path)
    for index, setup in enumerate(experiment.setups):
        tables, policies = trained(experiment, tmp_path / setup.name, lane=index)
        policy = policies["last"]
        assert bool(policy.mirror) == (setup.name != "plain")
        env = experiment.problem.training_environment(setup, 400)
        act, total, phases = actor(replace(policy, mirror=""), env), 0.0, set()
        observation, _ = env.reset(seed=EVALUATION_SEED)
        over = False
        while not over:
            phases.add(env.get_wrapper_attr("expected_phase"))
            observation, reward, terminated, truncated, _ = env.step(act(observation))
            total, over = total + float(reward), terminated or truncated
        assert len(phases) > 1
        assert tables["evaluations"]["return"][-1] == pytest.approx(total)
