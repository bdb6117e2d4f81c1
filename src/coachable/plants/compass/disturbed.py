"""The compass walker with other masses, lengths and gravity, and on a slope."""

from dataclasses import replace

import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.plants.compass.disturbances import on_slope
from coachable.plants.compass.walker import CompassWalker
from coachable.plants.plant import Dynamics, Event


class DisturbedWalker(Dynamics):
    """A compass walker with all masses, all lengths and gravity multiplied, on ground that may slope.

    With factors μ, λ and γ the inertias are multiplied by μλ² and the weights by μλγ, so that
    θ̈ = M⁻¹ (S u / (μλ²) − C θ̇ − (γ/λ) g(θ)) with the M, C and g of the nominal walker. Its impact stays.
    The ground rises by `slope` [rad] in the walking direction; its angle is taken off the legs' angles where
    the ground matters, and the controller's angles are from upright.
    """

    walker: CompassWalker
    mass: Float[Array, ""]
    length: Float[Array, ""]
    gravity: Float[Array, ""]
    slope: Float[Array, ""]

    def flow(self, x: Float[Array, "4"], control: Float[Array, "2"]) -> Float[Array, "4"]:
        """The walker's under the torque that has the same effect; gravity points down on a slope, too."""
        lightened = (1 - self.gravity / self.length) * self.walker.gravity_torque(x)
        relief = jnp.linalg.solve(self.walker.input_matrix().astype(x.dtype), lightened)
        return self.walker.flow(x, control / (self.mass * self.length**2) + relief)

    @property
    def events(self) -> tuple[Event, ...]:
        """The walker's touchdown, its guard and step along the ground; the impact depends on no slope."""
        (touchdown,) = self.walker.events
        return (
            replace(
                touchdown,
                guard=lambda x: self.walker.guard(self._from_normal(x)),
                displacement=lambda x: self.walker.step_length(self._from_normal(x)),
            ),
        )

    def fall_margin(self, x: Float[Array, "4"]) -> Float[Array, ""]:
        """Zero when the hip is on the ground."""
        return self.walker.fall_margin(self._from_normal(x))

    def _from_normal(self, x: Float[Array, "4"]) -> Float[Array, "4"]:
        return on_slope(x, -self.slope)
