"""How long a trained walker stays up, and from how many perturbed starts (C6 of the claims)."""

from __future__ import annotations

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from coachable.envs.walking_task import WalkingTask
from coachable.plants.compass import VirtualGravity
from coachable.plants.integrate import advance

LONG_SECONDS = 100.0
PERTURBED_SECONDS = 10.0
NUM_STARTS = 1000
LARGEST_CHANGE = 0.1
"""Each coordinate of a perturbed start is changed by up to this share of itself."""
_STARTS_AT_ONCE = 40
_SEED = 0

Controller = Callable[[Float[Array, "4"]], Float[Array, "2"]]


def time_up(
    task: WalkingTask, controller: Controller, x0: Float[Array, "4"]
) -> tuple[Float[Array, ""], Bool[Array, ""]]:
    """How long the walker stays up from x0 [s], of the task's `seconds`, and whether it is up at the end."""
    task = eqx.tree_at(lambda task: task.x0, task, x0)
    state = task.init()

    def step(carry):
        state, _, _, _ = carry
        state, timestep = task.step(state, controller(task.observation(state)))
        # One that has ended waits at its start for those vmapped beside it: where it fell, each step would
        # search for events in vain, and hold up the others.
        ended = timestep.terminated
        state = jax.tree.map(lambda leaf, first: jnp.where(ended, first, leaf), state, task.init())
        return state, timestep.time, timestep.fell, ended

    start = (state, jnp.zeros((), x0.dtype), jnp.array(False), jnp.array(False))
    _, time, fell, _ = lax.while_loop(lambda carry: ~carry[3], step, start)
    return time, ~fell


def share_up(task: WalkingTask, controller: Controller, starts: Float[Array, "starts 4"]) -> Float[Array, ""]:
    """Share of the starts from which the walker is still up when the task's `seconds` are over."""
    # Few walkers at once: each touchdown of one of them makes all of them wait.
    up = lax.map(lambda x0: time_up(task, controller, x0)[1], starts, batch_size=_STARTS_AT_ONCE)
    return jnp.mean(up, dtype=starts.dtype)


def perturbed_starts(task: WalkingTask, released: bool) -> Float[np.ndarray, "starts 4"]:
    """States around that of the virtual gravity walker right after its last touchdown within ten seconds.

    x_i (1 + ε_i) with ε_i uniform in ±`LARGEST_CHANGE`; always the same ones. A walker that does not touch
    down, as it may be with other parameters than the paper's, gives states around the task's x0.
    """
    controller = VirtualGravity(task.plant, released=released)

    def step(carry, _):
        x, foot_x, after_impact = carry
        moved = advance(task.plant, x, foot_x, controller(x), task.control_dt)
        touched = (moved.touchdowns > 0) & jnp.isfinite(moved.x).all()
        return (moved.x, moved.foot_x, jnp.where(touched, moved.segment_x, after_impact)), None

    start = (task.x0, jnp.zeros_like(task.x0[0]), task.x0)
    (_, _, after_impact), _ = jax.jit(lambda: lax.scan(step, start, length=task.samples_in_time))()
    changes = np.random.default_rng(_SEED).uniform(-LARGEST_CHANGE, LARGEST_CHANGE, (NUM_STARTS, 4))
    return np.asarray(np.asarray(after_impact) * (1 + changes), task.x0.dtype)
