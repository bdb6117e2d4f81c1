"""Steps of Walker2d without and with wrappers that pay for a behaviour, all in one process and in turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import gymnasium
import numpy as np

from bench.two_feet import ENVIRONMENT, WRAPPERS


def prepare(num_steps: int, wrappers: Sequence[str]):
    """`num_steps` steps under random torques, episode after episode, with their resets; units are steps.

    Every environment begins with the same seed and is given the same actions, so that all do the same.
    """
    envs = {"alone": gymnasium.make(ENVIRONMENT)}
    envs |= {f"with {name}": WRAPPERS[name](gymnasium.make(ENVIRONMENT)) for name in wrappers}
    space = envs["alone"].action_space
    assert isinstance(space, gymnasium.spaces.Box)
    actions = np.random.default_rng(0).uniform(space.low, space.high, (num_steps, *space.shape))
    actions = actions.astype(space.dtype)

    def steps_of(env: gymnasium.Env) -> Callable[[], None]:
        env.reset(seed=0)

        def work() -> None:
            env.reset()
            for action in actions:
                _, _, terminated, truncated, _ = env.step(action)
                if terminated or truncated:
                    env.reset()

        return work

    return {name: steps_of(env) for name, env in envs.items()}, num_steps
