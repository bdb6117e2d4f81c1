"""The compiled programs that train, evaluate and measure lanes, one set for each width of batch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from coachable.envs.rollout import Episode, Summary, rollout, summary
from coachable.envs.walking_task import WalkingTask
from coachable.experiments.experiment import Experiment, Lane
from coachable.experiments.layout import lane_key
from coachable.experiments.survival import (
    LONG_SECONDS,
    PERTURBED_SECONDS,
    perturbed_starts,
    share_up,
    time_up,
)
from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.learning.networks import ActorCritic

COMPILER_OPTIONS = {"xla_cpu_multi_thread_eigen": False}
"""A program runs in the thread that calls it; the cores are kept busy by batches side by side."""

Compiled = Callable[..., Any]
Tree = TypeVar("Tree")


@dataclass(frozen=True)
class Tasks:
    """The task of an experiment in the forms that its lanes need, without their weights."""

    training: WalkingTask
    evaluation: WalkingTask
    long: WalkingTask
    """For `LONG_SECONDS`."""
    perturbed: WalkingTask
    """For `PERTURBED_SECONDS`."""
    weights: Mapping[str, np.ndarray]
    """Of the reward's terms, by setup."""
    starts: np.ndarray
    """Perturbed starts."""

    @staticmethod
    def of(experiment: Experiment) -> Tasks:
        """The tasks of an experiment with a plant."""
        problem = experiment.require_plant("a compiled task")
        released = problem.semantics == "released-code"
        make = partial(problem.task, experiment.reward_setups[0], squashing=experiment.trainer.squashing)
        evaluation = make()
        return Tasks(
            training=make(shared_evaluation_every=experiment.evaluate_every if released else 0),
            evaluation=evaluation,
            long=make(seconds=LONG_SECONDS),
            perturbed=make(seconds=PERTURBED_SECONDS),
            weights={
                s.name: np.asarray(s.weights, evaluation.weights.dtype) for s in experiment.reward_setups
            },
            starts=perturbed_starts(evaluation),
        )

    def weighted(self, task: WalkingTask, lane: Lane) -> WalkingTask:
        """The task with the weights of the lane's setup."""
        return eqx.tree_at(lambda task: task.weights, task, jnp.asarray(self.weights[lane.setup]))

    def stacked(self, task: WalkingTask, lanes: Iterable[Lane]) -> WalkingTask:
        """The task once a lane, each with the weights of its setup."""
        return stacked([self.weighted(task, lane) for lane in lanes])


@dataclass(frozen=True)
class Programs:
    """What is compiled for batches of one width; `update` and `evaluate` take and give stacked lanes."""

    init: Compiled
    """key, task of one lane → its state"""
    update: Compiled
    """tasks, states → states, episodes, diagnostics"""
    evaluate: Compiled
    """tasks, networks → `Summary`, `Episode`"""
    survive: Compiled
    """networks of one lane → time up [s] of a long episode, share of perturbed starts up"""


def stacked(trees: Sequence[Tree]) -> Tree:
    """Trees of one structure as one tree whose leaves have a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def compile_programs(
    experiment: Experiment, config: PPOConfig, tasks: Tasks, widths: Iterable[int], num_workers: int
) -> dict[int, Programs]:
    """The programs for every width, compiled side by side."""

    def survive(networks: ActorCritic) -> tuple[jax.Array, jax.Array]:
        policy = networks.actor()
        seconds_up, _ = time_up(tasks.long, policy, tasks.long.x0)
        return seconds_up, share_up(tasks.perturbed, policy, jnp.asarray(tasks.starts))

    def update(
        tasks: WalkingTask, states: ppo.TrainState
    ) -> tuple[ppo.TrainState, ppo.Episodes, ppo.Diagnostics]:
        return ppo.update_lanes(tasks, config, states)

    def init(key: jax.Array, task: WalkingTask) -> ppo.TrainState:
        return ppo.init(key, task, config)

    one_state = jax.eval_shape(init, lane_key(experiment.lanes[0]), tasks.training)
    sources: dict[tuple[int, str], tuple[Any, ...]] = {
        (1, "init"): (init, lane_key(experiment.lanes[0]), tasks.training),
        (1, "survive"): (survive, one_state.networks),
    }
    for width in set(widths):
        lanes = [Lane(experiment.reward_setups[0].name, 0)] * width
        training, evaluation = (tasks.stacked(task, lanes) for task in (tasks.training, tasks.evaluation))
        states = jax.eval_shape(stacked, [one_state] * width)
        sources |= {
            (width, "update"): (update, training, states),
            (width, "evaluate"): (jax.vmap(_evaluate), evaluation, states.networks),
        }

    def compile_one(function: Callable, *arguments: Any) -> Compiled:
        with jax.enable_x64(False):
            return jax.jit(function, compiler_options=COMPILER_OPTIONS).lower(*arguments).compile()

    longest_first = sorted(sources, key=lambda key: key[1] != "update")
    with ThreadPoolExecutor(num_workers) as pool:
        futures = {key: pool.submit(compile_one, *sources[key]) for key in longest_first}
        compiled = {key: future.result() for key, future in futures.items()}
    return {
        width: Programs(
            init=compiled[1, "init"],
            update=compiled[width, "update"],
            evaluate=compiled[width, "evaluate"],
            survive=compiled[1, "survive"],
        )
        for width in set(widths)
    }


def _evaluate(task: WalkingTask, networks: ActorCritic) -> tuple[Summary, Episode]:
    episode = rollout(task, networks.actor())
    return summary(task, episode), episode
