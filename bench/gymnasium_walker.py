"""Our walking task as a Gymnasium environment, one compiled step a call: for trainers that run one."""

from __future__ import annotations

import gymnasium
import jax
import numpy as np

from coachable.envs.walking_task import make_task
from coachable.rewards.setup import PAPER_SETUPS


class GymnasiumWalker(gymnasium.Env):
    """The paper's walking task with the setup "orthant"."""

    def __init__(self):
        task = make_task(PAPER_SETUPS["orthant"])
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (task.observation_size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-2.0, 0.0, (task.action_size,), np.float32)
        key = jax.random.key(0)
        self._start = jax.device_get(task.init(key))
        self._first_observation = np.asarray(task.observation(self._start))
        # Closed over, the task is constants; eqx.filter_jit would flatten it at every call.
        self._step = jax.jit(lambda state, action: task.step(state, action))

    def reset(self, *, seed=None, options=None):
        """Stand at the paper's x0."""
        super().reset(seed=seed)
        self._state = self._start
        return self._first_observation, {}

    def step(self, action):
        """Hold the clipped torque for one control step."""
        self._state, timestep = self._step(self._state, action)
        observation, reward, terminated, truncated = jax.device_get(
            (timestep.observation, timestep.reward, timestep.terminated, timestep.truncated)
        )
        return observation, float(reward), bool(terminated), bool(truncated), {}
