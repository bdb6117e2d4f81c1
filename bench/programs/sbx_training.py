"""sbx's PPO (JAX, one run at a time) with stable-baselines3's settings, on our task through Gymnasium."""

from __future__ import annotations

from sbx import PPO  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.callbacks import EvalCallback

from bench.gymnasium_walker import GymnasiumWalker


def prepare(num_updates: int):
    """`num_updates` updates and an evaluation episode every 10,000 steps; units are training steps."""
    # sbx's own defaults are smaller rollouts; these are stable-baselines3's.
    model = PPO(
        "MlpPolicy", GymnasiumWalker(), n_steps=2048, batch_size=64, n_epochs=10, max_grad_norm=0.5, seed=0
    )
    evaluation = EvalCallback(GymnasiumWalker(), n_eval_episodes=1, eval_freq=10_000, verbose=0, warn=False)
    num_steps = num_updates * model.n_steps
    return lambda: model.learn(num_steps, evaluation, reset_num_timesteps=False), num_steps
