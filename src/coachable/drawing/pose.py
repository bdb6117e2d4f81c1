"""Where every part of the walker is: what is drawn, whatever it is drawn with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from coachable.plants.compass import CompassParameters


@dataclass(frozen=True, eq=False)
class Pose:
    """The compass walker in the plane, at one instant or at many: points (x, y) [m], the ground at y = 0."""

    hip: Float[np.ndarray, "*samples 2"]
    stance_foot: Float[np.ndarray, "*samples 2"]
    swing_foot: Float[np.ndarray, "*samples 2"]
    stance_mass: Float[np.ndarray, "*samples 2"]
    swing_mass: Float[np.ndarray, "*samples 2"]

    @staticmethod
    def of(
        theta_1: Float[np.ndarray, "*samples"],
        theta_2: Float[np.ndarray, "*samples"],
        foot_x: Float[np.ndarray, "*samples"],
        parameters: CompassParameters,
    ) -> Pose:
        """The pose with these angles of the stance and the swing leg [rad] and the stance foot at foot_x [m].

        Hip = stance foot + l (−sin θ₁, cos θ₁), swing foot = hip + l (sin θ₂, −cos θ₂); each leg's mass is on
        its leg, a above the foot.
        """
        l, a = parameters.leg_length, parameters.a  # noqa: E741
        stance_foot = np.stack([foot_x, np.zeros_like(foot_x)], axis=-1)
        up_the_stance_leg = np.stack([-np.sin(theta_1), np.cos(theta_1)], axis=-1)
        down_the_swing_leg = np.stack([np.sin(theta_2), -np.cos(theta_2)], axis=-1)
        hip = stance_foot + l * up_the_stance_leg
        return Pose(
            hip=hip,
            stance_foot=stance_foot,
            swing_foot=hip + l * down_the_swing_leg,
            stance_mass=stance_foot + a * up_the_stance_leg,
            swing_mass=hip + parameters.b * down_the_swing_leg,
        )
