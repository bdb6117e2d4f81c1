"""How long a trained walker stays up, and from how many perturbed starts (C6 of the claims)."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from coachable.envs.walking_task import WalkingState, WalkingTask
from coachable.plants.plant import Controller
from coachable.plants.sampled import SampledStep, Sampling, sampled_walk, undisturbed, walk_unrecorded

LONG_SECONDS = 100.0
PERTURBED_SECONDS = 10.0
NUM_STARTS = 1000
LARGEST_CHANGE = 0.1
"""Each coordinate of a perturbed start is changed by up to this share of itself."""
_STARTS_AT_ONCE = 40
_SEED = 0


def time_up(
    task: WalkingTask, controller: Controller, x0: Float[Array, " state"]
) -> tuple[Float[Array, ""], Bool[Array, ""]]:
    """How long the walker stays up from x0 [s], of the task's `seconds`, and whether it is up at the end."""
    task = eqx.tree_at(lambda task: task.x0, task, x0)

    def step(state: WalkingState, _: None) -> tuple[WalkingState, tuple[Array, Array], Array]:
        state, timestep = task.step(state, controller(task.observation(state)))
        return state, (timestep.time, timestep.fell), timestep.terminated | timestep.truncated

    _, (time, fell) = walk_unrecorded(step, task.init())
    return time, ~fell


def share_up(
    task: WalkingTask, controller: Controller, starts: Float[Array, "starts state"]
) -> Float[Array, ""]:
    """Share of the starts from which the walker is still up when the task's `seconds` are over."""
    # Few walkers at once: each touchdown of one of them makes all of them wait.
    up = lax.map(lambda x0: time_up(task, controller, x0)[1], starts, batch_size=_STARTS_AT_ONCE)
    return jnp.mean(up, dtype=starts.dtype)


def perturbed_starts(task: WalkingTask) -> Float[np.ndarray, "starts state"]:
    """States around that right after the last touchdown of an episode under the plant's baseline controller.

    x_i (1 + ε_i) with ε_i uniform in ±`LARGEST_CHANGE`; always the same ones. A controller under which the
    plant does not touch down, as may be with other parameters, gives states around the task's x0. The clock
    is free, and chatter ends nothing.
    """
    controller = next(iter(task.plant.controllers().values()))

    def observe(step: SampledStep, after_impact: Array) -> tuple[Array, None, Array]:
        touched = step.touched & jnp.isfinite(step.moved.x).all()
        return jnp.where(touched, step.moved.segment_x, after_impact), None, jnp.array(False)

    def walk() -> Array:
        return sampled_walk(
            task.plant,
            Sampling(control_dt=task.control_dt),
            undisturbed(controller),
            task.x0,
            observe,
            task.samples_in_time,
            memory=task.x0,
        )[0]

    after_impact = np.asarray(jax.jit(walk)())
    shape = (NUM_STARTS, after_impact.size)
    changes = np.random.default_rng(_SEED).uniform(-LARGEST_CHANGE, LARGEST_CHANGE, shape)
    return np.asarray(after_impact * (1 + changes), task.x0.dtype)
