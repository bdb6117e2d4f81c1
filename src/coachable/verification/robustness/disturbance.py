"""A closed loop that is not as it was trained: kicked, with other constants, noisy or late."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from coachable.envs.walking_task import Clock
from coachable.plants.event_search import PAPER_CHATTER
from coachable.plants.integrate import advance
from coachable.plants.outcome import Outcome
from coachable.plants.plant import Plant
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
    plant = loop.plant.disturbed(disturbance.changes)
    restarts = clock == "touchdown"
    x0 = loop.plant.placed(loop.plant.from_section(y), disturbance.changes) + disturbance.kick
    zero, count = jnp.zeros((), y.dtype), jnp.zeros((), jnp.int32)
    num_steps = round(seconds / loop.control_dt * (1.1 if restarts else 1))

    def step(now, key):
        x, time, wanted_before, in_a_row, over = now
        # Behind its end a walk is begun anew, unseen.
        begin = jnp.where(over, x0, x)
        wanted = loop.controller(begin)
        control = jnp.where(disturbance.delay, wanted_before, wanted)
        moved = advance(
            plant,
            begin,
            zero,
            control + disturbance.noise * jax.random.normal(key, wanted.shape, x.dtype),
            loop.control_dt,
            stop_at_touchdown=restarts,
            touchdowns_before=in_a_row if restarts else 0,
            chatter=PAPER_CHATTER if restarts else loop.chatter,
        )
        cut = (moved.touchdowns > 0) & restarts
        fell = moved.outcome != Outcome.WALKING
        time = jnp.where(over, time, time + moved.elapsed)
        in_a_row = jnp.where(cut, in_a_row + moved.touchdowns, 0)
        return (moved.x, time, wanted, in_a_row, over | fell | (time >= seconds)), None

    begin = (x0, zero, loop.controller(x0), count, jnp.zeros((), bool))
    (_, time, _, _, _), _ = lax.scan(step, begin, jax.random.split(key, num_steps))
    return time
