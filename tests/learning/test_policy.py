"""A policy survives a round trip through its tensors and description; a bad one is refused with a reason."""

import json
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save

from coachable.analysis.table import diverged_lanes
from coachable.envs.squashing import expected_action
from coachable.experiments.plan import load_plan
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.errors import ParameterError, RunFolderError
from coachable.learning.networks import initial_networks
from coachable.learning.policy import Policy

LOW, HIGH = jnp.array([-2.0, -2.0]), jnp.array([0.0, 0.0])


def some_policy(squashing="clip", scale=30.0):
    networks = initial_networks(jax.random.key(1), 4, 2, (16, 8))
    weights, biases = zip(*networks.policy_layers, strict=True)
    weights = (*weights[:-1], scale * weights[-1])
    names = ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
    return Policy(weights, biases, LOW, HIGH, squashing=squashing, observation_names=names)


def test_round_trip_is_the_identity_to_the_bit():
    policy = some_policy()
    description = json.loads(json.dumps(policy.description()))
    again = Policy.of(policy.tensors(), description)
    assert jax.tree.structure(again) == jax.tree.structure(policy)
    for ours, theirs in zip(jax.tree.leaves(again), jax.tree.leaves(policy), strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("squashing", ["clip", "tanh"])
def test_the_torque_is_in_the_box_and_not_constant(squashing):
    states = 3 * jax.random.normal(jax.random.key(0), (200, 4))
    torques = jax.vmap(some_policy(squashing))(states)
    assert ((torques >= LOW[None]) & (torques <= HIGH[None])).all()
    assert torques.std() > 0.1


def test_it_computes_what_the_trained_networks_compute():
    networks = initial_networks(jax.random.key(1), 4, 2, (16, 8))
    weights, biases = zip(*networks.policy_layers, strict=True)
    wide = Policy(weights, biases, jnp.full(2, -1e9), jnp.full(2, 1e9))
    for x in jax.random.normal(jax.random.key(2), (10, 4)):
        np.testing.assert_allclose(wide(x), networks.actor()(x), rtol=1e-5, atol=1e-7)


def test_a_damaged_policy_is_refused_with_what_is_wrong():
    policy = some_policy()
    tensors, description = policy.tensors(), policy.description()
    without = {name: array for name, array in tensors.items() if name != "layer_2.bias"}
    with pytest.raises(RunFolderError, match=r"layer_2\.bias"):
        Policy.of(without, description)
    with pytest.raises(RunFolderError, match=r"\[4, 16, 9, 2\]"):
        Policy.of(tensors, description | {"layers": [4, 16, 9, 2]})
    with pytest.raises(RunFolderError, match="squashing must be one of clip, tanh"):
        Policy.of(tensors, description | {"squashing": "sigmoid"})
    with pytest.raises(RunFolderError, match="not all finite"):
        Policy.of(tensors | {"layer_1.bias": np.full(16, np.nan, np.float32)}, description)


@pytest.mark.parametrize(
    ("layers", "tensors", "said"),
    [
        ([], {}, "layers must be two or more"),
        ([4], {}, "layers must be two or more"),
        ([4, 0, 2], {}, "layers must be two or more"),
        (None, {}, "layers must be two or more"),
        ([4, 10**30], {}, "layers should be"),
        (None, {"low": np.zeros(2, int)}, "layers"),
        ([4, 16, 8, 2], {"low": np.zeros(2, int)}, "low is int64"),
        ([4, 16, 8, 2], {"layer_1.weight": np.zeros((16, 4, 1))}, "layer_1.weight is float64"),
        ([4, 16, 8, 2], {"layer_1.weight": np.zeros((0, 4))}, "layers should be"),
    ],
)
def test_a_foreign_network_is_refused_in_a_sentence(layers, tensors, said):
    policy = some_policy()
    with pytest.raises(RunFolderError, match=said):
        Policy.of(policy.tensors() | tensors, policy.description() | {"layers": layers})


def test_numbers_that_numpy_does_not_have_are_refused_in_a_sentence(tmp_path):
    header = json.dumps({"x": {"dtype": "BF16", "shape": [1], "data_offsets": [0, 2]}}).encode()
    (tmp_path / "policies").mkdir()
    file = tmp_path / "policies" / "sparse-0-last.safetensors"
    file.write_bytes(len(header).to_bytes(8, "little") + header + bytes(2))
    file.with_suffix(".json").write_text("{}")
    run = Run(tmp_path, load_plan("demo", setups=["sparse"], seeds=1), {"files": {}})
    for read in (run.diverged, lambda: run.policy("sparse", 0)):
        with pytest.raises(RunFolderError, match=r"sparse-0-last\.safetensors is damaged"):
            read()


def test_a_lane_whose_weights_are_not_finite_is_named(tmp_path):
    run = Run(tmp_path, load_plan("demo", setups=["sparse"], seeds=2), {"files": {}})
    (tmp_path / "policies").mkdir()
    for seed, weight in enumerate((1.0, math.nan)):
        file = tmp_path / "policies" / f"sparse-{seed}-last.safetensors"
        file.write_bytes(save({"layer_1.weight": np.array([[weight]])}))
    assert [lane.name for lane in run.diverged()] == ["sparse-1"]
    (sentence,) = diverged_lanes(run)
    assert "sparse-1 diverged" in sentence


def exploring(std=(0.6, 0.9), **changes):
    return replace(some_policy(scale=3.0), std=jnp.asarray(std), **changes)


def test_what_it_does_without_exploring_is_a_rule_of_its_own():
    clipped = exploring()
    expected = clipped.acting("expected-action")
    for x in 3 * jax.random.normal(jax.random.key(3), (10, 4)):
        wide = replace(clipped, low=jnp.full(2, -1e9), high=jnp.full(2, 1e9))
        np.testing.assert_allclose(expected(x), expected_action(wide(x), clipped.std, LOW, HIGH), atol=1e-5)
        assert not np.allclose(expected(x), clipped(x), atol=1e-3)
        np.testing.assert_array_equal(expected.acting("clipped-mean")(x), clipped(x))
    again = Policy.of(expected.tensors(), json.loads(json.dumps(expected.description())))
    assert again.deterministic == "expected-action"
    np.testing.assert_array_equal(again.std, expected.std)


def test_a_policy_from_before_there_were_rules_acts_by_its_mean():
    policy = some_policy()
    description = {key: value for key, value in policy.description().items() if key != "deterministic"}
    assert Policy.of(policy.tensors(), description).deterministic == "clipped-mean"


def test_where_the_mean_action_has_no_closed_form_it_says_so():
    for policy, said in (
        (some_policy("tanh"), "squashed by tanh has no closed form"),
        (some_policy(), "lacks the σ"),
    ):
        with pytest.raises(ParameterError, match=said):
            policy.acting("expected-action")
    with pytest.raises(ParameterError, match="did you mean 'expected-action'"):
        exploring().acting("expected-actoin")
    for std in (np.array([0.5, 0.0]), np.array([0.5, -1.0])):
        with pytest.raises(RunFolderError, match="std must be one number above 0"):
            Policy.of(some_policy().tensors() | {"std": std}, some_policy().description())
    with pytest.raises(RunFolderError, match="only with its std"):
        Policy.of(some_policy().tensors(), some_policy().description() | {"deterministic": "expected-action"})
