"""Steps of Walker2d without and with wrappers that pay for a behaviour, in turns around one simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import gymnasium
import numpy as np

from bench.two_feet import ENVIRONMENT, WRAPPERS


def prepare(num_steps: int, wrappers: Sequence[str]):
    """`num_steps` steps under random torques, episode after episode, with their resets; units are steps.

    All begin with the same seed and are given the same actions, so that all do the same. They share the
    simulator, for where in memory it lies is worth a microsecond a step.
    """
    alone = gymnasium.make(ENVIRONMENT)
    envs = {"alone": alone, **{f"with {name}": WRAPPERS[name](alone) for name in wrappers}}
    space = alone.action_space
    assert isinstance(space, gymnasium.spaces.Box)
    actions = np.random.default_rng(0).uniform(space.low, space.high, (num_steps, *space.shape))
    actions = actions.astype(space.dtype)

    def steps_of(env: gymnasium.Env) -> Callable[[], None]:
        def work() -> None:
            env.reset(seed=0)
            for action in actions:
                _, _, terminated, truncated, _ = env.step(action)
                if terminated or truncated:
                    env.reset()

        return work

    return {name: steps_of(env) for name, env in envs.items()}, num_steps
