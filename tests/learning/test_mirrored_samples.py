"""Mirror images of samples that are learned from, too: what they are, and what stays as it is by them."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.envs.symmetry.derived import RobotMirror
from coachable.envs.symmetry.signed_permutation import SignedPermutation
from coachable.learning import ppo
from coachable.learning.config import EnvironmentPPOConfig
from coachable.learning.environment_ppo import Gathered, Learner
from coachable.learning.networks import ActorCritic, initial_networks
from tests.learning.test_environment_ppo import PROBE, SMALL, Noisy, Probe, act, assert_equal

STEPS, ENVS = 12, 4
# With an ε at which Adam does not turn rounding errors into steps of the whole learning rate.
CONFIG = EnvironmentPPOConfig(
    n_steps=STEPS,
    n_envs=ENVS,
    batch_size=16,
    n_epochs=3,
    hidden_sizes=(8, 8),
    learning_rate=1,
    adam_epsilon=1,
)
# Numbers that change places, with a sign and without, that change their sign alone, and that stay.
MIRROR = RobotMirror(
    SignedPermutation((1, 0, 3, 2, 4, 5), (1, 1, -1, -1, -1, 1)), SignedPermutation((1, 0, 2), (-1, -1, -1))
)
OF_NOISY = RobotMirror(SignedPermutation((1, 0, 3, 2), (1, 1, 1, 1)), SignedPermutation((1, 0), (1, 1)))


def matrix(image: SignedPermutation) -> np.ndarray:
    """M with M x = image(x)."""
    return image(np.eye(len(image.sources), dtype=np.float32)).T


@pytest.fixture
def gathered():
    rng = np.random.default_rng(0)

    def random(*shape):
        return rng.normal(size=(STEPS, ENVS, *shape)).astype(np.float32)

    ended = rng.uniform(size=(2, STEPS, ENVS)) < 0.1
    return Gathered(random(6), random(6), random(3), random(3), random(), ended[0], ended[1] & ~ended[0])


def rollout(gathered: Gathered, log_std=(0.0, 0.0, 0.0)) -> ppo.Rollout:
    noise = jnp.moveaxis(jnp.asarray(gathered.noise), -1, 0)
    return ppo.Rollout(
        observations=jnp.asarray(gathered.observations),
        next_observations=jnp.asarray(gathered.next_observations),
        actions=jnp.asarray(gathered.actions),
        log_probabilities=ppo.gaussian_log_probability(noise, jnp.array(log_std)),
        rewards=jnp.asarray(gathered.rewards),
        terminated=jnp.asarray(gathered.terminated),
        truncated=jnp.asarray(gathered.truncated),
    )


def test_the_image_of_an_image_is_the_original(gathered):
    image = gathered.image(MIRROR)
    assert not np.array_equal(image.observations, gathered.observations)
    for ours, theirs in zip(image.image(MIRROR), gathered, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_every_minibatch_is_its_own_mirror_image(gathered):
    seen, done = (ppo.columns(jnp.asarray(rows)) for rows in (gathered.observations, gathered.actions))
    size = STEPS * ENVS
    each = jnp.arange(size, dtype=jnp.float32)
    batch = ppo.with_images(
        ppo.Batch(seen, done, each, jnp.sin(each), jnp.cos(each)), rollout(gathered.image(MIRROR))
    )
    permutations = ppo.random_permutations(jax.random.key(0), CONFIG.n_epochs, size)
    for permutation in ppo.beside_images(permutations, CONFIG):
        pieces = ppo.minibatches(batch, permutation, CONFIG)
        assert pieces.returns.shape == (CONFIG.num_minibatches, 2 * CONFIG.batch_size)
        samples, images = (
            jax.tree.map(lambda leaf, half=half: jnp.split(leaf, 2, axis=-1)[half], pieces) for half in (0, 1)
        )
        np.testing.assert_array_equal(images.observations, matrix(MIRROR.observation) @ samples.observations)
        np.testing.assert_array_equal(images.actions, matrix(MIRROR.action) @ samples.actions)
        for name in ("log_probabilities", "advantages", "returns"):
            np.testing.assert_array_equal(getattr(images, name), getattr(samples, name))
        assert sorted(samples.log_probabilities.ravel().tolist()) == [*range(size)], "each sample once"


def symmetric_networks() -> ActorCritic:
    """μ(P s) = Q μ(s), V(P s) = V(s), and σ as it is in the mirror: units of layers change places in it."""
    networks = initial_networks(jax.random.key(1), 6, 3, CONFIG.hidden_sizes)
    units = matrix(SignedPermutation((4, 5, 6, 7, 0, 1, 2, 3), (1,) * 8))

    def between(inputs, outputs, layer):
        weight, bias = layer
        return (weight + outputs @ weight @ inputs) / 2, (bias + outputs @ bias) / 2

    def layers(given, of_outputs):
        sides = (matrix(MIRROR.observation), units, units, of_outputs)
        return [between(*sides[k : k + 2], layer) for k, layer in enumerate(given)]

    gains = (1, 1, 40)  # the policy's last weights begin near 0
    strong = [
        (k * weight, bias + 0.3) for k, (weight, bias) in zip(gains, networks.policy_layers, strict=True)
    ]
    return ActorCritic.from_layers(
        layers(strong, matrix(MIRROR.action)),
        layers(networks.value_layers, np.eye(1, dtype=np.float32)),
        jnp.array([0.1, 0.1, -0.2]),
    )


def unlike_its_image(networks: ActorCritic) -> float:
    """By how much a policy, its σ and its values differ from what they are in the mirror, at most."""
    seen = jax.random.normal(jax.random.key(2), (6, 50))
    (means, values), (mirrored, same) = networks(seen), networks(matrix(MIRROR.observation) @ seen)
    std = jnp.exp(networks.log_std)
    apart = (mirrored - matrix(MIRROR.action) @ means, same - values, std[:2] - std[1::-1])
    return max(float(jnp.abs(each).max()) for each in apart)


def test_a_symmetric_policy_stays_symmetric_with_images_and_only_then(gathered):
    networks = symmetric_networks()
    assert unlike_its_image(networks) < 1e-5
    means, std = networks.means(ppo.columns(jnp.asarray(gathered.observations))), np.exp(networks.log_std)
    assert means.std() > 0.05
    actions = np.asarray(means).T.reshape(gathered.actions.shape) + std * gathered.noise
    gathered = gathered._replace(actions=actions)
    ours, image = (rollout(each, networks.log_std) for each in (gathered, gathered.image(MIRROR)))
    improve = jax.jit(ppo.improve, static_argnums=0)
    begun = ppo.initial_state(jax.random.key(3), networks, None)
    state, _ = improve(CONFIG, begun, ours, 1.0, image)
    assert unlike_its_image(state.networks) < 1e-5
    alone, _ = improve(CONFIG, begun, ours, 1.0)
    assert unlike_its_image(alone.networks) > 1e-2
    moved = jax.tree.map(lambda new, old: float(jnp.abs(new - old).max()), state.networks, networks)
    assert min(jax.tree.leaves(moved)) > 1e-3, "all of it has learned"


def test_a_side_that_was_never_seen_is_learned_from_the_other():
    flip = SignedPermutation((0,), (-1,))
    learner = Learner(
        lambda: Probe(pays=lambda seen, action: float(np.sign(action)), first=(1.0,)),
        PROBE,
        0,
        RobotMirror(flip, flip),
    )
    learner.learn(40 * PROBE.rollout_size, lambda: None)
    assert act(learner, 1.0) > 0.5
    assert act(learner, -1.0) < -0.5


def test_what_is_done_is_not_mirrored_and_moments_are_those_of_both_sides():
    plain, both = Learner(Noisy, SMALL, 3), Learner(Noisy, SMALL, 3, OF_NOISY)
    for each in (plain, both):
        each.learn(SMALL.rollout_size, lambda: None)
    ours, theirs = plain.arrays(), both.arrays()
    changed = {name for name in ours if not np.array_equal(ours[name], theirs[name])}
    assert {name.partition(".")[0] for name in changed} == {
        "state",
        "observations_mean",
        "observations_var",
        "observations_count",
    }
    mean, var = both._of_observations.mean, both._of_observations.var
    np.testing.assert_allclose(OF_NOISY.observation(mean), mean, rtol=1e-12)
    np.testing.assert_allclose(np.abs(OF_NOISY.observation(var)), var, rtol=1e-12)
    assert np.abs(OF_NOISY.observation(plain._of_observations.mean) - mean).max() > 1e-3


@pytest.mark.parametrize("changes", [{}, {"normalize": False}])
def test_one_that_was_interrupted_goes_on_to_the_bit(changes):
    config, kept = replace(SMALL, **changes), {}
    whole = Learner(Noisy, config, 7, OF_NOISY)

    def keep():
        if whole.num_steps == 2 * config.rollout_size:
            kept.update(whole.arrays())

    whole.learn(4 * config.rollout_size, keep)
    resumed = Learner(Noisy, config, 7, OF_NOISY)
    resumed.restore(kept)
    resumed.learn(4 * config.rollout_size, lambda: None)
    assert_equal(resumed.arrays(), whole.arrays())
