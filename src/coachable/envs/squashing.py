"""How what a network asks for is kept in the box of torques, and what it applies on average."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Literal

import jax.numpy as jnp
from jax.scipy.special import ndtr
from jax.scipy.stats import norm
from jaxtyping import Array, Float

Squashing = Literal["clip", "tanh"]
Deterministic = Literal["clipped-mean", "expected-action"]

DETERMINISTIC: tuple[Deterministic, ...] = ("clipped-mean", "expected-action")
"""What a Gaussian policy does when it does not explore: its mean, clipped, as in stable-baselines3, or the
mean of what it applies when it explores; see `expected_action`."""

SQUASHINGS: Mapping[str, Callable[[Array, Array, Array], Array]] = MappingProxyType(
    {
        "clip": jnp.clip,
        "tanh": lambda action, low, high: low + (high - low) * (jnp.tanh(action) + 1) / 2,
    }
)
"""From an action, the least and the greatest one to the one applied, by name.

`clip` cuts at the bounds, where its slope jumps; `tanh` maps ℝ smoothly onto the box, 0 to its middle.
"""


def expected_action(
    mean: Float[Array, "*actions"],
    std: Float[Array, "*actions"],
    low: Float[Array, "*actions"],
    high: Float[Array, "*actions"],
) -> Float[Array, "*actions"]:
    """E[clip(a, low, high)] of a ~ N(mean, std²): the mean of the rectified Gaussian.

        ū = low Φ(α) + high (1 − Φ(β)) + μ (Φ(β) − Φ(α)) + σ (φ(α) − φ(β)),
        α = (low − μ) / σ,  β = (high − μ) / σ

    It is smooth, rises with μ at the rate Φ(β) − Φ(α), and is what a plant feels on average of a policy that
    explores, however far σ reaches beyond the box. On clipped actions: Fujita and Maeda, *Clipped action
    policy gradient* (ICML 2018).
    """
    alpha, beta = (low - mean) / std, (high - mean) / std
    below, above = ndtr(alpha), ndtr(-beta)
    within = jnp.where(mean < (low + high) / 2, ndtr(beta) - below, ndtr(-alpha) - above)
    return low * below + high * above + mean * within + std * (norm.pdf(alpha) - norm.pdf(beta))
