"""Five tiny tasks whose answers are known. PPO solves them before it is let near a gait.

Each isolates one thing that may be broken: the value loss, its dependence on the observation, discounting,
the policy's gradient, and the coupling of the two. Source: Andy Jones, "Debugging RL, Without the Agonizing
Pain" (2021).
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float, Int, PRNGKeyArray

from coachable.envs.walking_task import Task
from coachable.learning import ppo
from coachable.learning.config import PPOConfig

CONFIG = PPOConfig(n_steps=256, batch_size=64, learning_rate=3e-3, hidden_sizes=(16, 16))


class ProbeState(eqx.Module):
    observation: Float[Array, " 1"]
    step: Int[Array, ""]


class ProbeOutcome(eqx.Module):
    """The fields of a timestep that learning reads."""

    observation: Array
    reward: Array
    terminated: Array
    truncated: Array
    fell: Array


class Probe(Task):
    """Episodes of `length` steps whose observation is drawn afresh; what a step pays is the subclass's."""

    length: int = eqx.field(static=True, default=1)
    cut_off: bool = eqx.field(static=True, default=False)
    observation_size = 1
    action_size = 1

    def draw(self, key: PRNGKeyArray) -> Float[Array, " 1"]:
        return jnp.zeros(1)

    def pays(self, state: ProbeState, action: Array) -> Array:
        return jnp.ones(())

    def init(self, key):
        return ProbeState(self.draw(key), jnp.zeros((), jnp.int32))

    def reset(self, state, key):
        return self.init(key)

    def observation(self, state):
        return state.observation

    def step(self, state, action):
        after = ProbeState(self.following(state), state.step + 1)
        over, no = after.step >= self.length, jnp.zeros((), bool)
        ended = (no, over) if self.cut_off else (over, no)
        return after, ProbeOutcome(after.observation, self.pays(state, action), *ended, no)

    def following(self, state: ProbeState) -> Float[Array, " 1"]:
        return state.observation


class RandomSign(Probe):
    """The observation is −1 or +1; it is what the step pays."""

    def draw(self, key):
        return jax.random.rademacher(key, (1,), jnp.float32)

    def pays(self, state, action):
        return state.observation[0]


class ZeroThenOne(Probe):
    """The observation is 0, then 1; only the second step pays."""

    length: int = eqx.field(static=True, default=2)

    def pays(self, state, action):
        return state.observation[0]

    def following(self, state):
        return jnp.ones(1)


class PositiveAction(Probe):
    """Pays +1 for a positive action, −1 otherwise."""

    def pays(self, state, action):
        return jnp.where(action[0] > 0, 1.0, -1.0)


class MatchSign(RandomSign):
    """Pays +1 for an action of the observation's sign, −1 otherwise."""

    def pays(self, state, action):
        return jnp.where(action[0] * state.observation[0] > 0, 1.0, -1.0)


def trained(task: Probe, num_updates: int = 30) -> ppo.TrainState:
    update = jax.jit(partial(ppo.update, task, CONFIG))
    state = ppo.init(jax.random.key(0), task, CONFIG)
    for _ in range(num_updates):
        state, _, _ = update(state)
    return state


def value(state: ppo.TrainState, observation: float) -> float:
    return float(state.networks.values(jnp.full((1, 1), observation))[0])


def mean(state: ppo.TrainState, observation: float) -> float:
    return float(state.networks.actor()(jnp.full(1, observation))[0])


def test_the_value_of_a_constant_reward_is_learned():
    assert value(trained(Probe()), 0.0) == pytest.approx(1.0, abs=0.05)


def test_the_value_depends_on_the_observation():
    state = trained(RandomSign())
    assert value(state, -1.0) == pytest.approx(-1.0, abs=0.1)
    assert value(state, 1.0) == pytest.approx(1.0, abs=0.1)


def test_a_later_reward_is_discounted():
    state = trained(ZeroThenOne())
    assert value(state, 1.0) == pytest.approx(1.0, abs=0.05)
    assert value(state, 0.0) == pytest.approx(CONFIG.gamma, abs=0.05)


def test_the_policy_finds_the_paying_action():
    state = trained(PositiveAction())
    assert mean(state, 0.0) > 1.0
    assert value(state, 0.0) > 0.5


def test_the_policy_follows_the_observation():
    state = trained(MatchSign(), num_updates=60)
    assert mean(state, 1.0) > 0.5
    assert mean(state, -1.0) < -0.5


def test_a_truncated_future_is_bootstrapped_and_a_terminated_one_is_not():
    """One step that pays 1 and is cut off for ever: V = 1 / (1 − γ), where a terminal one gives V = 1."""
    cut_off = trained(Probe(cut_off=True), num_updates=60)
    assert value(cut_off, 0.0) > 5.0
    np.testing.assert_allclose(value(trained(Probe(), num_updates=60), 0.0), 1.0, atol=0.05)
