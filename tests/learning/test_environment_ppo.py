"""Our PPO on Gymnasium environments: tiny ones with known answers, its scaling, and going on to the bit."""

from dataclasses import replace

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.spaces import Box

from coachable.envs.side_by_side.copies import LONGEST_REPLAY
from coachable.foundation.errors import PlanError
from coachable.learning import environment_ppo, ppo
from coachable.learning.config import EnvironmentPPOConfig, PPOConfig
from coachable.learning.environment_ppo import Learner
from coachable.learning.networks import initial_networks

PROBE = EnvironmentPPOConfig(
    n_steps=32, n_envs=8, batch_size=64, learning_rate=3e-3, hidden_sizes=(16, 16), normalize=False
)
SMALL = EnvironmentPPOConfig(n_steps=50, n_envs=3, batch_size=50, n_epochs=2, hidden_sizes=(8, 8))


class Probe(gymnasium.Env):
    """Episodes of one step, or of `length`, which then see 1; what they pay is `pays(seen, action)`."""

    observation_space = Box(-1.0, 1.0, (1,), np.float32)
    action_space = Box(-2.0, 2.0, (1,), np.float32)

    def __init__(self, pays=lambda seen, action: 1.0, first=(0.0,), length=1, cut_off=False):
        self.pays, self.first, self.length, self.cut_off = pays, first, length, cut_off

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps, self.seen = 0, float(self.np_random.choice(self.first))
        return np.array([self.seen], np.float32), {}

    def step(self, action):
        reward, self.steps = self.pays(self.seen, action[0]), self.steps + 1
        self.seen = 1.0 if self.length > 1 else self.seen
        over = self.steps >= self.length
        observation = np.array([self.seen], np.float32)
        return observation, reward, over and not self.cut_off, over and self.cut_off, {}


class Noisy(gymnasium.Env):
    """Four numbers that two actions drive; ends by itself, or is cut off after 40 steps."""

    observation_space = Box(-np.inf, np.inf, (4,), np.float64)
    action_space = Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state, self.steps = 5.0 + self.np_random.normal(size=4), 0
        return self.state, {}

    def step(self, action):
        push = np.concatenate([action, -action])
        self.state = 0.95 * self.state + 0.3 * push + 0.1 * self.np_random.normal(size=4)
        self.steps += 1
        return self.state, -float(np.square(self.state).sum()), self.state[0] < 0.3, self.steps >= 40, {}


def trained(config=PROBE, num_updates=30, **probe):
    learner = Learner(lambda: Probe(**probe), config, 0)
    learner.learn(num_updates * config.rollout_size, lambda: None)
    return learner


def value(learner, observation):
    return float(learner._state.networks.values(jnp.full((1, 1), observation))[0])


def act(learner, observation):
    return float(learner.policy()(jnp.full(1, observation))[0])


def assert_equal(one, other):
    assert one.keys() == other.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], err_msg=name)


def test_the_value_of_a_constant_reward_is_learned():
    assert value(trained(), 0.0) == pytest.approx(1.0, abs=0.05)


def test_the_value_depends_on_the_observation():
    learner = trained(pays=lambda seen, action: seen, first=(-1.0, 1.0))
    assert value(learner, -1.0) == pytest.approx(-1.0, abs=0.1)
    assert value(learner, 1.0) == pytest.approx(1.0, abs=0.1)


def test_a_later_reward_is_discounted():
    learner = trained(pays=lambda seen, action: seen, length=2)
    assert value(learner, 1.0) == pytest.approx(1.0, abs=0.05)
    assert value(learner, 0.0) == pytest.approx(PROBE.gamma, abs=0.05)


def test_the_policy_finds_the_paying_action():
    learner = trained(pays=lambda seen, action: float(np.sign(action)))
    assert act(learner, 0.0) > 1.0
    assert value(learner, 0.0) > 0.5


def test_the_policy_follows_the_observation():
    learner = trained(
        pays=lambda seen, action: float(np.sign(action * seen)), first=(-1.0, 1.0), num_updates=60
    )
    assert act(learner, 1.0) > 0.5
    assert act(learner, -1.0) < -0.5


def test_a_truncated_future_is_bootstrapped_and_a_terminated_one_is_not():
    """One step that pays 1 and is cut off for ever: V = 1 / (1 − γ), where a terminal one gives V = 1."""
    assert value(trained(cut_off=True, num_updates=60), 0.0) > 5.0
    assert value(trained(num_updates=60), 0.0) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("changes", [{}, {"normalize": False}, {"squashing": "tanh", "n_envs": 1}])
def test_one_that_was_interrupted_goes_on_to_the_bit(changes):
    config, kept = replace(SMALL, **changes), {}
    whole = Learner(Noisy, config, 7)

    def keep():
        if whole.num_steps == 2 * config.rollout_size:
            kept.update(whole.arrays())

    whole.learn(5 * config.rollout_size, keep)
    resumed = Learner(Noisy, config, 7)
    resumed.restore(kept)
    assert_equal(resumed.arrays(), kept)
    resumed.learn(5 * config.rollout_size, lambda: None)
    assert_equal(resumed.arrays(), whole.arrays())


def test_one_that_was_interrupted_before_its_first_step_begins():
    learner, resumed = Learner(Noisy, SMALL, 7), Learner(Noisy, SMALL, 7)
    resumed.restore(learner.arrays())
    for each in (learner, resumed):
        each.learn(SMALL.rollout_size, lambda: None)
    assert_equal(resumed.arrays(), learner.arrays())


def test_an_environment_that_does_not_repeat_itself_begins_another_episode():
    class Unseeded(Noisy):
        def reset(self, *, seed=None, options=None):
            return super().reset(seed=None)

    learner, resumed = Learner(Unseeded, SMALL, 7), Learner(Unseeded, SMALL, 7)
    learner.learn(SMALL.rollout_size, lambda: None)
    kept = learner.arrays()
    resumed.restore(kept)
    after = resumed.arrays()
    for index in range(SMALL.n_envs):
        assert after[f"copy_{index}.episode"] == kept[f"copy_{index}.episode"] + 1
        assert len(after[f"copy_{index}.actions"]) == 0
    resumed.learn(2 * SMALL.rollout_size, lambda: None)


def test_an_endless_episode_is_begun_anew_after_an_interruption():
    config = replace(PROBE, n_envs=1, n_steps=LONGEST_REPLAY + 2, batch_size=2 * (LONGEST_REPLAY // 2 + 1))
    learner, resumed = (Learner(lambda: Probe(length=10**9), config, 0) for _ in range(2))
    learner.learn(config.rollout_size, lambda: None)
    assert len(learner.arrays()["copy_0.actions"]) == LONGEST_REPLAY + 1
    resumed.restore(learner.arrays())
    assert len(resumed.arrays()["copy_0.actions"]) == 0


def test_lanes_differ_by_their_seed_and_copies_by_their_number():
    starts = [Learner(Noisy, SMALL, seed) for seed in (1, 1, 2)]
    for learner in starts:
        learner.learn(SMALL.rollout_size, lambda: None)
    first, again, other = (learner.arrays() for learner in starts)
    assert_equal(first, again)
    assert (first["seen"] != other["seen"]).all()
    assert len({*first["seen"][:, 0]}) == SMALL.n_envs


def test_its_policy_acts_as_it_did_when_it_learned():
    learner = Learner(Noisy, SMALL, 3)
    learner.learn(3 * SMALL.rollout_size, lambda: None)
    policy, networks, scaling = learner.policy(), learner._state.networks, learner._scaling()
    assert policy.shift is not None
    assert np.abs(np.asarray(policy.shift)).max() > 1, "the observations are far from 0"
    for observation in np.random.default_rng(0).normal(3.0, 2.0, (20, 4)).astype(np.float32):
        mean = networks.means(scaling(observation)[:, None])[:, 0]
        np.testing.assert_allclose(policy(jnp.asarray(observation)), np.clip(mean, -1, 1), atol=1e-6)


def test_moments_are_those_of_all_that_was_seen_and_paid():
    config = replace(SMALL, n_envs=1)
    seen, returns, total = [], [], 0.0

    class Watched(Noisy):
        def reset(self, **options):
            nonlocal total
            total = 0.0
            observation, info = super().reset(**options)
            seen.append(observation)
            return observation, info

        def step(self, action):
            nonlocal total
            observation, reward, terminated, truncated, info = super().step(action)
            total = config.gamma * total + reward
            returns.append(total)
            if not (terminated or truncated):
                seen.append(observation)
            return observation, reward, terminated, truncated, info

    learner = Learner(Watched, config, 0)
    learner.learn(4 * config.rollout_size, lambda: None)
    acted_on = np.array(seen[: learner.num_steps], np.float32)
    np.testing.assert_allclose(learner._of_observations.mean, acted_on.mean(0), rtol=1e-5)
    np.testing.assert_allclose(learner._of_observations.var, acted_on.var(0), rtol=1e-4)
    np.testing.assert_allclose(learner._of_returns.var, np.var(returns), rtol=1e-4)


def test_a_rollout_of_several_environments_is_learned_from_as_one_of_each():
    """Values of environments side by side are those of each by itself; one is as none."""
    key, size = jax.random.split(jax.random.key(0)), (24, 4)
    networks = initial_networks(key[0], 3, 2, (8, 8))

    def random(*shape):
        return jax.random.normal(jax.random.fold_in(key[1], sum(shape)), shape)

    seen, truncated = random(25, 4, 3), random(*size) < -1.5
    rollout = ppo.Rollout(
        observations=seen[:-1],
        next_observations=jnp.where(truncated[..., None], 5.0, seen[1:]),
        actions=random(*size, 2),
        log_probabilities=random(*size),
        rewards=random(*size),
        terminated=random(*size) > 1.5,
        truncated=truncated,
    )
    assert rollout.truncated.any()
    assert rollout.terminated.any()
    together = ppo.values_of(networks, rollout)
    for index in range(4):
        alone = ppo.values_of(networks, jax.tree.map(lambda leaf, i=index: leaf[:, i], rollout))
        for a, b in zip(together, alone, strict=True):
            np.testing.assert_allclose(a[:, index], b, atol=1e-6)
    state = ppo.initial_state(key[0], networks, None)
    one = jax.tree.map(lambda leaf: leaf[:, :1], rollout)
    beside = EnvironmentPPOConfig(n_steps=24, n_envs=1, batch_size=8, gamma=0.99)
    improved, _ = jax.jit(ppo.improve, static_argnums=0)(beside, state, one)
    alone = jax.tree.map(lambda leaf: leaf[:, 0], one)
    expected, _ = jax.jit(ppo.improve, static_argnums=0)(PPOConfig(n_steps=24, batch_size=8), state, alone)
    for a, b in zip(jax.tree.leaves(improved.networks), jax.tree.leaves(expected.networks), strict=True):
        np.testing.assert_array_equal(a, b)


class Spaces(gymnasium.Env):
    def __init__(self, observations=Noisy.observation_space, actions=Noisy.action_space):
        self.observation_space, self.action_space = observations, actions


@pytest.mark.parametrize(
    ("spaces", "message"),
    [
        ({"observations": Box(0.0, 1.0, (2, 2))}, "observations must be a row of numbers"),
        ({"observations": gymnasium.spaces.Discrete(3)}, "observations must be a row of numbers"),
        ({"actions": gymnasium.spaces.Discrete(3)}, "actions must be a row of numbers within bounds"),
        ({"actions": Box(-np.inf, np.inf, (2,))}, "actions must be a row of numbers within bounds"),
    ],
)
def test_spaces_that_it_cannot_work_with_are_refused(spaces, message):
    with pytest.raises(PlanError, match=message):
        Learner(lambda: Spaces(**spaces), SMALL, 0)


def test_a_training_that_diverges_says_so():
    learner = Learner(lambda: Probe(pays=lambda seen, action: np.inf), PROBE, 0)
    with pytest.raises(PlanError, match="diverged after 0 steps"):
        learner.learn(PROBE.rollout_size, lambda: None)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"n_envs": 0}, "n_envs"),
        ({"normalize": 1}, "normalize must be true or false"),
        ({"n_steps": 100, "n_envs": 3, "batch_size": 64}, "a divisor of n_steps × n_envs = 300"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings, message):
    with pytest.raises(PlanError, match=message):
        EnvironmentPPOConfig(**settings)


@pytest.mark.parametrize(
    ("anneal", "rates"),
    [(0.0, [1, 1, 1, 1]), (0.5, [1, 1, 1, 0.5]), (1.0, [1, 0.75, 0.5, 0.25])],
)
def test_the_learning_rate_falls_over_the_last_steps(monkeypatch, anneal, rates):
    improve, given = environment_ppo._improve, []

    def noticed(config, state, gathered, scaling, rate):
        given.append(rate)
        return improve(config, state, gathered, scaling, rate)

    monkeypatch.setattr(environment_ppo, "_improve", noticed)
    trained(replace(PROBE, anneal=anneal), num_updates=4)
    assert given == rates
