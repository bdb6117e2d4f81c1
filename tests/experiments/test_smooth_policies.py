"""A plan says how flat and how smooth policies are to be, and what is kept does what was trained."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.experiments import survival
from coachable.experiments.plan import load_plan, parse_plan
from coachable.experiments.trainers import compiled
from coachable.experiments.trainers.lane_batch import LaneBatch
from coachable.plants.compass import CompassWalker

LOW, HIGH = (np.array(torques) for torques in CompassWalker.action_box)


@pytest.fixture(scope="module")
def batch(small_plan, tmp_path_factory):
    """A lane that was trained with tanh for two updates."""
    text = small_plan.read_text(encoding="utf-8")
    assert "[ppo]\n" in text
    text = text.replace("[ppo]\n", '[ppo]\nsquashing = "tanh"\njacobian_penalty = 1e-3\n')
    experiment = parse_plan(text, "small.toml", setups=["sparse"], seeds=1, steps=128, evaluate_every=100)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(survival, "NUM_STARTS", 4)
        tasks = compiled.Tasks.of(experiment)
    programs = compiled.compile_programs(experiment, experiment.trainer.config, tasks, {1}, 1)[1]
    batch = LaneBatch(
        experiment, experiment.lanes, tasks, programs, tmp_path_factory.mktemp("tanh") / "batch.safetensors"
    )
    while not batch.done:
        batch.take_turn()
    return batch


def test_the_policy_that_is_kept_does_what_the_lane_did(batch):
    for key, policy in batch.policies().items():
        assert policy.squashing == "tanh"
        walked = batch.trajectories()[key]
        names = ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
        states = np.stack([getattr(walked, name) for name in names], axis=1)[:-1]
        torques = np.asarray(jax.vmap(policy)(jnp.asarray(states)))
        np.testing.assert_allclose(np.stack([walked.u1, walked.u2], axis=1)[:-1], torques, atol=1e-5)
        assert ((torques > LOW) & (torques < HIGH)).all()


def test_a_plan_says_both_and_keeps_them():
    text = 'name = "mine"\n[ppo]\nsquashing = "tanh"\njacobian_penalty = 1e-3\n'
    experiment = parse_plan(text, "mine.toml")
    config = experiment.trainer.config
    assert (config.squashing, config.jacobian_penalty) == ("tanh", 1e-3)
    assert parse_plan(experiment.to_toml(), "plan.toml") == experiment


def test_a_plan_from_before_they_were_there_is_the_same_study():
    """Run folders of before say nothing of them."""
    text = load_plan("paper").to_toml()
    before = [line for line in text.splitlines() if not line.startswith(("squashing", "jacobian_penalty"))]
    assert len(before) == len(text.splitlines()) - 2
    assert parse_plan("\n".join(before), "plan.toml") == load_plan("paper")
