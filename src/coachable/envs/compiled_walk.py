"""The walking task compiled, for one walker or many, and its infos after a step or a reset.

All is in float32, whatever JAX's default is. A program is compiled once for all tasks of a kind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial, wraps
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from coachable.envs.task import Timestep
from coachable.envs.walking_task import WalkingState, WalkingTask
from coachable.rewards.setup import TERM_NAMES

Facts = dict[str, np.ndarray]
"""Phase, hip_x, foot_x, time, fell and terms of a walker, or of many along the first axis."""


def in_single_precision(function: Callable) -> Callable:
    """The function compiled, its numbers in float32 also where a user has switched to float64."""
    compiled = jax.jit(function)

    @wraps(function)
    def call(*arguments):
        with jax.enable_x64(False):
            return compiled(*arguments)

    return call


@in_single_precision
def begin_run(task: WalkingTask, x0: Float[Array, " state"]) -> tuple[WalkingState, Int[Array, ""]]:
    """The state of a run that starts at x0, and its location."""
    return _at(task, x0).init(), task.locate(x0)


@in_single_precision
def begin_episode(
    task: WalkingTask, x0: Float[Array, " state"], state: WalkingState
) -> tuple[WalkingState, Int[Array, ""]]:
    """The state of the run's next episode, which starts at x0, and its location."""
    return _at(task, x0).reset(state), task.locate(x0)


@in_single_precision
def step(
    task: WalkingTask, state: WalkingState, action: Float[Array, " control"]
) -> tuple[WalkingState, Timestep]:
    """One control step of a walker."""
    return task.step(state, action)


@in_single_precision
def begin_some(
    task: WalkingTask,
    x0: Float[Array, "walkers state"],
    states: WalkingState,
    chosen: Bool[Array, " walkers"],
    anew: Bool[Array, " walkers"],
) -> tuple[WalkingState, Int[Array, " walkers"]]:
    """The chosen walkers begin: a run if `anew`, the next episode of theirs if not. The others stay."""

    @jax.vmap
    def begin(x0, state, chosen, anew):
        there = _at(task, x0)
        begun = _select(anew, there.init(), there.reset(state))
        return _select(chosen, begun, state), task.locate(x0)

    return begin(x0, states, chosen, anew)


@in_single_precision
def step_all(
    task: WalkingTask,
    states: WalkingState,
    actions: Float[Array, "walkers control"],
    waiting: Bool[Array, " walkers"],
) -> tuple[WalkingState, Timestep]:
    """One control step of every walker; those that wait do not move, and their timestep means nothing."""
    after, timesteps = jax.vmap(task.step)(states, actions)
    return jax.vmap(_select)(waiting, states, after), timesteps


def start_observation(task: WalkingTask, states: WalkingState) -> Float[np.ndarray, "*walkers observation"]:
    """What is observed of walkers that have begun an episode: one, or many along the first axis."""
    if task.observe == "nothing":
        return np.array(states.observation)
    return np.array(_observations(task, states) if states.hip_x.ndim else _observation(task, states))


_observation = in_single_precision(lambda task, state: task.observation(state))
_observations = in_single_precision(lambda task, states: jax.vmap(task.observation)(states))


def facts_of_step(timestep: Timestep) -> Facts:
    """The info after a step, in arrays of its own."""
    names = ("phase", "hip_x", "foot_x", "time", "fell", "terms")
    return {name: np.array(getattr(timestep, name)) for name in names}


def facts_of_start(state: WalkingState, phase: Int[Array, "*walkers"]) -> Facts:
    """The info before the first step of an episode."""
    hip_x = np.array(state.hip_x)
    return {
        "phase": np.array(phase),
        "hip_x": hip_x,
        "foot_x": np.array(state.walk.foot_x),
        "time": np.zeros_like(hip_x),
        "fell": np.zeros(hip_x.shape, bool),
        "terms": np.zeros((*hip_x.shape, len(TERM_NAMES)), hip_x.dtype),
    }


def info_of(facts: Mapping[str, np.ndarray], weights: Float[np.ndarray, "5"]) -> dict[str, Any]:
    """The facts as a Gymnasium info: Python numbers for one walker, arrays for many, terms by name."""
    rewards = weights * facts["terms"] + 0.0  # no −0
    info: dict[str, Any] = {name: _plain(values) for name, values in facts.items() if name != "terms"}
    for key, values in (("terms", facts["terms"]), ("rewards", rewards)):
        info[key] = {name: _plain(values[..., index]) for index, name in enumerate(TERM_NAMES)}
    return info


_WIDE = {"f": np.float64, "i": np.int64, "b": np.bool_}


def _plain(values: np.ndarray) -> Any:
    """A Python number, or an array with the dtype that NumPy gives to Python numbers, as Gymnasium has it."""
    return values.item() if values.ndim == 0 else values.astype(_WIDE[values.dtype.kind])


def _at(task: WalkingTask, x0: Float[Array, " state"]) -> WalkingTask:
    return eqx.tree_at(lambda task: task.x0, task, x0)


def _select(which: Bool[Array, ""], one: WalkingState, other: WalkingState) -> WalkingState:
    return jax.tree.map(partial(jnp.where, which), one, other)
