"""Generalised advantage estimation (Schulman et al., 2016, arXiv 1506.02438)."""

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float


def generalised_advantages(
    rewards: Float[Array, "*steps"],
    values: Float[Array, "*steps"],
    next_values: Float[Array, "*steps"],
    terminated: Bool[Array, "*steps"],
    ended: Bool[Array, "*steps"],
    gamma: float,
    gae_lambda: float,
) -> Float[Array, "*steps"]:
    """The advantage of every step of a rollout that may span several episodes; time is the first axis.

        δ_t = r_t + γ (1 − terminated_t) V(s_{t+1}) − V(s_t)
        A_t = δ_t + γ λ (1 − ended_t) A_{t+1},        A_n = 0            (eq. 16 of the paper)

    - `next_values`: V(s_{t+1}) of the state that step t led to, *before* any reset.
    - `terminated`: the task ended there, so its future is worth nothing.
    - `ended`: terminated or truncated; a truncated step keeps V(s_{t+1}), but no advantage flows back
      over it.

    Returns A, one a step; A + V is the value network's target.
    """
    deltas = rewards + gamma * jnp.where(terminated, 0.0, next_values) - values
    decays = gamma * gae_lambda * jnp.where(ended, 0.0, jnp.ones_like(rewards))

    def backward(following, step):
        delta, decay = step
        advantage = delta + decay * following
        return advantage, advantage

    _, advantages = lax.scan(backward, jnp.zeros_like(rewards[0]), (deltas, decays), reverse=True)
    return advantages
