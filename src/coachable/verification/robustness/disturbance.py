"""A closed loop that is not as it was trained: kicked, with other constants, noisy or late."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from coachable.plants.plant import Plant
from coachable.plants.sampled import Clock, Sampling
from coachable.verification.gait.closed_loop import ClosedLoop


class Disturbance(eqx.Module):
    """What is other than nominal; `undisturbed` is nothing."""

    kick: Float[Array, " state"]
    """Added to the state at the start."""
    changes: Mapping[str, Float[Array, ""]]
    """The plant's constants and surroundings, as `Plant.disturbances` names them."""
    noise: Float[Array, ""]
    """Standard deviation of what is added to each held control."""
    delay: Bool[Array, ""]
    """Whether each control is applied one sample late."""


def undisturbed(plant: Plant) -> Disturbance:
    """Everything nominal."""
    nominal = plant.disturbances().nominal
    return Disturbance(
        kick=jnp.zeros(len(plant.state_names)),
        changes={name: jnp.full((), value) for name, value in nominal.items()},
        noise=jnp.zeros(()),
        delay=jnp.zeros((), bool),
    )


def seconds_up(
    loop: ClosedLoop,
    clock: Clock,
    y: Float[Array, " section"],
    disturbance: Disturbance,
    key: PRNGKeyArray,
    seconds: float,
) -> Float[Array, ""]:
    """How long the plant stays up from a point of the section, of so many seconds [s]."""
    x0 = loop.plant.placed(loop.plant.from_section(y), disturbance.changes) + disturbance.kick
    sampling = Sampling(clock, loop.control_dt, chatter=loop.chatter)

    def disturb(wanted, memory, key):
        wanted_before, time = memory
        held = jnp.where(disturbance.delay, wanted_before, wanted)
        noise = disturbance.noise * jax.random.normal(key, wanted.shape, x0.dtype)
        return held + noise, (wanted, time)

    def observe(step, _recall, memory):
        wanted, _ = memory
        return (wanted, step.time), None, step.fell | step.time_is_up(seconds, sampling)

    num_steps = sampling.num_steps(seconds)
    (_, time), _, _ = loop.walk(
        sampling,
        x0,
        observe,
        num_steps,
        memory=(loop.wanted(x0, loop.begun(x0)), jnp.zeros((), y.dtype)),
        inputs=jax.random.split(key, num_steps),
        disturb=disturb,
        dynamics=loop.plant.disturbed(disturbance.changes),
    )
    return time
