"""PPO on the real task: lanes do not see each other, episodes add up, permutations are permutations."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours.library import load_behaviour
from coachable.envs.walking_task import make_task
from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.rewards.setup import PAPER_SETUPS, RewardSetup

CONFIG = PPOConfig(n_steps=256, batch_size=64, n_epochs=2)
SETUPS = ("sparse", "forward", "orthant", "forward+orthant")


def lanes(names):
    """Stacked tasks and states of one lane a name."""
    tasks = [make_task(PAPER_SETUPS[name]) for name in names]
    keys = [jax.random.key(sum(map(ord, name))) for name in names]
    states = [ppo.init(key, task, CONFIG) for key, task in zip(keys, tasks, strict=True)]
    stack = partial(jax.tree.map, lambda *leaves: jnp.stack(leaves))
    return stack(*tasks), stack(*states)


@pytest.fixture(scope="module")
def update():
    return eqx.filter_jit(ppo.update_lanes)


def lane(tree, index):
    return jax.tree.map(lambda leaf: leaf[index], tree)


def assert_equal(one, other):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        if jax.dtypes.issubdtype(a.dtype, jax.dtypes.prng_key):
            a, b = jax.random.key_data(a), jax.random.key_data(b)
        np.testing.assert_array_equal(a, b)


def test_a_lane_does_not_depend_on_what_runs_beside_it(update):
    tasks, states = lanes(SETUPS)
    mixed_tasks, mixed_states = lanes(("orthant", "orthant", "sparse", "orthant"))
    for _ in range(3):
        states, _, diagnostics = update(tasks, CONFIG, states)
        mixed_states, _, mixed_diagnostics = update(mixed_tasks, CONFIG, mixed_states)
    assert_equal(lane(states, 0), lane(mixed_states, 2))
    assert_equal(lane(states, 2), lane(mixed_states, 0))
    assert_equal(lane(diagnostics, 0), lane(mixed_diagnostics, 2))


def test_many_lanes_at_once_are_each_one_lane_alone(update):
    tasks, states = lanes(SETUPS)
    together, _, _ = update(tasks, CONFIG, states)
    alone, _, _ = eqx.filter_jit(ppo.update)(lane(tasks, 1), CONFIG, lane(states, 1))
    for a, b in zip(jax.tree.leaves(together.networks), jax.tree.leaves(alone.networks), strict=True):
        np.testing.assert_allclose(a[1], b, atol=2e-5)


def test_episodes_add_up_over_rollout_boundaries(update):
    tasks, states = lanes(SETUPS)
    found = []
    for _ in range(6):
        states, episodes, _ = update(tasks, CONFIG, states)
        found.append(episodes)
    ended, length = (
        np.concatenate([getattr(e, name) for e in found], axis=1) for name in ("ended", "length")
    )
    for lane_ended, lane_length in zip(ended, length, strict=True):
        ends = np.flatnonzero(lane_ended)
        assert len(ends) >= 2
        np.testing.assert_array_equal(lane_length[ends], np.diff(np.append(-1, ends)))
    np.testing.assert_array_equal(states.num_updates, 6)


def test_permutations_are_permutations_and_all_differ():
    orders = np.asarray(ppo.random_permutations(jax.random.key(0), 20, 300))
    np.testing.assert_array_equal(np.sort(orders, axis=1), np.tile(np.arange(300), (20, 1)))
    assert len({tuple(order) for order in orders}) == 20


def test_permutations_are_uniform():
    """Every index is as likely in every place: χ² with 16 degrees of freedom, 0.999 quantile 39.3."""
    orders = np.asarray(ppo.random_permutations(jax.random.key(1), 20_000, 5))
    counts = np.stack([np.bincount(column, minlength=5) for column in orders.T])
    assert ((counts - 4000) ** 2 / 4000).sum() < 39.3


def test_the_gradient_norm_is_clipped_globally():
    config = PPOConfig(max_grad_norm=0.5)
    zeros = jnp.zeros(3)
    gradient = jnp.array([30.0, 0.0, 40.0])
    _, adam = ppo.adam_step(zeros, ppo.Adam(zeros, zeros, jnp.zeros(())), gradient, config)
    np.testing.assert_allclose(adam.first_moment, 0.1 * gradient * 0.5 / 50.0, rtol=1e-5)


def test_a_value_network_that_sees_more_leaves_the_policy_as_blind_as_it_was():
    """The policy is a function of what it sees, before and after learning; the value is one of all."""
    form = {"form": "schedule", "skip_fine": 1.0}
    setup = RewardSetup("value-only", orthant=0.1, reward_variant=form, observe="value-only")
    task = make_task(setup, behaviour=load_behaviour("compass-walking-timed"))
    first = ppo.init(jax.random.key(4), task, CONFIG)
    state, _, _ = eqx.filter_jit(ppo.update)(task, CONFIG, first)
    observation = task.observation(state.task_state)
    other = observation.at[4:].add(1.0)
    for networks in (first.networks, state.networks):
        (means, values), (others, other_values) = networks(observation[:, None]), networks(other[:, None])
        np.testing.assert_array_equal(means, others)
        assert not np.allclose(values, other_values, atol=1e-6)
        np.testing.assert_allclose(networks.actor()(observation), means[:, 0], atol=1e-6)
        np.testing.assert_allclose(networks.means(observation[:, None]), means, atol=1e-6)
        assert networks.policy_layers[0][0].shape[1] == 4
    hidden = state.networks.first_weight[: CONFIG.hidden_sizes[0], 4:]
    assert not hidden.any()
    assert not np.allclose(state.networks.first_weight, first.networks.first_weight)
