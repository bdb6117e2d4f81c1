"""Masses, lengths and gravity of the compass walker."""

import math
from dataclasses import dataclass, fields

from coachable.foundation.data import real, shown
from coachable.foundation.errors import ParameterError


@dataclass(frozen=True)
class CompassParameters:
    """Masses, lengths and gravity of a compass walker; the defaults are the paper's.

    Raises `ParameterError` naming the field if a value is not a positive finite number.
    """

    hip_mass: int | float = 1.0
    """m_H, point mass at the hip [kg]."""
    leg_mass: int | float = 0.5
    """m, point mass on each leg [kg]."""
    a: int | float = 0.5
    """Distance from the foot to the leg's mass [m]."""
    b: int | float = 0.5
    """Distance from the leg's mass to the hip [m]."""
    gravity: int | float = 9.807
    """g, gravitational acceleration [m/s²]; from the code released with the paper, which prints none."""

    def __post_init__(self):
        for field in fields(self):
            value = getattr(self, field.name)
            number = real(value)
            if number is None or not math.isfinite(number) or number <= 0:
                raise ParameterError(
                    f"CompassParameters.{field.name} must be a positive finite number, "
                    f"but it is {shown(value)}"
                )
            object.__setattr__(self, field.name, number)

    @property
    def leg_length(self) -> float:
        """Distance l = a + b from foot to hip [m]."""
        return self.a + self.b

    @property
    def stance_inertia(self) -> float:
        """Inertia about the stance foot of what the stance leg carries: (m_H + m) l² + m a² [kg m²]."""
        return (self.hip_mass + self.leg_mass) * self.leg_length**2 + self.leg_mass * self.a**2

    @property
    def coupling_inertia(self) -> float:
        """What couples the two legs' accelerations: m b l [kg m²]."""
        return self.leg_mass * self.b * self.leg_length

    @property
    def swing_inertia(self) -> float:
        """Inertia of the swing leg about the hip: m b² [kg m²]."""
        return self.leg_mass * self.b**2

    @property
    def stance_weight(self) -> float:
        """Largest gravity torque on the stance leg: (m_H l + m a + m l) g [N m]."""
        moment = self.hip_mass * self.leg_length + self.leg_mass * (self.a + self.leg_length)
        return moment * self.gravity

    @property
    def swing_weight(self) -> float:
        """Largest gravity torque on the swing leg: m b g [N m]."""
        return self.leg_mass * self.b * self.gravity


PAPER_PARAMETERS = CompassParameters()
"""The walker of the paper."""

STATE_NAMES = ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
"""Order of the state: stance leg, swing leg (angles from upright [rad], then angular velocities [rad/s])."""

START = (0.0, 0.0, -0.4, 2.0)
"""The paper's initial state x₀: both legs upright, tipping forward, the swing leg swinging forward."""
