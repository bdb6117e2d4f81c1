"""The compiled programs that train, evaluate and measure lanes: a set for each width and kind of batch."""

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
from coachable.envs.squashing import Deterministic, expected_action
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
from coachable.plants.plant import Controller

COMPILER_OPTIONS = {"xla_cpu_multi_thread_eigen": False}
"""A program runs in the thread that calls it; the cores are kept busy by batches side by side."""

Compiled = Callable[..., Any]
Tree = TypeVar("Tree")


@dataclass(frozen=True)
class Tasks:
    """The task of some setups of an experiment that share a program, in the forms that their lanes need,
    without their weights.
    """

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
    def of(experiment: Experiment, setup: str | None = None) -> Tasks:
        """The tasks of an experiment with a plant.

        **Arguments:** `setup`, one of those that share the program; by default the first.
        """
        problem = experiment.require_plant("a compiled task")
        released = problem.semantics == "released-code"
        one = experiment.reward_setups[0] if setup is None else experiment.setup(setup)
        setups = [
            each for each in experiment.reward_setups if problem.program_of(each) == problem.program_of(one)
        ]
        make = partial(problem.task, one, squashing=experiment.trainer.squashing)
        evaluation = make()
        return Tasks(
            training=make(shared_evaluation_every=experiment.evaluate_every if released else 0),
            evaluation=evaluation,
            long=make(seconds=LONG_SECONDS),
            perturbed=make(seconds=PERTURBED_SECONDS),
            weights={each.name: np.asarray(each.weights, evaluation.weights.dtype) for each in setups},
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
    evaluate: Mapping[Deterministic, Compiled]
    """tasks, networks → `Summary`, `Episode`"""
    survive: Mapping[Deterministic, Compiled]
    """networks of one lane → time up [s] of a long episode, share of perturbed starts up"""


def stacked(trees: Sequence[Tree]) -> Tree:
    """Trees of one structure as one tree whose leaves have a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def compile_programs(
    experiment: Experiment, config: PPOConfig, tasks: Tasks, widths: Iterable[int], num_workers: int
) -> dict[int, Programs]:
    """The programs for every width, compiled side by side."""

    def survive(deterministic: Deterministic, networks: ActorCritic) -> tuple[jax.Array, jax.Array]:
        policy = controller_of(tasks.evaluation, networks, deterministic)
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
        (1, "init"): (init, lane_key(experiment.lanes[0]), tasks.training)
    }
    for rule in experiment.deterministic:
        sources[1, f"survive {rule}"] = (partial(survive, rule), one_state.networks)
    for width in set(widths):
        lanes = [Lane(next(iter(tasks.weights)), 0)] * width
        training, evaluation = (tasks.stacked(task, lanes) for task in (tasks.training, tasks.evaluation))
        states = jax.eval_shape(stacked, [one_state] * width)
        sources[width, "update"] = (update, training, states)
        for rule in experiment.deterministic:
            evaluate = jax.vmap(partial(_evaluate, rule))
            sources[width, f"evaluate {rule}"] = (evaluate, evaluation, states.networks)

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
            evaluate={rule: compiled[width, f"evaluate {rule}"] for rule in experiment.deterministic},
            survive={rule: compiled[1, f"survive {rule}"] for rule in experiment.deterministic},
        )
        for width in set(widths)
    }


def _evaluate(
    deterministic: Deterministic, task: WalkingTask, networks: ActorCritic
) -> tuple[Summary, Episode]:
    episode = rollout(task, controller_of(task, networks, deterministic))
    return summary(task, episode), episode


def controller_of(task: WalkingTask, networks: ActorCritic, deterministic: Deterministic) -> Controller:
    """What the networks do when they do not explore, from an observation; the task squashes it."""
    mean_action = networks.actor()
    if deterministic == "clipped-mean":
        return mean_action
    std = jnp.exp(networks.log_std)
    return lambda observation: expected_action(mean_action(observation), std, task.low, task.high)
