"""What a lane is measured by: rows for the run folder's tables, from its policies and training episodes."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np

from coachable.automata.cycle_progress import completed_cycles
from coachable.behaviours.behaviour import Behaviour
from coachable.envs.own_reward import OWN
from coachable.envs.problem import PlantProblem
from coachable.envs.rollout import Summary, rollout, summary
from coachable.envs.symmetry.phase_mirror import EXPECTED_PHASE, PhaseMirror
from coachable.experiments.experiment import EVALUATION_SEED, Experiment, Lane
from coachable.experiments.log import Columns, Log
from coachable.experiments.survival import share_up, time_up
from coachable.experiments.trainers.compiled import Tasks
from coachable.learning.policy import Policy
from coachable.rewards.setup import TERM_NAMES


class Assessment(abc.ABC):
    """How the policies of one lane are measured."""

    fell_key: str | None = None
    """The key of an info that holds whether an episode that terminated was a fall; `None` if all are."""

    @abc.abstractmethod
    def sums_of(self, info: Mapping[str, Any]) -> Mapping[str, float]:
        """Numbers in a training step's info that are added up over an episode, by column."""

    @abc.abstractmethod
    def evaluate(self, policy: Policy) -> Columns:
        """An evaluation as rows of `evaluations`, without lane and step."""

    @abc.abstractmethod
    def finish(self, policy: Policy) -> Mapping[str, Columns]:
        """Further tables of the last policy, without the lane."""


def assessment(experiment: Experiment, lane: Lane) -> Assessment:
    """The assessment of a lane's policies."""
    if isinstance(experiment.problem, PlantProblem):
        return _OfPlant(experiment, lane)
    return _InEnvironment(experiment, lane)


class _OfPlant(Assessment):
    """One deterministic episode, compiled; in the end how long it stays up, and from how many starts."""

    fell_key = "fell"

    def __init__(self, experiment: Experiment, lane: Lane):
        tasks = Tasks.of(experiment, lane.setup)
        evaluation = tasks.weighted(tasks.evaluation, lane)
        self._behaviour = experiment.behaviour
        self._location_at_start = int(evaluation.locate(evaluation.x0))

        def walk(policy: Policy) -> tuple[Summary, jax.Array, jax.Array]:
            episode = rollout(evaluation, policy)
            return summary(evaluation, episode), episode.timesteps.phase, episode.alive

        self._walk = eqx.filter_jit(walk)
        self._survive = eqx.filter_jit(
            lambda policy: (
                time_up(tasks.long, policy, tasks.long.x0)[0],
                share_up(tasks.perturbed, policy, jnp.asarray(tasks.starts)),
            )
        )

    def sums_of(self, info: Mapping[str, Any]) -> Mapping[str, float]:
        return {}

    def evaluate(self, policy: Policy) -> Columns:
        walk, phases, alive = jax.device_get(self._walk(policy))
        locations = np.append(self._location_at_start, phases[alive])
        numbers = {
            "return": walk.episode_return,
            "hip_x": walk.hip_x,
            "foot_x": walk.foot_x,
            "length": walk.length,
            "fell": walk.fell,
            "share_in_cycle": walk.share_in_cycle,
            "cycles": np.int32(completed_cycles(self._behaviour, locations)),
            **dict(zip(TERM_NAMES, walk.terms, strict=True)),
        }
        return {name: np.asarray(number)[None] for name, number in numbers.items()}

    def finish(self, policy: Policy) -> Mapping[str, Columns]:
        seconds_up, perturbed_up = self._survive(policy)
        return {
            "survival": {
                "seconds_up": np.asarray(seconds_up)[None],
                "perturbed_up": np.asarray(perturbed_up)[None],
            }
        }


class _InEnvironment(Assessment):
    """Deterministic episodes that always begin at the same starts."""

    def __init__(self, experiment: Experiment, lane: Lane):
        self._env = experiment.problem.environment(experiment.setup(lane.setup))
        self._count = experiment.evaluation_episodes
        self._behaviour = experiment.behaviour
        self._outside = len(experiment.behaviour.phases)

    def sums_of(self, info: Mapping[str, Any]) -> Mapping[str, float]:
        step = info["behaviour"]
        return {
            OWN: info[OWN],
            "behaviour": step["rewards"]["behaviour"],
            "in_cycle": float(step["location"] != self._outside),
        }

    def evaluate(self, policy: Policy) -> Columns:
        return roll_out_episodes(self._env, policy, self._count, self.sums_of, self._behaviour)

    def finish(self, policy: Policy) -> Mapping[str, Columns]:
        return {}


LONGEST_EPISODE = 10_000
"""Steps after which an evaluation ends an episode of an environment that has no time limit."""


def most_steps(env: gymnasium.Env) -> float:
    """How many steps an episode of an evaluation may take; no bound where the environment has its own."""
    limited = env.spec is not None and env.spec.max_episode_steps is not None
    return np.inf if limited else LONGEST_EPISODE


def roll_out_episodes(
    env: gymnasium.Env,
    policy: Policy,
    count: int,
    sums_of: Callable[[Mapping[str, Any]], Mapping[str, float]],
    behaviour: Behaviour,
) -> Columns:
    """Episode after episode of a policy, a row each; episode i is reset with `EVALUATION_SEED` + i.

    An episode of an environment without a time limit ends after `LONGEST_EPISODE` steps.
    """
    log, limit = Log(), most_steps(env)
    act = actor(policy, env)
    for episode in range(count):
        observation, info = env.reset(seed=EVALUATION_SEED + episode)
        start = info.get("x_position", np.nan)
        sums = {"return": 0.0, OWN: 0.0, "behaviour": 0.0, "in_cycle": 0.0}
        length, terminated, truncated = 0, False, False
        locations = [info["behaviour"]["location"]]
        while not (terminated or truncated) and length < limit:
            observation, reward, terminated, truncated, info = env.step(act(observation))
            length += 1
            locations.append(info["behaviour"]["location"])
            for name, number in ({"return": float(reward)} | dict(sums_of(info))).items():
                sums[name] += number
        row = {
            **sums,
            "episode": episode,
            "length": length,
            "fell": bool(terminated),
            "cycles": completed_cycles(behaviour, np.array(locations)),
            "distance": info.get("x_position", np.nan) - start,
        }
        log.add({name: np.array([value]) for name, value in row.items()})
    return with_share(log.columns())


def actor(policy: Policy, env: gymnasium.Env) -> Callable[[np.ndarray], np.ndarray]:
    """The policy as a function of what is observed in an environment, mirrored by phase where it is.

    Compiled once for all policies of its shape.
    """
    leaves, shape = jax.tree.flatten(replace(policy, mirror=""))

    def act(observation: np.ndarray) -> np.ndarray:
        return np.asarray(_act(shape, leaves, np.asarray(observation, np.float32)))

    mirror = PhaseMirror.from_json(policy.mirror)
    if mirror is None:
        return act

    def act_by_phase(observation: np.ndarray) -> np.ndarray:
        phase = env.get_wrapper_attr(EXPECTED_PHASE)
        return mirror.done(act(mirror.observed(observation, phase)), phase)

    return act_by_phase


# A call of `eqx.filter_jit` takes several times as long, and it is made in every step.
_act = jax.jit(lambda shape, leaves, observation: shape.unflatten(leaves)(observation), static_argnums=0)


def with_share(columns: Columns) -> Columns:
    """Episodes with the share of their steps in the cycle in place of their number, where that is counted."""
    if "in_cycle" not in columns:
        return columns
    rest = {name: values for name, values in columns.items() if name != "in_cycle"}
    return rest | {"share_in_cycle": columns["in_cycle"] / columns["length"]}
