"""How what a network asks for is kept in the box of torques."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array

Squashing = Literal["clip", "tanh"]

SQUASHINGS: Mapping[str, Callable[[Array, Array, Array], Array]] = MappingProxyType(
    {
        "clip": jnp.clip,
        "tanh": lambda action, low, high: low + (high - low) * (jnp.tanh(action) + 1) / 2,
    }
)
"""From an action, the least and the greatest one to the one applied, by name.

`clip` cuts at the bounds, where its slope jumps; `tanh` maps ℝ smoothly onto the box, 0 to its middle.
"""
