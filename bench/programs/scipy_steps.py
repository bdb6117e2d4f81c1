"""Steps of the SciPy environment under random actions."""

from __future__ import annotations

import numpy as np

from bench.scipy_walker import FLOWS, ScipyWalker


def prepare(flow: str, num_steps: int):
    """`num_steps` steps, episode after episode; units are steps."""
    environment = ScipyWalker(FLOWS[flow])
    actions = np.random.default_rng(0).uniform(-2, 0, (num_steps, 2)).astype(np.float32)

    def work():
        environment.reset()
        for action in actions:
            _, _, terminated, truncated, _ = environment.step(action)
            if terminated or truncated:
                environment.reset()

    return work, num_steps
