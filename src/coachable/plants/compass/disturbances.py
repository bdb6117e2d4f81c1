"""What the compass walker is tried with."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.plants.disturbances import Change, Disturbances, Kick

_DIAGONAL = 2**-0.5

DISTURBANCES = Disturbances(
    kicks=tuple(
        Kick(name, (0.0, 0.0, stance, swing), 3.0, "rad/s")
        # Directions in (θ̇1, θ̇2); walking forward means θ̇1 < 0.
        for name, stance, swing in (
            ("stance leg forward", -1.0, 0.0),
            ("stance leg back", 1.0, 0.0),
            ("swing leg forward", 0.0, 1.0),
            ("swing leg back", 0.0, -1.0),
            ("both forward", -_DIAGONAL, _DIAGONAL),
            ("both back", _DIAGONAL, -_DIAGONAL),
            ("legs closing", -_DIAGONAL, -_DIAGONAL),
            ("legs opening", _DIAGONAL, _DIAGONAL),
        )
    ),
    changes=(
        Change("mass up", "mass", 2.0, "of nominal"),
        Change("mass down", "mass", -0.9, "of nominal"),
        Change("length up", "length", 1.0, "of nominal"),
        Change("length down", "length", -0.7, "of nominal"),
        Change("gravity up", "gravity", 2.0, "of nominal"),
        Change("gravity down", "gravity", -0.9, "of nominal"),
        Change("slope up", "slope", 0.3, "rad"),
        Change("slope down", "slope", -0.3, "rad"),
    ),
    nominal={"mass": 1.0, "length": 1.0, "gravity": 1.0, "slope": 0.0},
    section_half_widths=(0.02, 0.1, 0.1),
    control_bound=0.2,
)


def on_slope(x: Float[Array, "4"], slope: Float[Array, ""]) -> Float[Array, "4"]:
    """A state on flat ground with both legs turned by the ground's angle [rad]."""
    return x + slope * jnp.array([1, 1, 0, 0], x.dtype)
