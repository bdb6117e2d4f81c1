"""The reward of one control step: section III of the paper, term by term, top to bottom.

    r_t = ω_jerk r_jerk + ω_dist r_dist + ω_fall r_fall + ω_for r_for + ω_or r_or

Two semantics run through the terms. `paper` is what Harnack et al. (CDC 2023) mean; `released-code` is
what the code released with it does. The functions work on one step without a batch, in the dtype of their
arguments.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from coachable.rewards.setup import Semantics


class StepFacts(eqx.Module):
    """What the reward of control step t reads of (x_t, x_{t−1}, p_t, p_{t−1}, u_t, u_{t−1}, t)."""

    r_or: Float[Array, ""]
    """r_or(x_t, x_{t−1}), eq. (r_or), or what another form of `DescribedReward` pays for the behaviour."""
    unseen: Bool[Array, ""]
    """Whether nothing was seen before the step: the first of a `released-code` run."""
    hip_x: Float[Array, ""]
    """p_t^x [m]: where the hip is after the step."""
    previous_hip_x: Float[Array, ""]
    """p_{t−1}^x [m]."""
    foot_x: Float[Array, ""]
    """Where the stance foot is after the step [m]."""
    control: Float[Array, " control"]
    """u_t: the torques applied during the step (ankle, hip) [N m]."""
    previous_control: Float[Array, " control"]
    """u_{t−1} [N m]."""
    first: Bool[Array, ""]
    """Whether this is the first step of its episode."""
    fell: Bool[Array, ""]
    """Whether the walker fell (or chattered) in this step."""
    time_is_up: Bool[Array, ""]
    """H(t − T): whether the step ends at or after the horizon T."""


def r_for(hip_x: Float[Array, ""], previous_hip_x: Float[Array, ""]) -> Float[Array, ""]:
    """r_for(p_t, p_{t−1}) = 2 H(p_t^x − p_{t−1}^x) − 1, with H(0) = 0: +1 if the hip moved forward, else −1.

    Eq. (r_for); the value of H(0) is that of the released code (`_reward_forward_velocity`).
    """
    return jnp.where(hip_x - previous_hip_x > 0, jnp.ones_like(hip_x), -jnp.ones_like(hip_x))


def r_jerk(
    control: Float[Array, " control"], previous_control: Float[Array, " control"], semantics: Semantics
) -> Float[Array, ""]:
    """How much the torques changed.

    - `paper`: r_jerk(u_t, u_{t−1}) = ‖u_t − u_{t−1}‖₂ [N m], eq. (r_jerk).
    - `released-code`: r_jerk(u_t, u_{t−1}) = Σ_i (u_{t,i} − u_{t−1,i})² [N² m²] (`_reward_action_jerkiness`).
    """
    squared = jnp.sum((control - previous_control) ** 2)
    return jnp.sqrt(squared) if semantics == "paper" else squared


def r_dist(
    hip_x: Float[Array, ""],
    foot_x: Float[Array, ""],
    time_is_up: Bool[Array, ""],
    fell: Bool[Array, ""],
    semantics: Semantics,
) -> Float[Array, ""]:
    """How far the walker came [m], paid once, when the episode ends.

    - `paper`: r_dist(p_t, t) = p_t^x H(t − T), eq. (r_dist): the hip, if the walker is up when the time
      is up.
    - `released-code`: the stance foot, falls included (`_reward_final_distance_reached`).
    """
    if semantics == "paper":
        return jnp.where(time_is_up & ~fell, hip_x, 0)
    return jnp.where(time_is_up | fell, foot_x, 0)


def r_fall(fell: Bool[Array, ""]) -> Bool[Array, ""]:
    """r_fall(p_t) = H(−p_t^y): 1 if the walker fell, its hip on the ground, or chattered. Eq. (r_fall)."""
    return fell


def reward_terms(facts: StepFacts, semantics: Semantics) -> Float[Array, "5"]:
    """The five terms of a step, without weights, in the order of `TERM_NAMES`.

    Three terms compare with the step before, and pay 0 where there is none:

    |        | `paper`                      | `released-code`                                 |
    |--------|------------------------------|-------------------------------------------------|
    | r_or   | x₀ counts as the step before | 0 on the first step of a run; never forgotten   |
    | r_for  | x₀ counts as the step before | 0 on the first step of each episode             |
    | r_jerk | 0 on each episode's first    | 0 on the first step of a run; never forgotten   |

    A released-code run is on its first step while its memory is that of `DescribedReward.init_unseen`. What
    is never forgotten survives the end of an episode: the next episode's first step is compared with the
    last step of this one.
    """
    if semantics == "paper":
        no_hip_before, no_control_before = jnp.array(False), facts.first
    else:
        no_hip_before, no_control_before = facts.first, facts.unseen
    jerk = r_jerk(facts.control, facts.previous_control, semantics)
    distance = r_dist(facts.hip_x, facts.foot_x, facts.time_is_up, facts.fell, semantics)
    fall = r_fall(facts.fell)
    forward = r_for(facts.hip_x, facts.previous_hip_x)
    terms = (
        jnp.where(no_control_before, 0, jerk),
        distance,
        fall,
        jnp.where(no_hip_before, 0, forward),
        facts.r_or,
    )
    return jnp.stack([term.astype(facts.hip_x.dtype) for term in terms])


def full_reward(weights: Float[Array, "5"], terms: Float[Array, "5"]) -> Float[Array, ""]:
    """r_t = ω_jerk r_jerk + ω_dist r_dist + ω_fall r_fall + ω_for r_for + ω_or r_or, eq. (full reward)."""
    return jnp.sum(weights * terms)
