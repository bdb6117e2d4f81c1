"""How near to falling a walk comes, in one number: at most zero if and only if the walker falls."""

from __future__ import annotations

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float

from coachable.envs.walking_task import WalkingTask

Controller = Callable[[Float[Array, "4"]], Float[Array, "2"]]


class Endurance(eqx.Module):
    """What a walk came to."""

    margin: Float[Array, ""]
    """In (0, 1) if the walker stayed up, else in [−1, 0]; see `endurance`."""
    time: Float[Array, ""]
    """When it fell, or when the time was over [s]."""
    fell: Bool[Array, ""]


class _Nearest(eqx.Module):
    """The nearest that a walk has come to falling so far."""

    hip: Float[Array, ""]
    pace: Float[Array, ""]
    clearance: Float[Array, ""]
    highest: Float[Array, ""]
    """The highest guard since the last touchdown."""


def endurance(
    task: WalkingTask, controller: Controller, x0: Float[Array, "4"], disturbance: Float[Array, "steps 2"]
) -> Endurance:
    """Walk from x0 and tell how near the walker came to falling.

    Of a walk that ends in a fall the margin is −(1 − t / T), t the time of the fall: earlier is worse. Of any
    other it is h · p · c, each of them the least over time, and positive while the walker is up:

    - h = cos θ1, the height of the hip over the leg's length, zero where it is on the ground;
    - p = 1 / (1 + exp θ̇1), the pace: a half where the walker neither rolls forward nor back. Whoever loses
      his pace before the hip has passed over the foot falls back;
    - c, of every finished step the highest value of the guard sin((θ1 + θ2) / 2), whose fall through zero is
      the touchdown. Where it never rises above zero, the foot comes down nowhere.

    The time of the fall alone would leave a search in the dark: it is the same for all walks that stay up.

    **Arguments:** `task`, whose time is T and whose box of torques must be wide enough for what comes out of
    the controller and the disturbance; `disturbance`, torques added to the controller's in the first control
    steps [N m].
    """
    task = eqx.tree_at(lambda task: task.x0, task, x0)
    one = jnp.ones((), x0.dtype)

    def step(carry):
        state, nearest, _, _, _ = carry
        push = jnp.where(
            state.num_steps < len(disturbance), disturbance.at[state.num_steps].get(mode="clip"), 0
        )
        after, taken = task.step(state, controller(task.observation(state)) + push)
        nearest = _nearer(task, nearest, after.x, after.foot_x != state.foot_x)
        # One that has ended waits at its start for those vmapped beside it: where it fell, each step would
        # search for events in vain, and hold up the others.
        ended = taken.terminated
        state = jax.tree.map(lambda leaf, first: jnp.where(ended, first, leaf), after, task.init())
        return state, nearest, taken.time, taken.fell, ended

    start = (task.init(), _Nearest(one, one, one, 0 * one), 0 * one, jnp.array(False), jnp.array(False))
    _, nearest, time, fell, _ = lax.while_loop(lambda carry: ~carry[-1], step, start)
    up = nearest.hip * nearest.pace * nearest.clearance
    return Endurance(jnp.where(fell, jnp.minimum(time / task.seconds - 1, 0), up), time, fell)


def _nearer(task: WalkingTask, nearest: _Nearest, x: Float[Array, "4"], touched: Bool[Array, ""]) -> _Nearest:
    hip, pace = task.plant.fall_margin(x), jax.nn.sigmoid(-x[2])
    # A step whose guard was above zero between two samples alone leaves no sample that says so.
    finished = jnp.where(touched, jnp.maximum(nearest.highest, jnp.finfo(x.dtype).tiny ** 0.5), 1)
    return _Nearest(
        hip=jnp.minimum(nearest.hip, hip),
        pace=jnp.minimum(nearest.pace, pace),
        clearance=jnp.minimum(nearest.clearance, finished),
        highest=jnp.where(touched, 0, jnp.maximum(nearest.highest, task.plant.guard(x))),
    )
