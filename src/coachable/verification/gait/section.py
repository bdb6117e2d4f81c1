"""The touchdown section and the return map on it, with a sample clock that restarts at touchdown."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.plants.compass import CompassWalker
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.integrate import advance
from coachable.plants.outcome import Outcome
from coachable.plants.plant import Dynamics, Event
from coachable.plants.runge_kutta import rk4

Controller = Callable[[Float[Array, "4"]], Float[Array, "2"]]
Hold = Literal["sampled", "continuous"]

SECTION_NAMES = ("beta", "dtheta_1", "dtheta_2")
"""Coordinates on the section: half the angle between the legs [rad], the legs' velocities [rad/s]."""

LONGEST_STRIDE = 300
"""A walker that does not touch down within so many control steps takes no further step."""

Tree = TypeVar("Tree")


class Loop(eqx.Module):
    """A walker and the controller that drives it: the closed loop that a passport is about.

    `hold` says whether the torque is sampled every `control_dt` and held, as in training, or follows the
    state continuously. Arrays inside (a policy's weights) are arguments of whatever is compiled, so loops of
    one kind share a program, and stacked ones are vmapped.
    """

    plant: CompassWalker
    controller: Controller
    hold: Hold = eqx.field(static=True, default="sampled")
    control_dt: float = eqx.field(static=True, default=0.01)
    num_substeps: int = eqx.field(static=True, default=4)
    """Runge–Kutta steps in a control step."""
    chatter: ChatterRule = eqx.field(static=True, default=PAPER_CHATTER)
    """Under the free clock; a clock that restarts at touchdown has the paper's rule."""

    def control(self, x: Float[Array, " state"]) -> Float[Array, "2"]:
        """The torques (ankle, hip) that the controller asks for in a state [N m]."""
        return self.controller(x[:4])

    @property
    def metered(self) -> "Metered":
        """What is integrated: the plant with a meter for its joints' work."""
        return Metered(self.plant, self.controller if self.hold == "continuous" else None)


class Metered(Dynamics):
    """The compass walker with a fifth coordinate w: ẇ = |u₁ θ̇₁| + |u₂ (θ̇₁ − θ̇₂)|, its joints' work [J].

    With a `controller` the torque follows the state continuously, and what is held does not count.
    """

    plant: CompassWalker
    controller: Controller | None

    def flow(self, x: Float[Array, "5"], control: Float[Array, "2"]) -> Float[Array, "5"]:
        """Return ẋ and ẇ."""
        torque = control if self.controller is None else self.controller(x[:4])
        ankle, hip = torque
        _, _, dtheta_1, dtheta_2, _ = x
        power = jnp.abs(ankle * dtheta_1) + jnp.abs(hip * (dtheta_1 - dtheta_2))
        return jnp.append(self.plant.flow(x[:4], torque), power)

    @property
    def events(self) -> tuple[Event, ...]:
        """The plant's; an impact costs the joints no work."""

        def metered(event: Event) -> Event:
            return replace(
                event,
                guard=lambda x: event.guard(x[:4]),
                admissible=lambda x: event.admissible(x[:4]),
                reset=lambda x: jnp.append(event.reset(x[:4]), x[4]),
                displacement=lambda x: event.displacement(x[:4]),
            )

        return tuple(map(metered, self.plant.events))

    def fall_margin(self, x: Float[Array, "5"]) -> Float[Array, ""]:
        """The plant's."""
        return self.plant.fall_margin(x[:4])


class Stride(eqx.Module):
    """What happened from a state to the next touchdown."""

    y: Float[Array, "3"]
    """Where on the section the walker is right after the impact."""
    time: Float[Array, ""]
    """How long it took [s]."""
    length: Float[Array, ""]
    """From the old stance foot to the new one [m]."""
    work: Float[Array, ""]
    """What the joints did, braking counted as driving [J]."""
    landed: Bool[Array, ""]
    """Whether there was a touchdown on the section at all, before a fall and within `LONGEST_STRIDE`."""
    last_sample: Float[Array, ""]
    """How long the last sample was held when the foot came down [s]."""
    num_samples: Int[Array, ""]
    """How many samples were taken."""


def state_of(y: Float[Array, "3"]) -> Float[Array, "4"]:
    """The state at a point of the section: θ₁ = β, θ₂ = −β, both feet on the ground."""
    beta, dtheta_1, dtheta_2 = y
    return jnp.stack([beta, -beta, dtheta_1, dtheta_2])


def section_point(x: Float[Array, " state"]) -> Float[Array, "3"]:
    """The point of the section that a state right after an impact is at: β = (θ₁ − θ₂) / 2."""
    return jnp.stack([(x[0] - x[1]) / 2, x[2], x[3]])


def stride(loop: Loop, x: Float[Array, "4"]) -> Stride:
    """Walk from a state to right after the next touchdown, the clock starting at 0."""
    metered = loop.metered
    zero, no = jnp.zeros((), x.dtype), jnp.zeros((), bool)

    def step(now):
        x, foot_x, _, samples, _, _ = now
        control = loop.control(x) if loop.hold == "sampled" else jnp.zeros((2,), x.dtype)
        moved = advance(
            metered,
            x,
            foot_x,
            control,
            loop.control_dt,
            num_substeps=loop.num_substeps,
            stop_at_touchdown=True,
        )
        return (
            moved.x,
            moved.foot_x,
            moved.elapsed,
            samples + 1,
            moved.touchdowns > 0,
            moved.outcome != Outcome.WALKING,
        )

    def goes_on(now):
        _, _, _, samples, touched, failed = now
        return ~touched & ~failed & (samples < LONGEST_STRIDE)

    begin = (jnp.append(x, zero), zero, zero, jnp.zeros((), jnp.int32), no, no)
    x, foot_x, last, samples, touched, failed = lax.while_loop(goes_on, step, begin)
    on_section = jnp.abs(x[0] + x[1]) <= jnp.finfo(x.dtype).eps ** 0.5
    return Stride(
        y=section_point(x),
        time=(samples - 1).astype(x.dtype) * loop.control_dt + last,
        length=foot_x,
        work=x[4],
        landed=touched & ~failed & on_section & (x[0] > 0),
        last_sample=last,
        num_samples=samples,
    )


def return_map(loop: Loop, y: Float[Array, "3"]) -> Float[Array, "3"]:
    """P(y): from right after one touchdown to right after the next; NaN if there is none."""
    taken = stride(loop, state_of(y))
    return jnp.where(taken.landed, taken.y, jnp.nan)


def linearised(
    loop: Loop, y: Float[Array, "3"], refinement: Int[Array, ""] | int = 1
) -> tuple[Stride, Float[Array, "3 3"]]:
    """A stride from a point of the section and DP(y), by autodiff through the touchdown and the impact.

    The stride is taken once to learn when the foot comes down, then replayed on fixed steps up to that time
    τ, which counts as a constant but for one differentiated Newton step τ − g / ġ: so the derivative holds
    the saltation. It is NaN where there is no touchdown.

    Arguments: refinement, into how many each of the replay's integration steps is cut.
    """
    taken = stride(loop, state_of(y))
    num_substeps = loop.num_substeps * refinement

    def replayed(y):
        x = lax.fori_loop(0, taken.num_samples - 1, lambda _, x: held(x), state_of(y))
        control = loop.control(x)
        end = run(x, control, taken.last_sample)
        velocity = lax.stop_gradient(flow(end, control))
        guard, slope = jax.jvp(loop.plant.guard, (end,), (velocity,))
        tau = taken.last_sample - guard / lax.stop_gradient(slope)
        return section_point(loop.plant.impact(run(x, control, tau)))

    def held(x):
        return run(x, loop.control(x), jnp.asarray(loop.control_dt, x.dtype))

    def run(x, control, duration):
        h = duration / num_substeps
        return lax.fori_loop(0, num_substeps, lambda _, x: rk4(flow, x, control, h), x)

    def flow(x, control):
        return loop.plant.flow(x, loop.control(x) if loop.hold == "continuous" else control)

    jacobian = jax.jacfwd(replayed)(y)
    return taken, jnp.where(taken.landed, jacobian, jnp.nan)


def in_double(tree: Tree) -> Tree:
    """The same with its float arrays in float64, exactly; to be called under `jax.enable_x64(True)`."""

    def widened(leaf):
        return jnp.asarray(leaf, jnp.float64) if eqx.is_inexact_array(leaf) else leaf

    return jax.tree.map(widened, tree)
