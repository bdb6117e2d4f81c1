"""A policy's ONNX graph computes what the policy computes."""

import json
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.foundation.errors import MissingExtraError
from coachable.learning.onnx_graph import onnx_bytes
from coachable.learning.policy import Policy

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
