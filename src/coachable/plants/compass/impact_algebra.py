"""The compass walker's impact as arithmetic."""

from collections.abc import Callable
from typing import Any

from coachable.plants.impact_algebra import ImpactAlgebra


def impact_algebra(
    velocities_after_impact: Callable[..., tuple[Any, Any]], reduced_inertia: Callable[[Any], Any]
) -> ImpactAlgebra:
    """Touchdowns with both feet on the ground and apart, so θ₁ = −θ₂; there the legs swap roles."""
    return ImpactAlgebra(
        angles=("theta_1", "theta_2"),
        mirrored=True,
        bounded="theta_2",
        usual=(0.1, 0.4),
        # Above 0, and below π/2, where the walker has fallen.
        possible=(1e-9, 1.57),
        linear={"dtheta_1": "stance", "dtheta_2": "swing"},
        after=lambda cos, velocities: velocities_after_impact(cos, *velocities),
        swapped={"theta_1": "theta_2", "theta_2": "theta_1"},
        scale=reduced_inertia,
    )
