"""Virtual gravity: the controller that walks on the flat as a passive walker does down a slope."""

import math
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.plants.compass.restated import virtual_gravity
from coachable.plants.compass.walker import CompassWalker
from coachable.plants.equations import Definitions, decimal


class VirtualGravity(eqx.Module):
    """Walk on the flat as if down a slope φ: S u = [(m_H l + m (a + l)) cos θ₁, −m b cos θ₂]ᵀ g tan φ.

    Asano, Luo and Yamakita, *Biped gait generation and control based on a unified property of passive dynamic
    walking*, IEEE Transactions on Robotics, 2005. A negative slope [rad] goes downhill in the forward
    direction. With `released` the swing term reads cos θ̇₁ for cos θ₂, as the code released with Harnack et
    al. does.

    **Raises:** `ParameterError` for a slope that is not a number from −1.57 to 1.57.
    """

    plant: CompassWalker
    slope: float = eqx.field(static=True, default=-0.07)
    released: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        real_number(self.slope, "slope", ParameterError, least=-1.57, most=1.57)

    def __call__(self, x: Float[Array, "4"]) -> Float[Array, "2"]:
        """Return the torques u = (ankle, hip) at state x [N m]."""
        p = self.plant.parameters
        theta_1, theta_2, dtheta_1, _ = x
        pull = math.tan(self.slope)
        hip = p.swing_weight * pull * jnp.cos(dtheta_1 if self.released else theta_2)
        return jnp.stack([p.stance_weight * pull * jnp.cos(theta_1) - hip, hip])

    def formulas(self) -> Definitions:
        """The torques as text, `torque_1` at the ankle and `torque_2` at the hip [N m]."""
        leg_angle = "dtheta_1" if self.released else "theta_2"
        return {
            "pull": f"sin({decimal(self.slope)}) / cos({decimal(self.slope)})",
            "torque_2": f"weight_2 * pull * cos({leg_angle})",
            "torque_1": "weight_1 * pull * cos(theta_1) - torque_2",
        }

    def restated(self) -> Callable[[np.ndarray], np.ndarray]:
        """The torques written down a second time, in NumPy."""
        return virtual_gravity(self.plant.parameters, self.slope, self.released)
