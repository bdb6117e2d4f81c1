"""stable-baselines3's PPO, its defaults, on the CPU, with the evaluation of the paper."""

from __future__ import annotations

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import EvalCallback

from bench.scipy_walker import FLOWS, ScipyWalker


def prepare(flow: str, num_updates: int, threads: int | None):
    """`num_updates` updates and an evaluation episode every 10,000 steps; units are training steps."""
    if threads is not None:
        torch.set_num_threads(threads)
    model = PPO("MlpPolicy", ScipyWalker(FLOWS[flow]), device="cpu", seed=0)
    evaluation = EvalCallback(
        ScipyWalker(FLOWS[flow]), n_eval_episodes=1, eval_freq=10_000, verbose=0, warn=False
    )
    num_steps = num_updates * model.n_steps
    return lambda: model.learn(num_steps, evaluation, reset_num_timesteps=False), num_steps
