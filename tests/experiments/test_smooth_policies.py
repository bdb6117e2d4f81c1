"""A plan says how flat and how smooth policies are to be, and what is kept does what was trained."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours import load_behaviour
from coachable.experiments import programs, survival
from coachable.experiments.lane_batch import Group
from coachable.experiments.plan import load_plan, parse_plan
from coachable.foundation.data import types
from coachable.learning.config import PPOConfig
from coachable.plants.compass import CompassWalker

LOW, HIGH = (np.array(torques) for torques in CompassWalker.action_box)


@pytest.fixture(scope="module")
def group(small_plan, tmp_path_factory):
    """A lane that was trained with tanh for two updates."""
    text = small_plan.read_text(encoding="utf-8")
    assert "[ppo]\n" in text
    text = text.replace("[ppo]\n", '[ppo]\nsquashing = "tanh"\njacobian_penalty = 1e-3\n')
    study = parse_plan(text, "small.toml", setups=["sparse"], seeds=1, steps=128, evaluate_every=100)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(survival, "NUM_STARTS", 4)
        tasks = programs.Tasks.of(study, load_behaviour(study.behaviour))
    compiled = programs.compile_programs(study, tasks, {1}, 1)[1]
    group = Group(study, study.lanes, tasks, compiled, tmp_path_factory.mktemp("tanh") / "group.safetensors")
    while not group.done:
        group.take_turn()
    return group


def test_the_policy_that_is_kept_does_what_the_lane_did(group):
    for key, policy in group.policies().items():
        assert policy.squashing == "tanh"
        walked = group.trajectories()[key]
        names = ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
        states = np.stack([getattr(walked, name) for name in names], axis=1)[:-1]
        torques = np.asarray(jax.vmap(policy)(jnp.asarray(states)))
        np.testing.assert_allclose(np.stack([walked.u1, walked.u2], axis=1)[:-1], torques, atol=1e-5)
        assert ((torques > LOW) & (torques < HIGH)).all()


def test_a_plan_says_both_and_keeps_them():
    text = 'name = "mine"\n[ppo]\nsquashing = "tanh"\njacobian_penalty = 1e-3\n'
    study = parse_plan(text, "mine.toml")
    assert (study.ppo.squashing, study.ppo.jacobian_penalty) == ("tanh", 1e-3)
    assert parse_plan(study.to_toml(), "plan.toml") == study
    assert {"squashing": str, "jacobian_penalty": float}.items() <= types(PPOConfig).items()


def test_a_plan_from_before_they_were_there_is_the_same_study():
    """Run folders of before say nothing of them."""
    text = load_plan("paper").to_toml()
    before = [line for line in text.splitlines() if not line.startswith(("squashing", "jacobian_penalty"))]
    assert len(before) == len(text.splitlines()) - 2
    assert parse_plan("\n".join(before), "plan.toml") == load_plan("paper")
