"""Steps of the Gymnasium vector environment under torques near those that walk, episode after episode."""

from __future__ import annotations

import gymnasium
import numpy as np

import coachable.envs  # noqa: F401  registers the environment


def prepare(num_envs: int, num_steps: int):
    """`num_steps` calls of `step`; the unit is the call, however many environments it steps."""
    environment = gymnasium.make_vec(
        "coachable/CompassWalker-v0",
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        start_noise=0.02,
    )
    near_walking = np.random.default_rng(0).normal([-1.35, -0.18], 0.1, (num_steps, num_envs, 2))
    torques = near_walking.astype(np.float32)

    def work():
        environment.reset(seed=0)
        for torque in torques:
            environment.step(torque)

    return work, num_steps
