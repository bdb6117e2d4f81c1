"""A plant with the controller that drives it, and the same with a meter for the actuators' work."""

from collections.abc import Sequence
from typing import Literal, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.plant import Controller, Dynamics, Event, Plant

Hold = Literal["sampled", "continuous"]

Tree = TypeVar("Tree")


class ClosedLoop(eqx.Module):
    """A plant and the controller that drives it: what a passport is about.

    `hold`: whether the control is sampled every `control_dt` and held, as in training, or follows the
    state continuously. Arrays inside (a policy's weights) are arguments of whatever is compiled, so loops of
    one kind share a program, and stacked ones are vmapped.
    """

    plant: Plant
    controller: Controller
    hold: Hold = eqx.field(static=True, default="sampled")
    control_dt: float = eqx.field(static=True, default=0.01)
    num_substeps: int = eqx.field(static=True, default=4)
    """Runge–Kutta steps in a control step."""
    chatter: ChatterRule = eqx.field(static=True, default=PAPER_CHATTER)
    """Under the free clock; a clock that restarts at touchdown has the paper's rule."""

    @property
    def metered(self) -> "Metered":
        """What is integrated: the plant with a meter for its actuators' work."""
        return Metered(self.plant, self.controller if self.hold == "continuous" else None)

    def metered_control(self, x: Float[Array, " metered"]) -> Float[Array, " control"]:
        """The control that the controller applies in a state of `metered`."""
        return self.controller(x[:-1])


class Metered(Dynamics):
    """A plant with one more coordinate w, last in the state: ẇ = the actuators' power, w their work [J].

    With a `controller` the control follows the state continuously, and what is held does not count. The work
    of a plant that does not define its power stays zero.
    """

    plant: Plant
    controller: Controller | None

    def flow(
        self, x: Float[Array, " metered"], control: Float[Array, " control"]
    ) -> Float[Array, " metered"]:
        """Return ẋ and ẇ."""
        if self.controller is not None:
            control = self.controller(x[:-1])
        power = self.plant.power(x[:-1], control) if has_power(self.plant) else jnp.zeros_like(x[-1])
        return jnp.append(self.plant.flow(x[:-1], control), power)

    @property
    def events(self) -> tuple[Event, ...]:
        """The plant's; the actuators do no work in them."""
        return tuple(_metered(event) for event in self.plant.events)

    def fall_margin(self, x: Float[Array, " metered"]) -> Float[Array, ""]:
        """The plant's."""
        return self.plant.fall_margin(x[:-1])


def _metered(event: Event) -> Event:
    return Event(
        name=event.name,
        guard=lambda x: event.guard(x[:-1]),
        reset=lambda x: jnp.append(event.reset(x[:-1]), x[-1]),
        admissible=lambda x: event.admissible(x[:-1]),
        displacement=lambda x: event.displacement(x[:-1]),
        can_repeat=event.can_repeat,
        restarts_clock=event.restarts_clock,
    )


def has_power(plant: Plant) -> bool:
    """Whether a plant defines its actuators' power and its weight, and so has a cost of transport."""
    return type(plant).power is not Plant.power and type(plant).weight is not Plant.weight


def stacked(loops: Sequence[ClosedLoop]) -> ClosedLoop:
    """Loops of one kind as one whose arrays have a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *loops)


def in_double(tree: Tree) -> Tree:
    """The same with its float arrays in float64, exactly; to be called under `jax.enable_x64(True)`."""

    def widened(leaf):
        return jnp.asarray(leaf, jnp.float64) if eqx.is_inexact_array(leaf) else leaf

    return jax.tree.map(widened, tree)
