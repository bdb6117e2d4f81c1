"""How far the compass walker's state can go in an episode, from what its motors can put into it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from coachable.plants.compass.parameters import CompassParameters


def observation_bounds(
    parameters: CompassParameters,
    box: tuple[Sequence[float], Sequence[float]],
    largest_start: Sequence[float],
    seconds: float,
) -> Float[np.ndarray, "4"]:
    """The largest |θ1|, |θ2| [rad], |θ̇1| and |θ̇2| [rad/s] in an episode, rounded up to float32.

    With E the energy, V its potential part and s = Σ of the gravity torques' amplitudes, |V| ≤ s. Power comes
    from the motors alone, Ė = (S u)ᵀθ̇ ≤ c √(θ̇ᵀM θ̇) with c = max √((S u)ᵀM⁻¹(S u)), so that

        d/dt √(2 (E + s)) ≤ c

    between impacts, and impacts take energy. Hence ½ θ̇ᵀM θ̇ ≤ ½ (√(2 (E₀ + s)) + c T)², which bounds each
    speed, θ̇1² ≤ M₂₂ θ̇ᵀM θ̇ / det M and θ̇2² ≤ M₁₁ θ̇ᵀM θ̇ / det M; the angles, which swap at impacts, grow
    no faster than the faster of the legs. A walker up for all of T with its swing leg whirling comes nearest.
    The bound is wide and holds for every policy; what a walker that walks needs is below 2 rad and 10 rad/s.

    **Arguments:** `box`, lowest and highest torques (ankle, hip) [N m]; `largest_start`, the largest
    magnitude of each coordinate of a start; `seconds`, T, the longest an episode lasts.
    """
    p = parameters
    theta_1, theta_2, dtheta_1, dtheta_2 = largest_start
    potential = p.stance_weight + p.swing_weight
    kinetic = (
        p.stance_inertia * dtheta_1**2 / 2
        + p.swing_inertia * dtheta_2**2 / 2
        + p.coupling_inertia * dtheta_1 * dtheta_2
    )
    smallest_determinant = p.stance_inertia * p.swing_inertia - p.coupling_inertia**2
    push = max(
        p.swing_inertia * (ankle + hip) ** 2
        + p.stance_inertia * hip**2
        + 2 * p.coupling_inertia * abs((ankle + hip) * hip)
        for ankle, hip in itertools.product(*zip(*box, strict=True))
    )
    speed = math.sqrt(2 * (kinetic + 2 * potential)) + math.sqrt(push / smallest_determinant) * seconds
    stance_speed = speed * math.sqrt(p.swing_inertia / smallest_determinant)
    swing_speed = speed * math.sqrt(p.stance_inertia / smallest_determinant)
    angle = max(theta_1, theta_2) + max(stance_speed, swing_speed) * seconds
    bounds = np.array([angle, angle, stance_speed, swing_speed])
    return np.nextafter(bounds.astype(np.float32), np.float32(np.inf))
