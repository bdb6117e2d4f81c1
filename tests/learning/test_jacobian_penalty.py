"""The penalty is the mean squared slope of the policy: by closed form, by differences, and in training."""

from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.envs.walking_task import make_task
from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.learning.networks import ActorCritic, initial_networks
from coachable.rewards.setup import PAPER_SETUPS

CONFIG = PPOConfig(n_steps=256, batch_size=64, n_epochs=4, learning_rate=1e-3)


def some_networks(key=1):
    networks = initial_networks(jax.random.key(key), 4, 2, (16, 8))
    return eqx.tree_at(lambda n: n.mean_weight, networks, 50 * networks.mean_weight)


def some_batch(size=64):
    shapes = ((4, size), (2, size), (size,), (size,), (size,))
    return ppo.Batch(*(jax.random.normal(jax.random.key(i), shape) for i, shape in enumerate(shapes)))


def mean_squared_slope(networks: ActorCritic, observations) -> float:
    """By JAX's forward mode, one state at a time, with the network that acts in training."""
    jacobians = jax.vmap(jax.jacfwd(networks.actor()))(observations.T)
    return float(jnp.square(jacobians).sum(axis=(1, 2)).mean())


def test_it_is_the_mean_squared_frobenius_norm_of_the_jacobian():
    networks, observations = some_networks(), some_batch().observations
    found = ppo.squared_slope(networks, observations)
    assert found.shape == (64,)
    assert float(found.mean()) == pytest.approx(mean_squared_slope(networks, observations), rel=1e-5)


def test_where_tanh_is_straight_it_is_the_norm_of_the_product_of_the_weights():
    networks = some_networks()
    weights = [np.asarray(weight, np.float64) for weight, _ in networks.policy_layers]
    product = weights[2] @ weights[1] @ weights[0]
    at_zero = ppo.squared_slope(networks, jnp.zeros((4, 3)))  # where all biases are 0, so is every layer
    np.testing.assert_allclose(at_zero, np.square(product).sum(), rtol=1e-5)


def test_its_gradient_agrees_with_differences_of_the_loss():
    with jax.enable_x64(True):
        networks = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), some_networks())
        batch = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), some_batch(16))
        config = PPOConfig(jacobian_penalty=0.3)
        flat, unravel = jax.flatten_util.ravel_pytree(networks)

        @jax.jit
        def penalty(flat):
            whole, without = (ppo.loss(unravel(flat), batch, c)[0] for c in (config, PPOConfig()))
            return whole - without

        gradient = jax.jit(jax.grad(penalty))(flat)
        for number in range(5):
            direction = jax.random.normal(jax.random.key(number), flat.shape, jnp.float64)
            difference = (penalty(flat + 1e-5 * direction) - penalty(flat - 1e-5 * direction)) / 2e-5
            assert float(gradient @ direction) == pytest.approx(float(difference), rel=1e-6)


def test_a_weight_of_nothing_is_the_same_program():
    """Not one operation more: so published studies keep every bit."""

    def program(config):
        function = jax.jit(
            lambda networks, batch: jax.grad(ppo.loss, has_aux=True)(networks, batch, config)[0]
        )
        return function.lower(some_networks(), some_batch()).as_text()

    assert program(PPOConfig(jacobian_penalty=0.0)) == program(PPOConfig())
    assert len(program(PPOConfig(jacobian_penalty=1e-6))) > len(program(PPOConfig()))


def test_the_value_network_does_not_feel_it():
    networks, batch = some_networks(), some_batch()
    with_it, without = (
        jax.grad(ppo.loss, has_aux=True)(networks, batch, PPOConfig(jacobian_penalty=weight))[0]
        for weight in (1.0, 0.0)
    )
    np.testing.assert_array_equal(with_it.value_weight, without.value_weight)
    np.testing.assert_array_equal(with_it.second_weight[1], without.second_weight[1])
    np.testing.assert_array_equal(with_it.log_std, without.log_std)
    assert float(jnp.abs(with_it.second_weight[0] - without.second_weight[0]).max()) > 1e-3


def test_the_more_it_weighs_the_flatter_the_trained_policy():
    """Training on the real task, from the same start: the slope where the walker then goes."""
    task = make_task(PAPER_SETUPS["orthant"])
    collect = jax.jit(lambda state: ppo.collect(task, state, CONFIG))  # in which the penalty has no part
    slopes = []
    for weight in (0.0, 0.01, 1.0):
        config = replace(CONFIG, jacobian_penalty=weight)
        improve = jax.jit(partial(ppo.improve, config))
        state, rollout, _ = collect(ppo.init(jax.random.key(0), task, config))
        for _ in range(8):
            state, rollout, _ = collect(improve(state, rollout)[0])
        slopes.append(mean_squared_slope(state.networks, rollout.observations.T))
    assert slopes[0] > 1.2 * slopes[1] > 1.5 * slopes[2]
