"""The touchdown section and the return map on it, with a sample clock that restarts at touchdown."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.plants.plant import Plant
from coachable.plants.runge_kutta import rk4
from coachable.plants.sampled import Sampling
from coachable.verification.gait.closed_loop import ClosedLoop, Recall

LONGEST_STRIDE = 300
"""A plant that does not touch down within so many control steps takes no further step."""


class Stride(eqx.Module):
    """What happened from a state to the next touchdown."""

    y: Float[Array, " point"]
    """The `ClosedLoop.point` right after the impact: of a state feedback, a point of the section."""
    time: Float[Array, ""]
    """How long it took [s]."""
    length: Float[Array, ""]
    """From the old stance foot to the new one [m]."""
    work: Float[Array, ""]
    """The actuators' work, braking counted as driving [J]."""
    landed: Bool[Array, ""]
    """Whether there was a touchdown on the section at all, before a fall and within `LONGEST_STRIDE`."""
    last_sample: Float[Array, ""]
    """How long the last sample was held at the touchdown [s]."""
    num_samples: Int[Array, ""]
    """How many samples were taken."""


def states_at(plant: Plant, points: Float[np.ndarray, "points section"]) -> Float[np.ndarray, "points state"]:
    """The states at points of the section, in float64."""
    with jax.enable_x64(True):
        return np.asarray(jax.vmap(plant.from_section)(jnp.asarray(points, jnp.float64)))


def stride(loop: ClosedLoop, x: Float[Array, " state"], recall: Recall) -> Stride:
    """Walk from a state to right after the next touchdown, the clock starting at 0."""
    sampling = Sampling("touchdown", loop.control_dt, loop.num_substeps)

    def observe(step, recall, samples):
        samples = samples + 1
        return samples, (step, recall), step.touched | step.fell | (samples >= LONGEST_STRIDE)

    start, count = jnp.append(x, jnp.zeros((), x.dtype)), jnp.zeros((), jnp.int32)
    samples, (last, recall), _ = loop.walk(
        sampling, start, observe, None, recall=recall, memory=count, dynamics=loop.metered
    )
    x, work = last.moved.x[:-1], last.moved.x[-1]
    return Stride(
        y=loop.point(x, recall),
        time=last.time,
        length=last.moved.foot_x,
        work=work,
        landed=last.touched & ~last.fell & loop.plant.on_section(x),
        last_sample=last.moved.elapsed,
        num_samples=samples,
    )


def linearised(
    loop: ClosedLoop, y: Float[Array, " point"], refinement: Int[Array, ""] | int = 1
) -> tuple[Stride, Float[Array, "point point"]]:
    """A stride from a point of the return map and DP(y), by autodiff through the touchdown and the impact.

    The stride is taken once to learn when the foot comes down, then replayed on fixed steps up to that time
    τ, which counts as a constant but for one differentiated Newton step τ − g / ġ: so the derivative holds
    the saltation. It is NaN where there is no touchdown.

    Arguments: refinement, into how many each of the replay's integration steps is cut, 1 or 2.
    """
    taken = stride(loop, *loop.at_point(y))
    touchdown, *others = loop.plant.events
    if others:
        # The fixed steps of the replay would pass the other events by.
        finer = replace(loop, num_substeps=2 * loop.num_substeps)
        jacobian = lax.cond(
            jnp.asarray(refinement) == 1, lambda y: _through_all(loop, y), lambda y: _through_all(finer, y), y
        )
        return taken, jnp.where(taken.landed, jacobian, jnp.nan)
    num_substeps = loop.num_substeps * refinement

    def replayed(y):
        x, recall = lax.fori_loop(0, taken.num_samples - 1, lambda _, now: held(*now), loop.at_point(y))
        control = loop.wanted(x, recall)
        end = run(x, control, taken.last_sample)
        velocity = lax.stop_gradient(flow(end, control))
        guard, slope = jax.jvp(touchdown.guard, (end,), (velocity,))
        tau = taken.last_sample - guard / lax.stop_gradient(slope)
        landed = touchdown.reset(run(x, control, tau))
        return loop.point(landed, loop.after(recall, landed, tau))

    def held(x, recall):
        dt = jnp.asarray(loop.control_dt, x.dtype)
        x = run(x, loop.wanted(x, recall), dt)
        return x, loop.after(recall, x, dt)

    def run(x, control, duration):
        h = duration / num_substeps
        return lax.fori_loop(0, num_substeps, lambda _, x: rk4(flow, x, control, h), x)

    def flow(x, control):
        return loop.plant.flow(x, loop.controller(x) if loop.hold == "continuous" else control)

    jacobian = jax.jacfwd(replayed)(y)
    return taken, jnp.where(taken.landed, jacobian, jnp.nan)


def _through_all(loop: ClosedLoop, y: Float[Array, " point"]) -> Float[Array, "point point"]:
    """DP(y) by forward differentiation of the stride itself, through every event that it passes."""
    return jax.jacfwd(lambda y: stride(loop, *loop.at_point(y)).y)(y)
