"""Steps of our walking task under random actions, lanes side by side in one vmap."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from coachable.envs.walking_task import make_task
from coachable.experiments.trainers.compiled import COMPILER_OPTIONS
from coachable.rewards.setup import PAPER_SETUPS


def prepare(num_lanes: int, num_steps: int):
    """`num_steps` steps of every lane, episode after episode, in float32; units are steps of a lane."""
    task = make_task(PAPER_SETUPS["orthant"])
    reset_key = jax.random.key(0)

    def one_lane(actions):
        def step(state, action):
            state, timestep = task.step(state, action)
            ended = timestep.terminated | timestep.truncated
            fresh = task.reset(state, reset_key)
            state = jax.tree.map(lambda new, old: jnp.where(ended, new, old), fresh, state)
            return state, (timestep.observation, timestep.reward, ended)

        return jax.lax.scan(step, task.init(reset_key), actions)

    shape = (num_lanes, num_steps, task.action_size)
    actions = jax.random.uniform(jax.random.key(1), shape, jnp.float32, -2.0, 0.0)
    run = jax.jit(jax.vmap(one_lane), compiler_options=COMPILER_OPTIONS)
    return lambda: jax.block_until_ready(run(actions)), num_lanes * num_steps
