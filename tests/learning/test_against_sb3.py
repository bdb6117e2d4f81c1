"""Our update is stable-baselines3's: same weights, rollout and permutations in, same weights out."""

import copy

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.learning.gae import generalised_advantages
from coachable.learning.networks import ActorCritic, initial_networks

sb3 = pytest.importorskip("stable_baselines3", reason="needs the [sb3] extra: pip install 'coachable[sb3]'")
torch = pytest.importorskip("torch")
pytestmark = pytest.mark.sb3


class NoisyIntegrator(gymnasium.Env):
    """Four numbers driven by two actions; ends by itself, or is cut off after 40 steps."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = self.np_random.normal(size=4).astype(np.float32)
        self.steps = 0
        return self.state, {}

    def step(self, action):
        push = np.concatenate([action, -action])
        self.state = (0.95 * self.state + 0.3 * push + 0.1 * self.np_random.normal(size=4)).astype(np.float32)
        self.steps += 1
        reward = 1.0 - float(np.square(self.state).sum())
        return self.state, reward, bool(np.abs(self.state[0]) > 2.0), self.steps >= 40, {}


@pytest.fixture(scope="module")
def model():
    """stable-baselines3's PPO after one rollout, before its first update."""
    torch.manual_seed(0)
    model = sb3.PPO("MlpPolicy", NoisyIntegrator(), seed=3, device="cpu")
    _, callback = model._setup_learn(10_000)
    model.collect_rollouts(model.env, callback, model.rollout_buffer, model.n_steps)
    return model


def networks_of(policy) -> ActorCritic:
    def layers(*modules):
        return [(jnp.array(m.weight.detach().numpy()), jnp.array(m.bias.detach().numpy())) for m in modules]

    actor, critic = policy.mlp_extractor.policy_net, policy.mlp_extractor.value_net
    return ActorCritic.from_layers(
        layers(actor[0], actor[2], policy.action_net),
        layers(critic[0], critic[2], policy.value_net),
        jnp.array(policy.log_std.detach().numpy()),
    )


def batch_of(buffer) -> ppo.Batch:
    return ppo.Batch(
        observations=jnp.array(buffer.observations[:, 0].T),
        actions=jnp.array(buffer.actions[:, 0].T),
        log_probabilities=jnp.array(buffer.log_probs[:, 0]),
        advantages=jnp.array(buffer.advantages[:, 0]),
        returns=jnp.array(buffer.returns[:, 0]),
    )


def test_the_defaults_are_theirs(model):
    config = PPOConfig()
    for name in ("learning_rate", "n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "ent_coef"):
        assert getattr(config, name) == getattr(model, name), name
    assert (config.vf_coef, config.max_grad_norm) == (model.vf_coef, model.max_grad_norm)
    assert config.clip_range == model.clip_range(1.0)
    assert config.adam_epsilon == model.policy.optimizer.defaults["eps"]
    assert model.policy.optimizer.defaults["betas"] == ppo.ADAM_DECAYS
    assert config.hidden_sizes == tuple(model.policy.net_arch["pi"])


@pytest.mark.parametrize("changes", [{}, {"ent_coef": 0.01, "clip_range": 0.05, "max_grad_norm": 0.05}])
def test_one_whole_update_ends_with_the_same_weights(model, monkeypatch, changes):
    config = PPOConfig(**changes)
    theirs = copy.deepcopy(model.policy)
    monkeypatch.setattr(model, "policy", theirs)
    monkeypatch.setattr(
        theirs,
        "optimizer",
        torch.optim.Adam(theirs.parameters(), lr=config.learning_rate, eps=config.adam_epsilon),
    )
    monkeypatch.setattr(model, "ent_coef", config.ent_coef)
    monkeypatch.setattr(model, "max_grad_norm", config.max_grad_norm)
    monkeypatch.setattr(model, "clip_range", lambda _: config.clip_range)
    before, buffer = networks_of(theirs), copy.deepcopy(model.rollout_buffer)
    batch = batch_of(buffer)
    monkeypatch.setattr(model, "rollout_buffer", buffer)
    zeros = jnp.zeros_like(jax.flatten_util.ravel_pytree(before)[0])

    np.random.seed(11)
    permutations = np.stack([np.random.permutation(config.n_steps) for _ in range(config.n_epochs)])
    np.random.seed(11)  # the buffer draws the same ones again
    model.train()
    ours, _, diagnostics = jax.jit(ppo.learn, static_argnums=4)(
        before, ppo.Adam(zeros, zeros, jnp.zeros(())), batch, jnp.array(permutations), config
    )

    expected = networks_of(theirs)
    moved = max(
        float(jnp.abs(a - b).max()) for a, b in zip(*map(jax.tree.leaves, (expected, before)), strict=True)
    )
    assert moved > 0.01, "the update must have gone somewhere for agreement to mean anything"
    for name in ("first_weight", "first_bias", "second_weight", "second_bias", "mean_weight", "mean_bias"):
        np.testing.assert_allclose(getattr(ours, name), getattr(expected, name), atol=1e-4, err_msg=name)
    for name in ("value_weight", "value_bias", "log_std"):
        np.testing.assert_allclose(getattr(ours, name), getattr(expected, name), atol=1e-4, err_msg=name)

    logged = model.logger.name_to_value
    assert logged["train/clip_fraction"] > 0.01
    assert logged["train/approx_kl"] > 5e-4
    for name, theirs, tolerance in (
        ("approx_kl", logged["train/approx_kl"], 1e-5),
        ("clip_fraction", logged["train/clip_fraction"], 2e-4),  # a few of 20,480 samples lie on the edge
        ("explained_variance", logged["train/explained_variance"], 1e-5),
        ("value_loss", logged["train/value_loss"], 1e-4 * logged["train/value_loss"]),
        ("policy_loss", logged["train/policy_gradient_loss"], 1e-5),
        ("entropy", -logged["train/entropy_loss"], 1e-5),
        ("std", logged["train/std"], 1e-5),
    ):
        assert float(getattr(diagnostics, name)) == pytest.approx(theirs, abs=tolerance), name


def test_advantages_are_theirs_also_over_truncated_episodes(model):
    buffer = model.rollout_buffer
    rewards, values, starts = buffer.rewards[:, 0], buffer.values[:, 0], buffer.episode_starts[:, 0]
    with torch.no_grad():
        last_value = float(model.policy.predict_values(torch.as_tensor(model._last_obs))[0])
    # Their rewards already hold γ V of a truncated step, so to us every end looks terminal.
    ended = np.append(starts[1:], model._last_episode_starts[0]).astype(bool)
    next_values = np.append(values[1:], last_value).astype(np.float32)
    ours = generalised_advantages(*map(jnp.array, (rewards, values, next_values, ended, ended)), 0.99, 0.95)
    assert ended.sum() > 20
    np.testing.assert_allclose(ours, buffer.advantages[:, 0], atol=2e-4)


def test_the_networks_are_theirs(model):
    networks = networks_of(model.policy)
    observations = np.random.default_rng(0).normal(size=(32, 4)).astype(np.float32)
    with torch.no_grad():
        tensor = torch.as_tensor(observations)
        means = model.policy.get_distribution(tensor).distribution.mean.numpy()
        values = model.policy.predict_values(tensor).numpy()[:, 0]
    our_means, our_values = networks(jnp.array(observations.T))
    np.testing.assert_allclose(our_means.T, means, atol=1e-6)
    np.testing.assert_allclose(our_values, values, atol=1e-5)
    np.testing.assert_allclose(networks.actor()(jnp.array(observations[0])), means[0], atol=1e-6)
    np.testing.assert_allclose(networks.values(jnp.array(observations.T)), values, atol=1e-5)


def test_initial_weights_are_orthogonal_with_their_gains(model):
    ours = initial_networks(jax.random.key(0), 4, 2, (64, 64))
    theirs = networks_of(sb3.PPO("MlpPolicy", NoisyIntegrator(), device="cpu").policy)
    for our_layers, their_layers in (
        (ours.policy_layers, theirs.policy_layers),
        (ours.value_layers, theirs.value_layers),
    ):
        for (our_weight, our_bias), (their_weight, their_bias) in zip(our_layers, their_layers, strict=True):
            singular = [np.linalg.svd(np.asarray(w), compute_uv=False) for w in (our_weight, their_weight)]
            np.testing.assert_allclose(*singular, rtol=1e-5)
            np.testing.assert_array_equal(our_bias, their_bias)
    np.testing.assert_array_equal(ours.log_std, theirs.log_std)
