"""Walks of a trained robot in its environment, to look at."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from coachable.envs.environment_signals import time_step
from coachable.errors import PlanError
from coachable.studies.store import TrainingRun, Which
from coachable.studies.training_lane import EVALUATION_SEED, actor, make_env

UNKNOWN_DT = 0.04
"""Between two pictures of an environment that does not say how long a step lasts [s]."""


@dataclass(frozen=True, eq=False)
class RenderedWalk:
    """An episode as its environment draws it, the phase with every picture."""

    title: str
    time: Float[np.ndarray, " samples"]
    """[s]"""
    pictures: UInt8[np.ndarray, "samples height width 3"]
    phase: Int[np.ndarray, " samples"]
    """Location in the behaviour: 0 … K−1, or K outside all K phases."""


def rendered_walk(run: TrainingRun, setup: str, seed: int, which: Which, seconds: float) -> RenderedWalk:
    """The first episode of a lane's evaluations, as far as it goes.

    **Raises:** `RunFolderError` if the run has no such lane, `PlanError` if its environment draws nothing.
    """
    policy = run.policy(setup, seed, which)
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo would look for a window
    env = make_env(run.plan, run.plan.setup(setup), run.behaviour, render_mode="rgb_array")
    dt, act = time_step(env) or UNKNOWN_DT, actor(policy)
    observation, info = env.reset(seed=EVALUATION_SEED)
    pictures, phases, over = [_picture(env)], [info["behaviour"]["location"]], False
    while not over and len(phases) * dt < seconds:
        observation, _, terminated, truncated, info = env.step(act(observation))
        pictures.append(_picture(env))
        phases.append(info["behaviour"]["location"])
        over = terminated or truncated
    env.close()
    return RenderedWalk(
        f"{setup}, seed {seed}", np.arange(len(phases)) * dt, np.stack(pictures), np.array(phases)
    )


def _picture(env) -> np.ndarray:
    try:
        picture = env.render()
    except Exception as error:  # each renderer fails in its own way
        raise PlanError(f"{env.spec.id} cannot be drawn here: {error}") from None
    if not isinstance(picture, np.ndarray):
        raise PlanError(f"{env.spec.id} gives no pictures (render_mode rgb_array)")
    return picture
