"""Walkers that are known to walk, and to fall."""

import jax.numpy as jnp
import numpy as np

from coachable.learning.policy import Policy
from coachable.plants.compass import STATE_NAMES
from coachable.verification.falsification.perturbation import SectionBox

TORQUE = (-1.35, -0.18)
"""A constant torque that walks [N m]."""
CENTRE, HALF_WIDTHS = (0.327, -1.1905, -0.0485), (0.01, 0.03, 0.03)
"""Around where it touches down; from all of this box it walks."""


def box():
    """Starts from which the steady policy walks."""
    return SectionBox(HALF_WIDTHS, CENTRE)


def steady():
    """A policy that asks for the constant torque, whatever happens."""
    return switched(jnp.zeros(4), 0.0, 0.0)


def trapped():
    """The same, but in the corner (+, −, −) of the box it kicks itself over.

    In the box's coordinates z it does so from about 3 z₁ − z₂ − z₃ = 4.4 on, 5 being the corner itself, in
    0.2 % of the box.
    """
    side = np.array([3, -1, -1]) / np.array(HALF_WIDTHS)
    weight = np.array([side[0] / 2, -side[0] / 2, side[1], side[2]])
    return switched(1.5 * jnp.array(weight), float(-1.5 * (side @ np.array(CENTRE) + 4.4)), 600.0)


def switched(weight, bias, kick):
    """A policy of one hidden unit, which adds a kick to the ankle's torque where it is on."""
    return Policy(
        weights=(weight[None].astype(jnp.float32), jnp.array([[kick / 2], [0.0]])),
        biases=(jnp.array([bias]), jnp.array([TORQUE[0] + kick / 2, TORQUE[1]])),
        low=jnp.array([-2000.0, -2000.0]),
        high=jnp.array([2000.0, 2000.0]),
        observation_names=STATE_NAMES,
    )
