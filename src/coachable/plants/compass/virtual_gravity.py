"""Virtual gravity: the controller that walks on the flat as a passive walker does down a slope."""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.plants.compass.walker import CompassWalker


class VirtualGravity(eqx.Module):
    """Walk on the flat as if down a slope φ: S u = [(m_H l + m (a + l)) cos θ₁, −m b cos θ₂]ᵀ g tan φ.

    Asano, Luo and Yamakita, *Biped gait generation and control based on a unified property of passive dynamic
    walking*, IEEE Transactions on Robotics, 2005. A negative slope [rad] goes downhill in the forward
    direction. With `released` the swing term reads cos θ̇₁ for cos θ₂, as the code released with Harnack et
    al. does.
    """

    plant: CompassWalker
    slope: float = eqx.field(static=True, default=-0.07)
    released: bool = eqx.field(static=True, default=False)

    def __call__(self, x: Float[Array, "4"]) -> Float[Array, "2"]:
        """Return the torques u = (ankle, hip) at state x [N m]."""
        p = self.plant.parameters
        theta_1, theta_2, dtheta_1, _ = x
        pull = math.tan(self.slope)
        hip = p.swing_weight * pull * jnp.cos(dtheta_1 if self.released else theta_2)
        return jnp.stack([p.stance_weight * pull * jnp.cos(theta_1) - hip, hip])
