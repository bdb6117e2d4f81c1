"""Models to export: bare, of the virtual gravity walker, and of a small learned policy."""

import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours.library import load_behaviour
from coachable.learning.policy import Policy
from coachable.plants.compass import STATE_NAMES, CompassWalker, VirtualGravity
from coachable.verification.export.model import Model


@pytest.fixture(scope="session")
def policy():
    """A network that has learned nothing, but asks for about the constant torque that walks."""
    draw = np.random.default_rng(3).standard_normal
    sizes = ((8, 4, 0.4), (8, 8, 0.4), (2, 8, 0.02))
    return Policy(
        weights=tuple(jnp.asarray(scale * draw((out, into)), jnp.float32) for out, into, scale in sizes),
        biases=(jnp.zeros(8), jnp.zeros(8), jnp.array([-1.35, -0.18], jnp.float32)),
        low=jnp.array([-2.0, -2.0]),
        high=jnp.array([0.0, 0.0]),
        observation_names=STATE_NAMES,
    )


@pytest.fixture(scope="session")
def models(policy):
    """By what drives them."""
    walking, plant = load_behaviour("compass-walking"), CompassWalker()
    return {
        "bare": Model("compass-walking, free inputs", walking, None, plant),
        "gravity": Model("compass-walking, virtual-gravity", walking, VirtualGravity(plant), plant),
        "policy": Model("compass-walking, a policy", walking, policy, plant, clock="touchdown"),
    }


@pytest.fixture(scope="session")
def states():
    """States of a walker, and torques."""
    generator = np.random.default_rng(0)
    names = (*STATE_NAMES, "u_1", "u_2")
    return [dict(zip(names, row, strict=True)) for row in generator.uniform(-1, 1, (30, 6)).tolist()]
