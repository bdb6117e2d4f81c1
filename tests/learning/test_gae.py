"""Advantages against their definition as a sum, and against the two limits of λ."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.learning.gae import generalised_advantages

GAMMA = 0.97


def random_rollout(seed, steps=200):
    rng = np.random.default_rng(seed)
    rewards, values, next_values = rng.normal(size=(3, steps))
    terminated = rng.random(steps) < 0.05
    ended = terminated | (rng.random(steps) < 0.05)
    return rewards, values, next_values, terminated, ended


def advantages(rollout, gae_lambda):
    with jax.enable_x64(True):
        return np.asarray(generalised_advantages(*map(jnp.asarray, rollout), GAMMA, gae_lambda))


@pytest.mark.parametrize("gae_lambda", [0.0, 0.5, 0.95, 1.0])
def test_equals_the_discounted_sum_of_td_errors_within_an_episode(gae_lambda):
    rollout = rewards, values, next_values, terminated, ended = random_rollout(seed=0)
    deltas = rewards + GAMMA * np.where(terminated, 0, next_values) - values
    expected = []
    for t in range(len(rewards)):
        stop = next((k for k in range(t, len(rewards)) if ended[k]), len(rewards) - 1)
        expected.append(sum((GAMMA * gae_lambda) ** (k - t) * deltas[k] for k in range(t, stop + 1)))
    np.testing.assert_allclose(advantages(rollout, gae_lambda), expected, rtol=1e-12, atol=1e-12)


def test_lambda_one_is_the_monte_carlo_return_minus_the_value():
    rewards, values, _, _, _ = random_rollout(seed=1, steps=50)
    last = np.arange(50) == 49
    returns = np.array([sum(GAMMA ** (k - t) * rewards[k] for k in range(t, 50)) for t in range(50)])
    next_values = np.append(values[1:], 123.0)
    found = advantages((rewards, values, next_values, last, last), 1.0)
    np.testing.assert_allclose(found, returns - values, rtol=1e-12, atol=1e-12)


def test_a_truncated_step_keeps_the_value_of_where_it_led_and_a_terminated_one_does_not():
    step = tuple(np.array([x]) for x in (1.0, 0.5, 2.0))
    truncated = advantages((*step, np.array([False]), np.array([True])), 0.95)
    terminated = advantages((*step, np.array([True]), np.array([True])), 0.95)
    np.testing.assert_allclose(truncated, 1.0 + GAMMA * 2.0 - 0.5)
    np.testing.assert_allclose(terminated, 1.0 - 0.5)


def test_nothing_flows_back_over_the_end_of_an_episode():
    rewards, values, next_values, terminated, ended = random_rollout(seed=2)
    end = int(np.flatnonzero(ended)[2])
    changed = rewards.copy()
    changed[end + 1 :] += 100.0
    before = advantages((rewards, values, next_values, terminated, ended), 0.95)
    after = advantages((changed, values, next_values, terminated, ended), 0.95)
    np.testing.assert_array_equal(before[: end + 1], after[: end + 1])
    assert not np.allclose(before[end + 1], after[end + 1])
