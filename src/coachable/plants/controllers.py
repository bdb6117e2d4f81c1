"""Controllers that are written down, not learned: the baselines that a policy is measured against."""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.plants.compass import CompassWalker


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


class ConstantTorque(eqx.Module):
    """Hold the same torques u = (ankle, hip) whatever happens [N m]."""

    torque: tuple[float, float] = eqx.field(static=True)

    def __call__(self, x: Float[Array, "4"]) -> Float[Array, "2"]:
        """Return the torques [N m]."""
        return jnp.asarray(self.torque, x.dtype)


class NoTorque(eqx.Module):
    """Leave the walker to itself."""

    def __call__(self, x: Float[Array, "4"]) -> Float[Array, "2"]:
        """Return zero torques [N m]."""
        return jnp.zeros((2,), x.dtype)
