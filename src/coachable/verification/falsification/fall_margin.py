"""How near to falling a walk comes, in one number: at most zero if and only if the plant falls."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import Clock, Sampling
from coachable.verification.gait.closed_loop import ClosedLoop


class Endurance(eqx.Module):
    """How a walk ended, and how near to falling it came."""

    margin: Float[Array, ""]
    """In (0, 1) if the plant stayed up, else in [−1, 0]; see `endurance`."""
    time: Float[Array, ""]
    """When it fell, or when the time was over [s]."""
    fell: Bool[Array, ""]


class _Nearest(eqx.Module):
    """The nearest that a walk has come to falling so far."""

    height: Float[Array, ""]
    pace: Float[Array, ""]
    clearance: Float[Array, ""]
    highest: Float[Array, ""]
    """The highest guard since the last touchdown."""


def endurance(
    plant: Plant,
    controller: Controller,
    x0: Float[Array, " state"],
    disturbance: Float[Array, "steps control"],
    clock: Clock,
    seconds: float,
) -> Endurance:
    """Walk from x0 and measure how near the plant comes to falling.

    Of a walk that ends in a fall the margin is −(1 − t / T), t the time of the fall: earlier is worse. Of any
    other it is h · p · c, each of them the least over time, and positive while the plant is up:

    - h, the plant's fall margin;
    - p, its pace, a half where it stands: without pace a walker falls back;
    - c, of every finished step the highest value of the touchdown's guard, whose fall through zero is the
      touchdown. Where it never rises above zero, the foot comes down nowhere. A plant without events has 1.

    The time of the fall alone would leave a search in the dark: it is the same for all walks that stay up.

    **Arguments:** `disturbance`, added to the controller's controls in the first control steps; `seconds`, T.
    """
    sampling = Sampling(clock)
    one, count = jnp.ones((), x0.dtype), jnp.zeros((), jnp.int32)

    def disturb(wanted, memory, _):
        steps, _ = memory
        push = jnp.where(steps < len(disturbance), disturbance.at[steps].get(mode="clip"), 0)
        return wanted + push, memory

    def observe(step, _recall, memory):
        steps, nearest = memory
        nearest = _nearer(plant, nearest, step.moved.x, step.touched)
        ended = step.fell | step.time_is_up(seconds, sampling)
        return (steps + 1, nearest), (step.time, step.fell), ended

    memory = (count, _Nearest(one, one, one, 0 * one))
    (_, nearest), (time, fell), _ = ClosedLoop(plant, controller).walk(
        sampling, x0, observe, None, memory=memory, disturb=disturb
    )
    up = nearest.height * nearest.pace * nearest.clearance
    return Endurance(jnp.where(fell, jnp.minimum(time / seconds - 1, 0), up), time, fell)


def _nearer(plant: Plant, nearest: _Nearest, x: Float[Array, " state"], touched: Bool[Array, ""]) -> _Nearest:
    guard = plant.events[0].guard(x) if plant.events else jnp.ones_like(x[0])
    # A step whose guard was above zero between two samples alone leaves no sample that shows it.
    finished = jnp.where(touched, jnp.maximum(nearest.highest, jnp.finfo(x.dtype).tiny ** 0.5), 1)
    return _Nearest(
        height=jnp.minimum(nearest.height, plant.fall_margin(x)),
        pace=jnp.minimum(nearest.pace, plant.pace(x)),
        clearance=jnp.minimum(nearest.clearance, finished),
        highest=jnp.where(touched, 0, jnp.maximum(nearest.highest, guard)),
    )
