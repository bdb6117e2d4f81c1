"""The diagnostics of an update: restated in NumPy, by their laws, and without a trace in what is trained."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.learning.networks import initial_networks

CONFIG = PPOConfig(n_steps=96, batch_size=32, n_epochs=2, learning_rate=0.03, hidden_sizes=(8, 8))


@pytest.fixture(scope="module")
def case():
    """Networks, Adam, a rollout of their own actions, and permutations."""
    networks = initial_networks(jax.random.key(0), 4, 2, CONFIG.hidden_sizes)
    networks = eqx.tree_at(lambda n: n.log_std, networks, jnp.array([-0.3, 0.2]))
    keys = jax.random.split(jax.random.key(1), 4)
    observations, noise = jax.random.normal(keys[0], (4, 96)), jax.random.normal(keys[1], (2, 96))
    means, values = networks(observations)
    advantages = jax.random.normal(keys[2], (96,)) + noise[0]
    batch = ppo.Batch(
        observations=observations,
        actions=means + jnp.exp(networks.log_std)[:, None] * noise,
        log_probabilities=ppo.gaussian_log_probability(noise, networks.log_std),
        advantages=advantages,
        returns=advantages + values,
    )
    zeros = jnp.zeros_like(jax.flatten_util.ravel_pytree(networks)[0])
    permutations = ppo.random_permutations(keys[3], CONFIG.n_epochs, CONFIG.n_steps)
    return networks, ppo.Adam(zeros, zeros, jnp.zeros(())), batch, permutations


def learn(case, config=CONFIG):
    return jax.jit(ppo.learn, static_argnums=4)(*case, config)


def double(array):
    return np.asarray(array, np.float64)


def forward(layers, columns):
    *hidden, (weight, bias) = [(double(weight), double(bias)) for weight, bias in layers]
    for hidden_weight, hidden_bias in hidden:
        columns = np.tanh(hidden_weight @ columns + hidden_bias[:, None])
    return weight @ columns + bias[:, None]


def of_minibatch(networks, batch, order, config):
    """The definitions, in float64, on the samples of one minibatch."""
    observations, actions = double(batch.observations)[:, order], double(batch.actions)[:, order]
    advantages, returns = double(batch.advantages)[order], double(batch.returns)[order]
    advantages = (advantages - advantages.mean()) / (advantages.std(ddof=1) + 1e-8)
    sigma = np.exp(double(networks.log_std))[:, None]
    z = (actions - forward(networks.policy_layers, observations)) / sigma
    densities = np.exp(-0.5 * z**2) / (sigma * np.sqrt(2 * np.pi))
    ratios = densities.prod(axis=0) / np.exp(double(batch.log_probabilities)[order])
    outside = (ratios < 1 - config.clip_range) | (ratios > 1 + config.clip_range)
    worse = np.where(advantages > 0, ratios > 1 + config.clip_range, ratios < 1 - config.clip_range)
    kept = np.where(advantages > 0, 1 + config.clip_range, 1 - config.clip_range)
    return {
        "approx_kl": np.mean(ratios - 1 - np.log(ratios)),
        "clip_fraction": np.mean(outside),
        "value_loss": np.mean((returns - forward(networks.value_layers, observations)[0]) ** 2),
        "policy_loss": -np.mean(np.where(worse, kept, ratios) * advantages),
        "entropy": np.sum(np.log(sigma * np.sqrt(2 * np.pi * np.e))),
    }


def test_they_are_their_definitions_in_numpy(case):
    networks, adam, batch, permutations = case
    parameters, unravel = jax.flatten_util.ravel_pytree(networks)
    rows = []
    for permutation in permutations:
        cut = ppo.minibatches(batch, permutation, CONFIG)
        for number, order in enumerate(np.asarray(permutation).reshape(-1, CONFIG.batch_size)):
            rows.append(of_minibatch(unravel(parameters), batch, order, CONFIG))
            samples = jax.tree.map(lambda leaf, number=number: leaf[number], cut)
            gradient, _ = jax.grad(ppo.loss, has_aux=True)(unravel(parameters), samples, CONFIG)
            flat = jax.flatten_util.ravel_pytree(gradient)[0]
            parameters, adam = ppo.adam_step(parameters, adam, flat, CONFIG)
    expected = {name: np.mean([row[name] for row in rows]) for name in rows[0]}
    expected["approx_kl"] = np.mean([row["approx_kl"] for row in rows[-CONFIG.num_minibatches :]])
    values = forward(networks.value_layers, double(batch.observations))[0]
    returns = double(batch.returns)
    expected["explained_variance"] = 1 - np.var(returns - values) / np.var(returns)
    expected["std"] = np.exp(double(unravel(parameters).log_std)).mean()

    _, _, found = learn(case)
    assert expected["clip_fraction"] > 0.1
    assert expected["approx_kl"] > 0.01
    assert set(expected) == set(vars(found))
    for name, value in expected.items():
        assert float(getattr(found, name)) == pytest.approx(value, rel=2e-4, abs=2e-6), name


def test_what_is_trained_has_the_same_bits_with_and_without_them(case):
    """Where nothing reads them, the compiler leaves them out: that is training without diagnostics."""
    for config in (CONFIG, PPOConfig(n_steps=96, batch_size=32, n_epochs=2, jacobian_penalty=0.1)):
        networks = initial_networks(jax.random.key(2), 4, 2, config.hidden_sizes)
        zeros = jnp.zeros_like(jax.flatten_util.ravel_pytree(networks)[0])
        arguments = (networks, ppo.Adam(zeros, zeros, jnp.zeros(())), *case[2:])
        with_them = jax.jit(lambda *a, c=config: ppo.learn(*a, c))(*arguments)[:2]
        without = jax.jit(lambda *a, c=config: ppo.learn(*a, c)[:2])(*arguments)
        for one, other in zip(jax.tree.leaves(with_them), jax.tree.leaves(without), strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_policy_that_does_not_move_has_diverged_nowhere(case):
    _, _, found = learn(case, PPOConfig(**vars(CONFIG) | {"learning_rate": 1e-12}))
    assert float(found.approx_kl) == pytest.approx(0, abs=1e-6)
    assert float(found.clip_fraction) == 0
    assert float(found.policy_loss) == pytest.approx(0, abs=1e-5)  # the mean of normalised advantages
    assert float(found.std) == pytest.approx((np.exp(-0.3) + np.exp(0.2)) / 2, rel=1e-6)


def test_explained_variance_of_perfect_constant_and_degenerate_predictions(case):
    batch = case[2]
    perfect = eqx.tree_at(lambda b: b.advantages, batch, jnp.zeros(96))
    constant = eqx.tree_at(lambda b: b.advantages, batch, batch.returns - 3.0)
    same_returns = eqx.tree_at(lambda b: b.returns, batch, jnp.ones(96))
    assert float(ppo.explained_variance(perfect)) == 1
    assert float(ppo.explained_variance(constant)) == pytest.approx(0, abs=1e-5)
    assert np.isnan(float(ppo.explained_variance(same_returns)))
