"""Squashed actions stay in the box, and densities are of actions before that."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from coachable.envs.squashing import SQUASHINGS, expected_action
from coachable.envs.walking_task import make_task
from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.plants.compass import CompassWalker
from coachable.rewards.setup import PAPER_SETUPS

LOW, HIGH = (np.array(torques) for torques in CompassWalker.action_box)
CONFIG = PPOConfig(n_steps=256, batch_size=64, n_epochs=2, squashing="tanh")


@pytest.mark.parametrize("name", sorted(SQUASHINGS))
def test_it_maps_every_action_into_the_box_and_keeps_their_order(name):
    actions = jnp.linspace(-60, 60, 4001)
    low, high = jnp.array(LOW[0]), jnp.array(HIGH[0])
    applied = np.asarray(SQUASHINGS[name](actions, low, high))
    assert ((applied >= LOW[0]) & (applied <= HIGH[0])).all()
    assert (np.diff(applied) >= -1e-6).all()
    assert applied[0] == pytest.approx(LOW[0])
    assert applied[-1] == pytest.approx(HIGH[0])


def test_tanh_is_smooth_and_of_slope_half_the_box_in_its_middle():
    tanh = SQUASHINGS["tanh"]
    slope = jax.vmap(jax.grad(tanh), (0, None, None))(jnp.linspace(-4, 4, 801), -2.0, 0.0)
    assert float(slope.max()) == pytest.approx(1.0)
    assert float(jnp.abs(jnp.diff(slope)).max()) < 0.01  # clip's jumps by 1 at either bound
    assert float(slope.min()) > 0


def test_the_task_applies_the_squashed_action():
    task = make_task(PAPER_SETUPS["orthant"], squashing="tanh")
    actions = 3 * jax.random.normal(jax.random.key(0), (20, 2))
    applied = jax.jit(jax.vmap(lambda action: task.step(task.init(), action)[1].control))(actions)
    np.testing.assert_allclose(applied, -1 + np.tanh(np.asarray(actions)), atol=1e-6)


def test_the_ratio_is_one_before_the_first_step_of_learning():
    """PPO's ratio is of densities before squashing: with the weights that sampled, it is 1 everywhere."""
    task = make_task(PAPER_SETUPS["orthant"], squashing="tanh")
    state = ppo.init(jax.random.key(0), task, CONFIG)
    state, rollout, _ = eqx.filter_jit(ppo.collect)(task, state, CONFIG)
    assert float(jnp.abs(rollout.actions + 1).max()) > 1, "actions are kept as sampled, not as applied"
    means, _ = state.networks(rollout.observations.T)
    standardised = (rollout.actions.T - means) / jnp.exp(state.networks.log_std)[:, None]
    log_probabilities = ppo.gaussian_log_probability(standardised, state.networks.log_std)
    np.testing.assert_allclose(log_probabilities, rollout.log_probabilities, atol=1e-4)


BOXES = ((-2.0, 0.0), (-0.5, 0.5), (3.0, 3.1))


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize(("low", "high"), BOXES)
def test_the_expected_action_is_the_mean_of_what_is_applied(low, high):
    """Against SciPy's quadrature of the clipped action under the normal density."""
    for mean in (-9.0, -2.0, -0.7, 0.1, 3.05, 8.0):
        for std in (0.05, 0.6, 2.0):
            ours = float(expected_action(jnp.array(mean), jnp.array(std), jnp.array(low), jnp.array(high)))
            inside, _ = quad(
                lambda a, m=mean, s=std: a * norm.pdf(a, m, s), low, high, epsabs=1e-13, limit=200
            )
            theirs = low * norm.cdf(low, mean, std) + high * norm.sf(high, mean, std) + inside
            assert ours == pytest.approx(theirs, abs=1e-9)


def test_the_expected_action_is_the_clipped_mean_where_nothing_is_explored():
    means = jnp.linspace(-5, 5, 1001)
    std, low, high = (jnp.full_like(means, number) for number in (1e-6, -2.0, 0.0))
    np.testing.assert_allclose(expected_action(means, std, low, high), jnp.clip(means, -2, 0), atol=1e-5)


def test_the_expected_action_is_smooth_rises_and_stays_in_the_box():
    """Its slope is the chance that the action is not clipped: below 1, and above 0 where that can be told."""
    std, low, high = jnp.array(0.7), jnp.array(-2.0), jnp.array(0.0)
    means = jnp.linspace(-4, 2, 601)
    slopes = jax.vmap(jax.grad(lambda mean: expected_action(mean, std, low, high)))(means)
    assert ((slopes > 0) & (slopes < 1)).all()
    chance = norm.cdf(0, means, 0.7) - norm.cdf(-2, means, 0.7)
    np.testing.assert_allclose(slopes, chance, atol=1e-5)
    assert float(expected_action(jnp.array(-300.0), std, low, high)) == -2.0
    assert float(expected_action(jnp.array(300.0), std, low, high)) == 0.0
