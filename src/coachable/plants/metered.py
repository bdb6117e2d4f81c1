"""A plant with a meter for its actuators' work."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.plants.plant import Controller, Dynamics, Event, Plant


class Metered(Dynamics):
    """A plant with one more coordinate w, last in the state: ẇ = the actuators' power, w their work [J].

    With a `controller` the control follows the state continuously, and what is held does not count. The work
    of a plant that does not define its power stays zero.
    """

    plant: Plant
    controller: Controller | None = None

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
