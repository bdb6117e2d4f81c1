"""A walker under a mirrored policy in its environment: what it observed, and what was done."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import gymnasium
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours import load_behaviour
from coachable.envs.problem import EnvironmentProblem
from coachable.envs.signals.reading import reader_of_one
from coachable.envs.symmetry import derived
from coachable.experiments.assessment import actor
from coachable.learning.policy import Policy
from coachable.rewards.setup import DescribedSetup

DT = 0.008
"""Of Walker2d-v5 [s]."""
WALK = Path(__file__).parents[2] / "experiments" / "walker2d" / "walk.behaviour"
OBSERVED, CONTROLS = 17, 6


@dataclass(frozen=True)
class Episodes:
    """Rows of episodes, one after another."""

    policy: Policy
    observations: np.ndarray
    """Of the robot, without its memory."""
    signals: np.ndarray
    begins: np.ndarray
    phases: np.ndarray
    """The expected phase."""
    actions: np.ndarray
    """By the policy as evaluations run it."""


@cache
def mirrored_walk(form: str, observe: str) -> Episodes:
    """Three short episodes, in which a robot that is down goes on."""
    options = {"terminate_when_unhealthy": False, "max_episode_steps": 250}
    walk = load_behaviour(WALK)
    with pytest.MonkeyPatch.context() as patch:
        # That the mirror is right is tested elsewhere.
        patch.setattr(derived, "NUM_STATES", 30)
        patch.setattr(derived, "NUM_TESTS", 5)
        return _walked(walk, form, observe, options)


def _walked(walk, form, observe, options) -> Episodes:
    problem = EnvironmentProblem(behaviour=walk, env="Walker2d-v5", env_options=options)
    setup = DescribedSetup(name="a", reward_variant=form, observe=observe)
    env = problem.environment(setup)
    policy = random_policy(env, problem.policy_description(setup))
    act, read = actor(policy, env), reader_of_one(env, walk.signal_names, None, "raise")
    rows = []
    for seed in (0, 3, 4):
        (observation, info), begins, over = env.reset(seed=seed), True, False
        while not over:
            action, signals = act(observation), read(env, observation, info, 0)
            phase = env.get_wrapper_attr("expected_phase")
            rows.append((observation[:OBSERVED], signals, begins, phase, action))
            observation, _, terminated, truncated, info = env.step(action)
            begins, over = False, terminated or truncated
    env.close()
    return Episodes(policy, *map(np.array, zip(*rows, strict=True)))


def random_policy(env: gymnasium.Env, about: dict) -> Policy:
    """Of random weights, for what is observed in an environment, with entries of its description."""
    rng, (inputs,) = np.random.default_rng(4), env.observation_space.shape
    return Policy(
        (
            jnp.asarray(rng.normal(0, 0.4, (16, inputs)), jnp.float32),
            jnp.asarray(rng.normal(0, 0.4, (CONTROLS, 16)), jnp.float32),
        ),
        (jnp.zeros(16), jnp.asarray(rng.normal(0, 0.3, CONTROLS), jnp.float32)),
        -jnp.ones(CONTROLS),
        jnp.ones(CONTROLS),
        **{name: json.dumps(data) for name, data in about.items()},
    )
