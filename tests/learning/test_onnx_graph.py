"""A policy's ONNX graph computes what the policy computes."""

import json
from itertools import pairwise

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest

import coachable as co
from coachable.behaviours import load_behaviour
from coachable.foundation.errors import MissingExtraError
from coachable.learning.onnx_graph import onnx_bytes
from coachable.learning.policy import Policy
from coachable.plants.compass import STATE_NAMES
from coachable.rewards.controller_memory import memory_data
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import Schedule
from tests.learning.mirrored_walk import DT, mirrored_walk

onnxruntime = pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'coachable[dev]'")


def some_policy(activation, squashing, scaled, **acting):
    rng = np.random.default_rng(3)
    sizes = [5, 16, 8, 3]
    arrays = [(rng.normal(size=(n, m)), rng.normal(size=n)) for m, n in pairwise(sizes)]
    scaling = {"shift": jnp.asarray(rng.normal(size=5)), "scale": jnp.asarray(rng.uniform(0.1, 1, 5))}
    return Policy(
        tuple(jnp.asarray(weight) for weight, _ in arrays),
        tuple(jnp.asarray(bias) for _, bias in arrays),
        jnp.array([-2.0, -1.0, 0.5]),
        jnp.array([0.0, 1.0, 0.75]),
        **(scaling if scaled else {}),
        activation=activation,
        squashing=squashing,
        observation_names=("a", "b", "c", "d", "e"),
        bound=2.0,
        **acting,
    )


@pytest.mark.parametrize("scaled", [False, True])
@pytest.mark.parametrize("squashing", ["clip", "tanh"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_onnxruntime_gives_the_policys_actions(activation, squashing, scaled):
    policy = some_policy(activation, squashing, scaled)
    session = onnxruntime.InferenceSession(onnx_bytes(policy))
    observations = np.random.default_rng(0).normal(size=(200, 5)).astype(np.float32) * 2
    (actions,) = session.run(None, {"observation": observations})
    np.testing.assert_allclose(actions, jax.vmap(policy)(observations), atol=1e-5)
    assert (np.ptp(actions, axis=0) > 0.1).all()
    described = json.loads(session.get_modelmeta().custom_metadata_map["description"])
    assert described == json.loads(json.dumps(policy.description()))


def test_onnxruntime_gives_the_expected_action():
    policy = some_policy("tanh", "clip", True, std=jnp.array([0.6, 0.9, 0.05]))
    observations = np.random.default_rng(0).normal(size=(200, 5)).astype(np.float32) * 2
    acting = policy.acting("expected-action")
    session = onnxruntime.InferenceSession(onnx_bytes(acting))
    (actions,) = session.run(None, {"observation": observations})
    np.testing.assert_allclose(actions, jax.vmap(acting)(observations), atol=1e-5)
    assert np.abs(actions - jax.vmap(policy)(observations)).max() > 0.1


def test_without_the_package_it_says_which_extra_is_missing(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "onnx", None)
    with pytest.raises(MissingExtraError, match=r"coachable\[onnx\]"):
        onnx_bytes(some_policy("tanh", "clip", False))


@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_a_policy_with_a_memory_takes_it_along(clock, monkeypatch):
    behaviour = load_behaviour("compass-walking-timed")
    reward = DescribedReward(behaviour, Schedule(1.0), 0.01)
    rng, seen = np.random.default_rng(1), len(reward.observation_names)
    policy = Policy(
        (
            jnp.asarray(rng.normal(0, 0.5, (8, 4 + seen)), jnp.float32),
            jnp.asarray(rng.normal(0, 0.5, (2, 8)), jnp.float32),
        ),
        (jnp.zeros(8), jnp.array([-1.35, -0.18])),
        jnp.array([-2.0, -2.0]),
        jnp.array([0.0, 0.0]),
        observation_names=(*STATE_NAMES, *reward.observation_names),
        memory=json.dumps(memory_data(reward)),
    )
    walk = co.rollout(policy, 1.0, clock=clock)
    states = np.stack([walk.states[name] for name in STATE_NAMES], axis=1).astype(np.float32)
    asked = np.stack([walk.controls[name] for name in walk.controls], axis=1)
    session = session_of(policy, monkeypatch)
    assert [end.name for end in session.get_outputs()] == ["action", "memory_after"]
    assert json.loads(session.get_modelmeta().custom_metadata_map["signals"]) == list(STATE_NAMES)
    memory = np.zeros((1, session.get_inputs()[-1].shape[1]), np.float32)
    actions = []
    for row, elapsed in enumerate(np.diff(walk.time, prepend=0.0)[:-1]):
        given = {"observation": states[row, None], "signals": states[row, None], "memory": memory}
        given |= {"elapsed": np.array([elapsed], np.float32), "begins": np.array([row == 0])}
        action, memory = session.run(None, given)
        actions.append(action[0])
    np.testing.assert_allclose(actions, asked[:-1], atol=1e-5)
    assert np.ptp(actions, axis=0).max() > 0.05


def session_of(policy, monkeypatch):
    with monkeypatch.context() as patch:
        # A graph's arrays have sizes with names, which annotations are not checked against.
        patch.setattr(jaxtyping.config, "jaxtyping_disable", True)
        return onnxruntime.InferenceSession(onnx_bytes(policy))


@pytest.mark.parametrize("observe", ["memory", "nothing"])
@pytest.mark.parametrize("form", ["schedule", "stay"])
def test_a_mirrored_policy_is_mirrored_in_its_graph(form, observe, monkeypatch):
    """In a walk, and of many robots at once, each with a phase of its own."""
    pytest.importorskip("mujoco")
    walk = mirrored_walk(form, observe)
    session = session_of(walk.policy, monkeypatch)
    assert [end.name for end in session.get_inputs()] == [
        "observation",
        "signals",
        "elapsed",
        "begins",
        "memory",
    ]
    given = {
        "observation": walk.observations.astype(np.float32),
        "signals": walk.signals.astype(np.float32),
        "elapsed": np.full(len(walk.begins), DT, np.float32),
        "begins": walk.begins,
    }
    memory = np.zeros((1, session.get_inputs()[-1].shape[1]), np.float32)
    actions, memories = [], []
    for row in range(len(walk.begins)):
        memories.append(memory[0])
        now = {name: values[row, None] for name, values in given.items()}
        action, memory = session.run(None, now | {"memory": memory})
        actions.append(action[0])
    np.testing.assert_allclose(actions, walk.actions, atol=1e-5)
    mirrored = np.array(json.loads(walk.policy.mirror)["mirrored_phases"])[walk.phases]
    assert 20 < mirrored.sum() < 600, "both halves must have been met"
    at_once, _ = session.run(None, given | {"memory": np.array(memories)})
    np.testing.assert_allclose(at_once, walk.actions, atol=1e-5)


def test_a_memory_among_the_numbers_of_the_robot_is_put_there(monkeypatch):
    """Where an entry of a flattened `Dict` lies between others."""
    reward = DescribedReward(load_behaviour("compass-walking"), "stay", 0.01)
    rng, seen = np.random.default_rng(2), len(reward.observation_names)
    weight = jnp.asarray(rng.normal(size=(2, 4 + seen)), jnp.float32)
    policy = Policy(
        (weight,),
        (jnp.zeros(2),),
        jnp.full(2, -9.0),
        jnp.full(2, 9.0),
        memory=json.dumps({**memory_data(reward), "place": 1}),
    )
    states = rng.uniform(-0.3, 0.3, (20, 4)).astype(np.float32)
    session = session_of(policy, monkeypatch)
    zeros = np.zeros((20, session.get_inputs()[-1].shape[1]), np.float32)
    given = {"observation": states, "signals": states, "memory": zeros}
    given |= {"elapsed": zeros[:, 0], "begins": np.ones(20, bool)}
    actions, _ = session.run(None, given)
    located = reward.observe(reward.init(states), states)
    assert len({*np.argmax(located, axis=1)}) > 1
    inputs = np.concatenate([states[:, :1], located, states[:, 1:]], axis=1)
    np.testing.assert_allclose(actions, inputs @ np.asarray(weight).T, atol=1e-5)
