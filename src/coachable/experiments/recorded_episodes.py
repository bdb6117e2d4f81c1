"""Walks of a trained robot: to look at, to record, to measure."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from jaxtyping import Float, Int, UInt8
from PIL import Image

from coachable.automata.trace import Trace
from coachable.envs.own_reward import OWN
from coachable.envs.problem import EnvironmentProblem
from coachable.envs.signals import SIGNAL_PACKS, signal_pack
from coachable.envs.signals.limbs import Limbs
from coachable.envs.signals.reading import reader_of_one
from coachable.envs.signals.time_step import time_step
from coachable.experiments.assessment import actor, most_steps
from coachable.experiments.experiment import EVALUATION_SEED, Which
from coachable.experiments.plant_walks import recorded_plant_walk
from coachable.experiments.recorded_walk import RecordedWalk
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.errors import ParameterError, PlanError
from coachable.learning.policy import Policy

Around = Callable[[gymnasium.Env], gymnasium.Env]

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

    def picture(self, sample: int) -> Image.Image:
        """What it looks like at a sample."""
        return Image.fromarray(self.pictures[sample])


def rendered_walk(
    run: Run,
    setup: str,
    seed: int,
    which: Which,
    seconds: float,
    episode: int = 0,
    around: Around = lambda env: env,
) -> RenderedWalk:
    """An episode of a lane's evaluations, as far as it goes.

    **Arguments:** `around`, what is put around the environment, such as a disturbance.

    **Raises:** `RunFolderError` if the run has no such lane, `PlanError` if its environment draws nothing.
    """
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo would look for a window
    policy = run.policy(setup, seed, which)
    problem = run.experiment.problem
    with closing(around(problem.environment(run.experiment.setup(setup), render_mode="rgb_array"))) as env:
        given = problem.dt if isinstance(problem, EnvironmentProblem) else None
        dt = given or time_step(env) or UNKNOWN_DT
        steps = _steps(env, policy, episode, seconds / dt)
        pictures, phases = zip(*((_picture(env), step.phase) for step in steps), strict=True)
    return RenderedWalk(
        f"{setup}, seed {seed}", np.arange(len(phases)) * dt, np.stack(pictures), np.array(phases)
    )


def recorded_walk(
    run: Run,
    setup: str,
    seed: int,
    which: Which = "last",
    episode: int = 0,
    seconds: float = np.inf,
    around: Around = lambda env: env,
) -> RecordedWalk:
    """An episode of a lane's evaluations, as far as it goes, from its start on.

    **Arguments:** `around`, what is put around the environment, such as a disturbance.

    **Raises:** `RunFolderError` if the run has no such lane, `ParameterError` if its environment does not say
    how long a step lasts, `PlanError` for an episode that a plant does not have.
    """
    problem = run.experiment.problem
    if not isinstance(problem, EnvironmentProblem):
        return recorded_plant_walk(run, setup, seed, which, episode, seconds)
    policy = run.policy(setup, seed, which)
    described = run.experiment.setup(setup)
    with closing(around(problem.environment(described))) as env:
        names = env.get_wrapper_attr("behaviour_reward").observation_names
        appended = len(names) if described.observe != "nothing" else 0
        dt = step_seconds(problem, env)
        has_pack = not problem.signals and problem.env in SIGNAL_PACKS
        signals = signal_pack(problem.env).signals if has_pack else run.behaviour.signals
        read = reader_of_one(env, tuple(signal.name for signal in signals), problem.signal_sources, "outside")
        limbs = Limbs.of(env)
        rows, ends, steps = [], [], []
        for step in _steps(env, policy, episode, seconds / dt):
            steps.append(step)
            # Signals are columns of what the environment itself shows; some count from its end.
            own = step.observation[: len(step.observation) - appended] if appended else step.observation
            rows.append(read(env, own, step.info, len(rows)))
            if limbs is not None:
                ends.append(limbs.ends())
    return RecordedWalk(
        f"{setup}, seed {seed}",
        Trace(
            np.arange(len(steps)) * dt,
            signals,
            {
                signal.name: np.array([*map(float, column)])
                for signal, column in zip(signals, zip(*rows, strict=True), strict=True)
            },
        ),
        phase=np.array([step.phase for step in steps]),
        follows=np.array([step.follows for step in steps]),
        phases=run.behaviour.phases,
        dt=float(dt),
        environment_return=sum(step.environment for step in steps),
        behaviour_return=sum(step.behaviour for step in steps),
        fell=steps[-1].terminated,
        **({} if limbs is None else {"limbs": limbs.names, "ends": np.stack(ends), "radii": limbs.radii}),
    )


def has_limbs(run: Run) -> bool:
    """Whether recorded walks of a training's robot tell where its limbs are."""
    env = run.experiment.problem.environment(run.experiment.setups[0])
    try:
        return Limbs.of(env) is not None
    finally:
        env.close()


def step_seconds(problem: EnvironmentProblem, env: gymnasium.Env) -> float:
    """The time between two steps [s]: the plan's, or the environment's own.

    **Raises:** `ParameterError` if neither gives one.
    """
    dt = problem.dt or time_step(env)
    if dt is None:
        raise ParameterError(
            f"{problem.env} does not say how long a step lasts: it has no dt and no render_fps; give "
            "the plan a dt"
        )
    return dt


class _Step(NamedTuple):
    observation: Any
    info: Mapping[str, Any]
    phase: int
    follows: bool
    environment: float
    behaviour: float
    terminated: bool


def _steps(env: gymnasium.Env, policy: Policy, episode: int, wanted: float) -> Iterator[_Step]:
    """The start of an episode, and step after step of it, while the environment is as that step left it."""
    act, limit = actor(policy, env), min(wanted, most_steps(env))
    observation, info = env.reset(seed=EVALUATION_SEED + episode)
    yield _Step(observation, info, info["behaviour"]["location"], False, 0.0, 0.0, False)
    count, over = 0, False
    while not over and count < limit:
        observation, _, terminated, truncated, info = env.step(act(observation))
        monitored = info["behaviour"]
        own, ours = float(info[OWN]), float(monitored["rewards"]["behaviour"])
        follows = monitored["verdict"]["follows"]
        yield _Step(observation, info, monitored["location"], follows, own, ours, bool(terminated))
        count, over = count + 1, terminated or truncated


def _picture(env: Any) -> np.ndarray:
    try:
        picture = env.render()
    except Exception as error:  # each renderer fails in its own way
        raise PlanError(f"{env.spec.id} cannot be drawn here: {error}") from None
    if not isinstance(picture, np.ndarray):
        raise PlanError(f"{env.spec.id} gives no pictures (render_mode rgb_array)")
    return picture
