"""Controllers for any plant that are written down, not learned."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class ConstantTorque(eqx.Module):
    """Hold the same control u, whatever the state."""

    torque: tuple[float, ...] = eqx.field(static=True)

    def __call__(self, x: Float[Array, " state"]) -> Float[Array, " control"]:
        """Return the control."""
        return jnp.asarray(self.torque, x.dtype)


class NoTorque(eqx.Module):
    """Apply no control."""

    size: int = eqx.field(static=True)
    """How many controls the plant has."""

    def __call__(self, x: Float[Array, " state"]) -> Float[Array, " control"]:
        """Return zeros."""
        return jnp.zeros((self.size,), x.dtype)
