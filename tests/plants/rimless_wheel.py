"""The rimless wheel: spokes an angle 2α apart roll down a slope γ, helped by a motor at the stance foot.

McGeer, *Passive dynamic walking*, International Journal of Robotics Research, 1990. A point mass m at the hub
and massless spokes of length l. θ is the stance spoke's angle from the ground's normal, positive forward;
gravity is tilted by γ: m l² θ̈ = m g l sin(θ + γ) + τ. A spoke touches down where θ = α; the angular momentum
about the new contact is kept, so that ω⁺ = ω⁻ cos 2α, and θ⁺ = −α.
"""

import math
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from coachable.foundation.errors import ParameterError
from coachable.plants.plant import Event, Plant
from coachable.plants.skeleton import PointMass, Segment, Skeleton


@dataclass(frozen=True)
class WheelParameters:
    """Mass, size and slope."""

    mass: float = 1.0
    """m [kg]."""
    length: float = 1.0
    """l, of a spoke [m]."""
    half_angle: float = 0.3
    """α, half the angle between two spokes [rad]."""
    slope: float = 0.08
    """γ, down which the wheel rolls [rad]."""
    gravity: float = 9.81
    """g [m/s²]."""

    def __post_init__(self):
        if not (min(self.mass, self.length, self.gravity) > 0 and 0 < self.half_angle < math.pi / 4):
            raise ParameterError(f"mass, length, gravity and half_angle must be positive, got {self}")


class RimlessWheel(Plant):
    """The wheel on its slope, in coordinates along the ground."""

    parameters: WheelParameters = eqx.field(static=True, default=WheelParameters())

    name = "the rimless wheel"
    state_names = ("theta", "dtheta")
    state_units = ("rad", "rad/s")
    control_names = ("torque",)
    control_units = ("N m",)
    start = (0.0, 1.0)
    action_box = ((-1.0,), (1.0,))
    section_names = ("dtheta",)
    start_box = (0.1, 0.2)
    section_box = ((0.6, 2.0),)
    section_near = (0.02,)

    def flow(self, x, control):
        """Return (ω, (g / l) sin(θ + γ) + τ / (m l²))."""
        p = self.parameters
        theta, omega = x
        (torque,) = control
        pull = p.gravity / p.length * jnp.sin(theta + p.slope)
        return jnp.stack([omega, pull + torque / (p.mass * p.length**2)])

    @property
    def events(self):
        """The next spoke touches down; one that rolls back onto the last spoke stops there: it falls."""
        alpha, length = self.parameters.half_angle, self.parameters.length
        return (
            Event(
                name="touchdown",
                guard=lambda x: alpha - x[0],
                admissible=lambda x: x[1] > 0,
                reset=lambda x: jnp.stack([jnp.full_like(x[0], -alpha), x[1] * math.cos(2 * alpha)]),
                displacement=lambda x: jnp.full_like(x[0], 2 * length * math.sin(alpha)),
            ),
        )

    def fall_margin(self, x):
        """Return the angle left before the last spoke comes back to the ground; a touchdown leaves some."""
        return x[0] + 1.1 * self.parameters.half_angle

    def base(self, x, foot_x):
        """Return where the hub is, along the ground and from it."""
        length = self.parameters.length
        return jnp.stack([foot_x + length * jnp.sin(x[0]), length * jnp.cos(x[0])])

    def power(self, x, control):
        """Return |τ ω|."""
        return jnp.abs(control[0] * x[1])

    @property
    def weight(self):
        """m g."""
        return self.parameters.mass * self.parameters.gravity

    def to_section(self, x):
        """Return ω right after a touchdown, where θ = −α."""
        return x[1:]

    def from_section(self, y):
        """Return (−α, ω)."""
        return jnp.concatenate([jnp.full_like(y, -self.parameters.half_angle), y])

    @property
    def skeleton(self):
        """As many spokes as there is room for, leg k the one that stands after k more touchdowns; the hub."""
        spokes = range(int(math.pi / self.parameters.half_angle))
        return Skeleton(
            points=("hub", *(f"foot_{spoke}" for spoke in spokes)),
            base="hub",
            segments=tuple(Segment((f"foot_{spoke}", "hub"), leg=spoke) for spoke in spokes),
            masses=(PointMass("hub", self.parameters.mass),),
            height=2 * self.parameters.length,
        )

    def kinematics(self, states, foot_x):
        """Return where the hub is, and the foot of spoke k, which is 2 α k ahead of the stance spoke."""
        p, theta = self.parameters, states[..., 0]
        hub = np.stack([foot_x + p.length * np.sin(theta), p.length * np.cos(theta)], axis=-1)
        angles = [theta - 2 * p.half_angle * spoke for spoke in range(self.skeleton.num_legs)]
        feet = [hub - p.length * np.stack([np.sin(angle), np.cos(angle)], axis=-1) for angle in angles]
        return np.stack([hub, *feet], axis=-2)

    def energy(self, x):
        """Return ½ m l² ω² + m g l cos(θ + γ), which the flow without torque conserves."""
        p = self.parameters
        height = p.length * jnp.cos(x[0] + p.slope)
        return p.mass * (p.length * x[1]) ** 2 / 2 + p.mass * p.gravity * height

    @property
    def fixed_point(self):
        """ω right after a touchdown of the passive gait: ω² = c (ω² + 4 (g/l) sin α sin γ), c = cos² 2α."""
        p = self.parameters
        shrink = math.cos(2 * p.half_angle) ** 2
        gain = 4 * p.gravity / p.length * math.sin(p.half_angle) * math.sin(p.slope)
        return math.sqrt(shrink * gain / (1 - shrink))


PLANT = RimlessWheel
