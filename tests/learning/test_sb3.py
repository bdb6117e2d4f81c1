"""Lanes of stable-baselines3: the policy that is kept is the one that acts, a checkpoint holds all of it."""

import dataclasses
import inspect

import gymnasium
import jax
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the [sb3] extra: pip install 'coachable[sb3]'")

from coachable.envs.episode_log import EpisodeLog
from coachable.experiments.run_folder.schemas import DIAGNOSTICS
from coachable.experiments.trainers.process_lane import Episodes
from coachable.experiments.trainers.stable_baselines3 import StableBaselines3
from coachable.foundation.errors import PlanError
from coachable.learning.ppo import Diagnostics
from coachable.learning.sb3 import ALGORITHMS, Learner, check_settings

pytestmark = pytest.mark.sb3

SMALL = {
    "sb3-ppo": {"n_steps": 32, "batch_size": 16, "n_epochs": 2},
    "sb3-sac": {"learning_starts": 20, "batch_size": 16, "policy_kwargs": {"net_arch": [16, 8]}},
    "sb3-td3": {"learning_starts": 20, "batch_size": 16, "noise_std": 0.1},
}


class Aim(gymnasium.Env):
    """One step: the closer the two actions are to what is observed, the better. Actions from −1 to 3."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (3,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 3.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.aim = self.np_random.uniform(0, 2, 2)
        return np.array([*self.aim, 1.0], np.float32), {}

    def step(self, action):
        return np.zeros(3, np.float32), -float(np.square(action - self.aim).sum()), True, False, {}


def learner(trainer, **settings):
    return Learner(trainer, Aim, SMALL[trainer] | settings, seed=1)


@pytest.mark.parametrize(
    ("trainer", "settings"),
    [
        ("sb3-ppo", {}),
        ("sb3-ppo", {"normalize": True}),
        ("sb3-ppo", {"normalize": True, "n_envs": 2}),
        ("sb3-ppo", {"policy_kwargs": {"activation_fn": "relu", "net_arch": [8, 8, 8]}}),
        ("sb3-sac", {}),
        ("sb3-sac", {"normalize": True}),
        ("sb3-td3", {}),
    ],
)
def test_the_policy_is_what_the_model_does_when_it_does_not_explore(trainer, settings):
    lane = learner(trainer, **settings)
    lane.learn(64, lambda: None)
    observations = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32) * 3
    normaliser = lane._model.get_vec_normalize_env()
    seen = observations if normaliser is None else normaliser.normalize_obs(observations)
    theirs, _ = lane._model.predict(seen, deterministic=True)
    ours = jax.vmap(lane.policy())(observations)
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
    assert np.ptp(theirs) > 1e-3


@pytest.mark.parametrize(
    ("trainer", "normalize"), [("sb3-ppo", True), ("sb3-sac", False), ("sb3-td3", False)]
)
def test_a_checkpoint_holds_all_that_is_needed_to_go_on(trainer, normalize):
    lane, again = (learner(trainer, normalize=normalize) for _ in range(2))
    lane.learn(96, lambda: None)
    arrays = lane.arrays()
    again.restore(arrays)
    restored = again.arrays()
    assert restored.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(restored[name], array, err_msg=name)
    again.learn(128, lambda: None)
    assert again.num_steps == 128
    changed = again.arrays()
    moved = [name for name in arrays if name.startswith("policy/") and (changed[name] != arrays[name]).any()]
    assert moved, "it went on learning"


def test_two_learners_with_a_seed_learn_the_same_and_with_another_seed_something_else():
    def weights(seed):
        lane = Learner("sb3-ppo", Aim, SMALL["sb3-ppo"], seed)
        lane.learn(64, lambda: None)
        return np.asarray(lane.policy().weights[0])

    first = weights(3)
    np.testing.assert_array_equal(weights(3), first)
    assert (weights(4) != first).any()


def test_several_environments_are_seeded_apart_from_those_of_every_other_lane():
    def starts(seed):
        lane = Learner("sb3-ppo", Aim, SMALL["sb3-ppo"] | {"n_envs": 3}, seed)
        return {tuple(row) for row in lane._model.env.reset()}

    assert len(starts(0) | starts(1) | starts(2)) == 9


def test_a_step_of_any_of_its_environments_counts():
    lane = Learner("sb3-ppo", Aim, SMALL["sb3-ppo"] | {"n_envs": 3}, seed=0)
    assert lane.steps_an_update == 3 * SMALL["sb3-ppo"]["n_steps"]
    lane.learn(lane.steps_an_update, lambda: None)
    assert lane.num_steps == lane.steps_an_update


def test_it_learns_to_aim():
    lane = Learner("sb3-ppo", Aim, {"n_steps": 512, "learning_rate": 2e-3, "gamma": 0.0}, seed=0)
    aims = np.random.default_rng(1).uniform(0.3, 1.7, (100, 2)).astype(np.float32)
    observations = np.concatenate([aims, np.ones((100, 1), np.float32)], axis=1)

    def error():
        return float(np.abs(np.asarray(jax.vmap(lane.policy())(observations)) - aims).mean())

    before = error()
    lane.learn(8192, lambda: None)
    assert error() < 0.25 < before


def test_it_pauses_between_updates_only():
    lane = learner("sb3-ppo")
    pauses = []
    lane.learn(100, lambda: pauses.append(lane.num_steps))
    assert pauses == [0, 32, 64, 96, 128]


@pytest.mark.parametrize("trainer", [*ALGORITHMS])
def test_we_know_how_often_their_weights_change(trainer):
    signature = inspect.signature(ALGORITHMS[trainer].__init__)
    name = "n_steps" if trainer == "sb3-ppo" else "train_freq"
    assert StableBaselines3(trainer).steps_an_update == signature.parameters[name].default


@pytest.mark.parametrize(
    ("trainer", "settings", "message"),
    [
        ("sb3-ppo", {"learnin_rate": 1e-3}, "learning_rate"),
        ("sb3-ppo", {"noise_std": 0.1}, "no setting 'noise_std'"),
        ("sb3-sac", {"policy_kwargs": {"activation_fn": "tan"}}, "tanh"),
        ("sb3-sac", {"policy_kwargs": {"activation_fn": ["relu"]}}, "relu"),
        ("sb3-ppo", {"policy_kwargs": 3}, "must be a table"),
        ("sb3-ppo", {"n_epochs": 10.0}, "n_epochs must be like 10"),
        ("sb3-ppo", {"gamma": "x"}, "gamma must be like"),
        ("sb3-ppo", {"gamma": float("nan")}, "gamma must be a number"),
        ("sb3-ppo", {"n_epochs": 0}, "n_epochs must be at least 1"),
        ("sb3-sac", {"batch_size": 0}, "batch_size must be at least 1"),
        ("sb3-sac", {"target_update_interval": 0}, "target_update_interval must be at least 1"),
        ("sb3-td3", {"policy_delay": 0}, "policy_delay must be at least 1"),
        ("sb3-ppo", {"normalize": 1}, "normalize must be like False"),
        ("sb3-ppo", {"normalize": {"norm_rewards": False}}, "'norm_reward'"),
        ("sb3-ppo", {"normalize": {"norm_obs": 1}}, "norm_obs must be true or false"),
        ("sb3-ppo", {"learning_rate": "lin_fast"}, "learning_rate after lin_ must be a finite number"),
        ("sb3-ppo", {"learning_rate": "exp_0.1"}, "a number, or lin_ and a number"),
        ("sb3-sac", {"buffer_size": 10**12}, "buffer_size must be at most 100,000,000"),
        ("sb3-sac", {"learning_rate": float("inf")}, "learning_rate must be a finite number"),
        ("sb3-td3", {"noise_std": "a"}, "noise_std must be like"),
        ("sb3-td3", {"noise_std": -0.1}, "noise_std must be from 0 to inf"),
        ("sb3-ppo", {"gamma": 5.0}, "gamma must be from 0 to 1"),
        ("sb3-ppo", {"n_envs": 0}, "n_envs must be at least 1"),
        ("sb3-sac", {"train_freq": 0}, "train_freq must be at least 1"),
        ("sb3-ppo", {"policy": "MlpPolicy"}, "no setting 'policy'; it is MlpPolicy; leave it out"),
        ("sb3-ppo", {"n_timesteps": 1e6}, "write steps in the plan"),
        ("sb3-td3", {"action_noise": "normal"}, "no setting .action_noise."),
        ("sb3-sac", {"use_sde": True}, "no policy file can hold"),
        ("sb3-ppo", {"policy_kwargs": {"squash_output": True}}, "no policy file can hold"),
    ],
)
def test_a_setting_it_does_not_have_or_cannot_keep_is_refused(trainer, settings, message):
    with pytest.raises(PlanError, match=message):
        check_settings(trainer, settings)


def test_evaluations_know_how_often_weights_change():
    lane = learner("sb3-sac", train_freq=8)
    pauses = []
    lane.learn(32, lambda: pauses.append(lane.num_steps))
    assert lane.steps_an_update == 8
    assert pauses == [0, 8, 16, 24, 32]


def learnt(trainer, **settings):
    # A learner seeds random generators that are everybody's.
    lane = learner(trainer, **settings)
    lane.learn(40, lambda: None)
    return lane.arrays()


@pytest.mark.parametrize("trainer", ["sb3-sac", "sb3-td3"])
def test_fused_updates_are_those_of_the_defaults_but_for_rounding(trainer):
    kinds = SMALL[trainer].get("policy_kwargs", {})
    ours, theirs = (
        learnt(trainer, policy_kwargs=kinds | {"optimizer_kwargs": arguments})
        for arguments in ({}, {"fused": False})
    )
    assert ours["n_updates"] == theirs["n_updates"] > 0
    for name in ours:
        if name.startswith("policy/"):
            np.testing.assert_allclose(ours[name], theirs[name], atol=1e-5, err_msg=name)


def test_moments_of_dead_units_become_zero_and_not_subnormal():
    lane, moment = learner("sb3-sac"), "actor.optimizer/0/exp_avg"
    lane.learn(40, lambda: None)
    arrays = lane.arrays()
    # The unit's weights see no gradient any more, and its moment is the least number above zero, which
    # nine tenths of it are rounded to.
    arrays["policy/actor.latent_pi.0.bias"][0] = -1e3
    arrays[moment][0] = np.uint32(1).view(np.float32)
    lane.restore(arrays)
    lane.learn(42, lambda: None)
    bits = lane.arrays()[moment].view(np.uint32)
    assert (bits[0] << 1 == 0).all()
    assert bits[1:].any()
    # Certificates rest on IEEE 754, and may be checked next in this thread.
    assert np.nextafter(0.0, 1.0) * 1.0 != 0.0


def test_a_policy_without_hidden_layers_is_a_line():
    lane = learner("sb3-ppo", policy_kwargs={"net_arch": []})
    assert len(lane.policy().weights) == 1


def test_a_setting_that_makes_no_sense_is_refused():
    with pytest.raises(PlanError, match="sb3-ppo does not take these settings"):
        learner("sb3-ppo", n_steps=1)


def test_spaces_it_cannot_work_with_are_refused():
    with pytest.raises(PlanError, match="actions must be a row of numbers"):
        Learner("sb3-ppo", lambda: gymnasium.make("CartPole-v1"), {}, 0)
    with pytest.raises(PlanError, match="FlattenObservation"):
        Learner("sb3-ppo", lambda: gymnasium.wrappers.ReshapeObservation(Aim(), (3, 1)), {}, 0)


def test_the_diagnostics_are_those_that_the_algorithm_logs():
    found = {}
    for trainer in SMALL:
        lane = learner(trainer)
        assert lane.diagnostics() == {}
        lane.learn(64, lambda: None)
        found[trainer] = lane.diagnostics()
        logged = lane._model.logger.name_to_value
        value, policy = (
            ("value_loss", "policy_gradient_loss") if trainer == "sb3-ppo" else ("critic_loss", "actor_loss")
        )
        assert found[trainer]["value_loss"] == logged[f"train/{value}"] > 0
        assert found[trainer]["policy_loss"] == logged[f"train/{policy}"] != 0
    assert set(found["sb3-ppo"]) == {field.name for field in dataclasses.fields(Diagnostics)}
    assert found["sb3-ppo"]["entropy"] == pytest.approx(np.log(2 * np.pi * np.e), rel=0.05)  # of two N(·, 1)
    assert set(found["sb3-sac"]) == set(found["sb3-td3"]) == {"value_loss", "policy_loss"}


def test_an_episode_is_logged_with_the_update_after_its_rollout():
    episodes = Episodes()
    env = EpisodeLog(Aim(), episodes.ended, lambda info: {})
    lane = Learner("sb3-ppo", lambda: env, SMALL["sb3-ppo"], seed=1)
    updates = []

    def between():
        if episodes.ended.rows:
            updates.append(lane.diagnostics())
            episodes.log_ended(updates[-1])

    lane.learn(3 * 32, between)
    columns = episodes.log.columns()
    assert len(updates) == 3
    assert len({update["value_loss"] for update in updates}) == 3
    for name in DIAGNOSTICS:
        expected = np.repeat([update[name] for update in updates], 32)  # every step ends an episode
        np.testing.assert_array_equal(columns[name], expected, err_msg=name)


def test_the_habits_of_the_zoo_are_understood():
    settings = {
        "learning_rate": "lin_0.0003",
        "clip_range": "lin_0.2",
        "normalize": {"norm_obs": True, "norm_reward": False},
        "n_steps": 8,
        "batch_size": 4,
    }
    check_settings("sb3-ppo", settings)
    learner = Learner("sb3-ppo", lambda: gymnasium.make("Pendulum-v1"), settings, 0)
    model = learner._model
    assert [model.lr_schedule(left) for left in (1.0, 0.5, 0.0)] == [0.0003, 0.00015, 0.0]
    assert model.clip_range(0.5) == 0.1
    assert (model.get_vec_normalize_env().norm_obs, model.get_vec_normalize_env().norm_reward) == (
        True,
        False,
    )
    assert learner._scaling()
    unscaled = Learner(
        "sb3-ppo", lambda: gymnasium.make("Pendulum-v1"), {"normalize": {"norm_obs": False}}, 0
    )
    assert not unscaled._scaling()
