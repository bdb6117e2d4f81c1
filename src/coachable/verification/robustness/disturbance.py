"""A walker that is not as it was trained: kicked, of other masses and lengths, on a slope, noisy or late."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from coachable.envs.walking_task import Clock
from coachable.plants.compass import CompassWalker
from coachable.plants.event_search import PAPER_CHATTER
from coachable.plants.integrate import advance
from coachable.plants.outcome import Outcome
from coachable.plants.plant import Dynamics, Event
from coachable.verification.gait.section import Loop, state_of


class Disturbance(eqx.Module):
    """What is other than nominal; `undisturbed` is nothing."""

    kick: Float[Array, "2"]
    """Added to (θ̇1, θ̇2) at the start [rad/s]."""
    mass: Float[Array, ""]
    """Factor on all masses."""
    length: Float[Array, ""]
    """Factor on all lengths of the legs."""
    gravity: Float[Array, ""]
    """Factor on gravity."""
    slope: Float[Array, ""]
    """The ground rises so much in the walking direction [rad]; the controller sees angles from upright."""
    noise: Float[Array, ""]
    """Standard deviation of what is added to each held torque [N m]."""
    delay: Bool[Array, ""]
    """Whether each torque is applied one sample late."""


def undisturbed() -> Disturbance:
    """All as it was."""
    zero, one = jnp.zeros(()), jnp.ones(())
    return Disturbance(jnp.zeros(2), one, one, one, zero, zero, jnp.zeros((), bool))


class OtherWalker(Dynamics):
    """A compass walker with all masses, all lengths and gravity multiplied, on ground that may slope.

    With factors μ, λ and γ the inertias are multiplied by μλ² and the weights by μλγ, so that
    θ̈ = M⁻¹ (S u / (μλ²) − C θ̇ − (γ/λ) g(θ)) with the M, C and g of the walker as it was. Its impact stays.
    The ground's angle is taken off the legs' angles where the ground matters.
    """

    walker: CompassWalker
    disturbance: Disturbance

    def flow(self, x: Float[Array, "4"], control: Float[Array, "2"]) -> Float[Array, "4"]:
        """The walker's under the torque that has the same effect; gravity points down on a slope, too."""
        d = self.disturbance
        lightened = (1 - d.gravity / d.length) * self.walker.gravity_torque(x)
        relief = jnp.linalg.solve(self.walker.input_matrix().astype(x.dtype), lightened)
        return self.walker.flow(x, control / (d.mass * d.length**2) + relief)

    @property
    def events(self) -> tuple[Event, ...]:
        """The walker's, with angles from the ground's normal in the guard and the step's length."""

        def sloped(event: Event) -> Event:
            return replace(
                event,
                guard=lambda x: event.guard(self._from_normal(x)),
                displacement=lambda x: event.displacement(self._from_normal(x)),
            )

        return tuple(map(sloped, self.walker.events))

    def fall_margin(self, x: Float[Array, "4"]) -> Float[Array, ""]:
        """Zero when the hip is on the ground."""
        return self.walker.fall_margin(self._from_normal(x))

    def _from_normal(self, x: Float[Array, "4"]) -> Float[Array, "4"]:
        return x - self.disturbance.slope * jnp.array([1, 1, 0, 0], x.dtype)


def seconds_up(
    loop: Loop,
    clock: Clock,
    y: Float[Array, "3"],
    disturbance: Disturbance,
    key: PRNGKeyArray,
    seconds: float,
) -> Float[Array, ""]:
    """How long the walker stays up from a point of the section, of so many seconds [s]."""
    plant = OtherWalker(loop.plant, disturbance)
    restarts = clock == "touchdown"
    upright, kick = jnp.zeros(2, y.dtype), disturbance.kick
    x0 = state_of(y) + jnp.concatenate([upright + disturbance.slope, kick])
    zero, count = jnp.zeros((), y.dtype), jnp.zeros((), jnp.int32)
    num_steps = round(seconds / loop.control_dt * (1.1 if restarts else 1))

    def step(now, key):
        x, time, wanted_before, in_a_row, over = now
        # Behind its end a walk is begun anew, unseen.
        begin = jnp.where(over, x0, x)
        wanted = loop.control(begin)
        control = jnp.where(disturbance.delay, wanted_before, wanted)
        moved = advance(
            plant,
            begin,
            zero,
            control + disturbance.noise * jax.random.normal(key, (2,), x.dtype),
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

    begin = (x0, zero, loop.control(x0), count, jnp.zeros((), bool))
    (_, time, _, _, _), _ = lax.scan(step, begin, jax.random.split(key, num_steps))
    return time
