"""stable-baselines3's PPO on Walker2d, without and with our wrapper, in one process and in turns."""

from __future__ import annotations

import gymnasium
import torch
from stable_baselines3 import PPO

from bench.two_feet import ENVIRONMENT, TWO_FEET
from coachable.envs.behaviour_reward import BehaviourReward


def prepare():
    """One update of PPO with its defaults on one thread; units are training steps.

    The behaviour is weighed with 0, so both learn the same and walk alike: only the wrapper makes a
    difference.
    """
    torch.set_num_threads(1)
    plain = gymnasium.make(ENVIRONMENT)
    wrapped = BehaviourReward(gymnasium.make(ENVIRONMENT), TWO_FEET, weight=0.0)
    models = {
        name: PPO("MlpPolicy", env, device="cpu", seed=0)
        for name, env in (("alone", plain), ("with coachable", wrapped))
    }
    num_steps = models["alone"].n_steps
    return {
        name: lambda model=model: model.learn(num_steps, reset_num_timesteps=False)
        for name, model in models.items()
    }, num_steps
