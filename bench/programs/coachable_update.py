"""The learning half of a PPO update alone: advantages, permutations, 320 steps of Adam.

Arithmetic of one minibatch of B samples through a network with W weights, W₁ of them in its first layer, a
multiplication and an addition counted as two operations:

    forward             2 B W
    weights' gradient   2 B W
    inputs' gradient    2 B (W − W₁)        the observations want none

Policy and value networks of 4-64-64 with 2 and 1 outputs have W = 2 · (4 · 64 + 64 · 64) + 3 · 64 = 8896 and
W₁ = 2 · 4 · 64 = 512, so 3.35 MFLOP for B = 64, and 1.07 GFLOP an update. Biases, tanh, the loss and Adam are
not counted, though they take time.
"""

from __future__ import annotations

from functools import partial

import jax

from coachable.envs.walking_task import make_task
from coachable.experiments.trainers.compiled import COMPILER_OPTIONS
from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.rewards.setup import PAPER_SETUPS


def prepare(num_lanes: int):
    """One update of every lane, one after another, on one thread; units are floating-point operations."""
    config = PPOConfig()
    task = make_task(PAPER_SETUPS["orthant"])
    keys = jax.random.split(jax.random.key(0), num_lanes)
    states = jax.vmap(partial(ppo.init, task=task, config=config))(keys)
    states, rollouts, _ = jax.jit(jax.vmap(partial(ppo.collect, task, config=config)))(states)
    improve = jax.jit(
        lambda *lanes: jax.lax.map(lambda lane: ppo.improve(config, *lane), lanes),
        compiler_options=COMPILER_OPTIONS,
    )
    return lambda: jax.block_until_ready(improve(states, rollouts)), num_lanes * arithmetic(config, task)


def arithmetic(config: PPOConfig, task) -> int:
    """Floating-point operations of one update, as counted above."""
    first, second = config.hidden_sizes
    first_layers = 2 * task.observation_size * first
    weights = first_layers + 2 * first * second + second * (task.action_size + 1)
    minibatch = 2 * config.batch_size * (3 * weights - first_layers)
    return config.n_epochs * config.num_minibatches * minibatch
