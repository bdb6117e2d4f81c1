"""The compass walker: two straight legs joined at the hip, a point mass on each and one on the hip."""

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.compass.disturbances import DISTURBANCES, on_slope
from coachable.plants.compass.equations import equations
from coachable.plants.compass.impact_algebra import impact_algebra
from coachable.plants.compass.observation_bounds import observation_bounds
from coachable.plants.compass.parameters import PAPER_PARAMETERS, START, STATE_NAMES, CompassParameters
from coachable.plants.compass.restated import restated
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.plants.disturbances import Disturbances
from coachable.plants.equations import Equations
from coachable.plants.impact_algebra import ImpactAlgebra
from coachable.plants.plant import Controller, Dynamics, Event, Plant
from coachable.plants.restated import Restated

_BEHAVIOURS = {"paper": "compass-walking", "released-code": "compass-walking-released"}

WALKING_TORQUE = (-1.35, -0.18)
"""A constant torque (ankle, hip) with which the paper's walker walks [N m]."""


class CompassWalker(Plant):
    """The compass walker on flat ground: M(θ) θ̈ + C(θ, θ̇) θ̇ + g(θ) = S u.

    Equation (1) of Harnack et al., CDC 2023, with the θ̇ behind C that is missing in print. The hip stands at
    foot + l (−sin θ₁, cos θ₁) and the swing foot at hip + l (sin θ₂, −cos θ₂); walking forward means θ̇₁ < 0.

    A swing foot that passes *backward* through the stance foot is no touchdown, unless
    `backward_passing_counts`, as in the code released with the paper.
    """

    parameters: CompassParameters = eqx.field(static=True, default=PAPER_PARAMETERS)
    backward_passing_counts: bool = eqx.field(static=True, default=False)

    name = "the compass walker"
    state_names = STATE_NAMES
    state_units = ("rad", "rad", "rad/s", "rad/s")
    control_names = ("u1", "u2")
    control_units = ("N m", "N m")
    actuators = ("ankle", "hip")
    start = START
    action_box = ((-2.0, -2.0), (0.0, 0.0))
    """Of the torques (ankle, hip) [N m]; the released code's, the paper has none."""
    section_names = ("beta", "dtheta_1", "dtheta_2")
    """Half the angle between the legs [rad], the legs' velocities [rad/s]."""
    section_units = ("rad", "rad/s", "rad/s")
    start_box = (0.03, 0.03, 0.04, 0.2)
    """10 % of 0.3 rad and of x₀'s velocities."""
    section_box = ((0.1, 0.5), (-2.0, -0.5), (-1.5, 1.5))
    section_near = (0.015, 0.05, 0.05)

    def under(self, semantics: str) -> "CompassWalker":
        """Return the paper's walker, or in `released-code` the one whose `backward_passing_counts`.

        **Raises:** `ParameterError` for another semantics.
        """
        if semantics not in _BEHAVIOURS:
            raise ParameterError(
                f"{self.name} has no {semantics!r} semantics; {suggestion(semantics, _BEHAVIOURS)}"
            )
        return CompassWalker(self.parameters, backward_passing_counts=semantics == "released-code")

    def behaviour_under(self, semantics: str) -> str:
        """Return the name of compass walking as the semantics has it."""
        self.under(semantics)
        return _BEHAVIOURS[semantics]

    @property
    def events(self) -> tuple[Event, ...]:
        """The touchdown of the swing foot."""
        return (
            Event(
                name="touchdown",
                guard=self.guard,
                admissible=self.can_touch_down,
                reset=self.impact,
                displacement=self.step_length,
                can_repeat=self.can_bounce,
            ),
        )

    def mass_matrix(self, x: Float[Array, "4"]) -> Float[Array, "2 2"]:
        """Return M(θ) [kg m²]."""
        p = self.parameters
        theta_1, theta_2, _, _ = x
        coupling = -p.coupling_inertia * jnp.cos(theta_1 - theta_2)
        stance, swing = jnp.full_like(coupling, p.stance_inertia), jnp.full_like(coupling, p.swing_inertia)
        return jnp.stack([jnp.stack([stance, coupling]), jnp.stack([coupling, swing])])

    def coriolis(self, x: Float[Array, "4"]) -> Float[Array, "2 2"]:
        """Return C(θ, θ̇) [kg m² rad/s], with Ṁ − 2C skew-symmetric."""
        theta_1, theta_2, dtheta_1, dtheta_2 = x
        swirl = self.parameters.coupling_inertia * jnp.sin(theta_1 - theta_2)
        zero = jnp.zeros_like(swirl)
        return jnp.stack([jnp.stack([zero, -swirl * dtheta_2]), jnp.stack([swirl * dtheta_1, zero])])

    def gravity_torque(self, x: Float[Array, "4"]) -> Float[Array, "2"]:
        """Return g(θ) [N m], the gradient of the potential energy."""
        theta_1, theta_2, _, _ = x
        p = self.parameters
        return jnp.stack([-p.stance_weight * jnp.sin(theta_1), p.swing_weight * jnp.sin(theta_2)])

    def input_matrix(self) -> Float[Array, "2 2"]:
        """Return S: u₁ is the ankle torque, u₂ the hip torque (the paper's sentence swaps their names)."""
        return jnp.array([[1.0, 1.0], [0.0, -1.0]])

    def flow(self, x: Float[Array, "4"], control: Float[Array, "2"]) -> Float[Array, "4"]:
        """Return ẋ = (θ̇, M⁻¹(S u − C θ̇ − g)), with M⁻¹ in closed form.

        Arguments: x, the state; control, the torques u = (ankle, hip) [N m]. Returns [rad/s, rad/s²].
        """
        p = self.parameters
        theta_1, theta_2, dtheta_1, dtheta_2 = x
        ankle, hip = control
        cos, sin = jnp.cos(theta_1 - theta_2), jnp.sin(theta_1 - theta_2)
        stance = ankle + hip + p.coupling_inertia * sin * dtheta_2**2 + p.stance_weight * jnp.sin(theta_1)
        swing = -hip - p.coupling_inertia * sin * dtheta_1**2 - p.swing_weight * jnp.sin(theta_2)
        lever = p.leg_length / p.b * cos
        ddtheta_1 = (stance + lever * swing) / self.reduced_inertia(cos)
        ddtheta_2 = swing / p.swing_inertia + lever * ddtheta_1
        return jnp.stack([dtheta_1, dtheta_2, ddtheta_1, ddtheta_2])

    def guard(self, x: Float[Array, "4"]) -> Float[Array, ""]:
        """Return a number that falls through zero when the swing foot comes down on the ground.

        The swing foot's height is l (cos θ₁ − cos θ₂) = 2 l sin((θ₁ + θ₂)/2) sin((θ₂ − θ₁)/2). Only the first
        sine changes sign at a touchdown, so it is the guard; the second one changes sign where the legs pass.
        Where `backward_passing_counts` the guard is the height itself while the swing leg leads, over l.
        """
        theta_1, theta_2, _, _ = x
        mean = jnp.sin((theta_1 + theta_2) / 2)
        if not self.backward_passing_counts:
            return mean
        lead = theta_2 - theta_1
        return jnp.minimum(2 * mean * jnp.sin(lead / 2), lead)

    def can_touch_down(self, x: Float[Array, "4"]) -> Bool[Array, ""]:
        """Return whether the swing leg is in front; scuffing while it passes is ignored, as in the paper."""
        theta_1, theta_2, _, _ = x
        return (theta_2 > theta_1) | self.backward_passing_counts

    @property
    def can_bounce(self) -> bool:
        """Whether a touchdown may follow right after an impact.

        Not where `backward_passing_counts`: the released code's guard stands at −1 until the swing leg leads
        again, so that a passing is seen only from a step that begins with the swing leg in front. Legs that
        fall backward together would otherwise pass each other ever faster.
        """
        return not self.backward_passing_counts

    def impact(self, x: Float[Array, "4"]) -> Float[Array, "4"]:
        """Return the state right after touchdown: the legs swap roles, T⁺ θ̇⁺ = T⁻ θ̇⁻.

        Conserved are the angular momentum of the whole walker about the new stance foot and that of the old
        stance leg about the hip. Equation (5) of Harnack et al., where μ₃ as printed swaps the velocities
        once too often.
        """
        theta_1, theta_2, dtheta_1, dtheta_2 = x
        stance, swing = self.velocities_after_impact(jnp.cos(theta_1 - theta_2), dtheta_1, dtheta_2)
        return jnp.stack([theta_2, theta_1, stance, swing])

    def velocities_after_impact(self, cos: Any, dtheta_1: Any, dtheta_2: Any) -> tuple[Any, Any]:
        """Return the new stance and swing leg's velocities, given cos(θ₁ − θ₂) and those before the impact.

        They are linear in the velocities, and `reduced_inertia` times them is a polynomial in the cosine, of
        degree two at most. The arguments may be arrays, floats or the terms of a solver: nothing but
        arithmetic is done to them.
        """
        p = self.parameters
        hip_moment = (p.hip_mass * p.leg_length + p.leg_mass * p.a) * p.leg_length
        momentum = hip_moment * cos * dtheta_1 - p.leg_mass * p.a * p.b * dtheta_2
        stance = momentum / self.reduced_inertia(cos)
        swing = (p.leg_length * cos * stance - p.a * dtheta_1) / p.b
        return stance, swing

    def step_length(self, x: Float[Array, "4"]) -> Float[Array, ""]:
        """Return how far in front of the stance foot the swing foot is: l (sin θ₂ − sin θ₁) [m]."""
        theta_1, theta_2, _, _ = x
        return self.parameters.leg_length * (jnp.sin(theta_2) - jnp.sin(theta_1))

    def fall_margin(self, x: Float[Array, "4"]) -> Float[Array, ""]:
        """Return cos θ₁, the hip's height over l: zero when the hip is on the ground."""
        return jnp.cos(x[0])

    def base(self, x: Float[Array, "4"], foot_x: Float[Array, ""]) -> Float[Array, "2"]:
        """Return the hip's position (x, z) [m], given where the stance foot is on the ground [m]."""
        theta_1, _, _, _ = x
        l = self.parameters.leg_length  # noqa: E741
        return jnp.stack([foot_x - l * jnp.sin(theta_1), l * jnp.cos(theta_1)])

    def swing_foot(self, x: Float[Array, "4"], foot_x: Float[Array, ""]) -> Float[Array, "2"]:
        """Return the swing foot's position (x, z) [m]; z is negative while the leg scuffs the ground."""
        theta_1, theta_2, _, _ = x
        l = self.parameters.leg_length  # noqa: E741
        return jnp.stack([foot_x + self.step_length(x), l * (jnp.cos(theta_1) - jnp.cos(theta_2))])

    def energy(self, x: Float[Array, "4"]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Return the kinetic energy ½ θ̇ᵀ M θ̇ and the potential energy above the ground [J]."""
        p = self.parameters
        theta_1, theta_2, dtheta_1, dtheta_2 = x
        kinetic = (
            p.stance_inertia * dtheta_1**2 / 2
            + p.swing_inertia * dtheta_2**2 / 2
            - p.coupling_inertia * jnp.cos(theta_1 - theta_2) * dtheta_1 * dtheta_2
        )
        potential = p.stance_weight * jnp.cos(theta_1) - p.swing_weight * jnp.cos(theta_2)
        return kinetic, potential

    def power(self, x: Float[Array, "4"], control: Float[Array, "2"]) -> Float[Array, ""]:
        """Return |u₁ θ̇₁| + |u₂ (θ̇₁ − θ̇₂)|, braking counted as driving [W]."""
        ankle, hip = control
        _, _, dtheta_1, dtheta_2 = x
        return jnp.abs(ankle * dtheta_1) + jnp.abs(hip * (dtheta_1 - dtheta_2))

    @property
    def weight(self) -> float:
        """(m_H + 2 m) g [N]."""
        p = self.parameters
        return (p.hip_mass + 2 * p.leg_mass) * p.gravity

    def to_section(self, x: Float[Array, "4"]) -> Float[Array, "3"]:
        """Return (β, θ̇₁, θ̇₂) with β = (θ₁ − θ₂) / 2 of a state right after an impact."""
        return jnp.stack([(x[0] - x[1]) / 2, x[2], x[3]])

    def from_section(self, y: Float[Array, "3"]) -> Float[Array, "4"]:
        """Return the state θ₁ = β, θ₂ = −β, with both feet on the ground."""
        beta, dtheta_1, dtheta_2 = y
        return jnp.stack([beta, -beta, dtheta_1, dtheta_2])

    def on_section(self, x: Float[Array, "4"]) -> Bool[Array, ""]:
        """Whether both feet are on the ground, the new stance foot ahead of the other one."""
        return (jnp.abs(x[0] + x[1]) <= jnp.finfo(x.dtype).eps ** 0.5) & (x[0] > 0)

    def pace(self, x: Float[Array, "4"]) -> Float[Array, ""]:
        """Return 1 / (1 + exp θ̇₁): without pace before the hip has passed the foot the walker falls back."""
        return jax.nn.sigmoid(-x[2])

    def disturbances(self) -> Disturbances:
        """Kicks of one or both legs; other masses, lengths and gravity, and a slope."""
        return DISTURBANCES

    def disturbed(self, changes: Mapping[str, Float[Array, ""]]) -> Dynamics:
        """The walker with other masses, lengths and gravity, on a slope."""
        from coachable.plants.compass.disturbed import DisturbedWalker  # which holds a walker

        return DisturbedWalker(self, **changes)

    def placed(self, x: Float[Array, "4"], changes: Mapping[str, Float[Array, ""]]) -> Float[Array, "4"]:
        """A state with both feet on the ground, turned by its slope."""
        return on_slope(x, changes["slope"])

    def restated(self) -> Restated | None:
        """The paper's walker in its matrices; `None` where `backward_passing_counts`."""
        return None if self.backward_passing_counts else restated(self.parameters)

    def equations(self) -> Equations | None:
        """The paper's walker as text; `None` where `backward_passing_counts`."""
        return None if self.backward_passing_counts else equations(self.parameters)

    def impact_algebra(self) -> ImpactAlgebra | None:
        """Of touchdowns with the feet apart; `None` where `backward_passing_counts`."""
        if self.backward_passing_counts:
            return None
        return impact_algebra(self.velocities_after_impact, self.reduced_inertia)

    def controllers(self) -> Mapping[str, Controller]:
        """Virtual gravity, the released code's where `backward_passing_counts`; a constant torque; none."""
        from coachable.plants.compass.virtual_gravity import VirtualGravity  # which holds a walker

        return {
            "virtual-gravity": VirtualGravity(self, released=self.backward_passing_counts),
            "constant-torque": ConstantTorque(WALKING_TORQUE),
            "none": NoTorque(2),
        }

    def observation_bounds(
        self,
        box: tuple[Sequence[float], Sequence[float]],
        largest_start: Sequence[float],
        seconds: float,
    ) -> Float[np.ndarray, "4"]:
        """Return bounds that no policy can leave; see `observation_bounds.observation_bounds`."""
        return observation_bounds(self.parameters, box, largest_start, seconds)

    def reduced_inertia(self, cos: Any) -> Any:
        """Return det M / (m b²), the stance leg's inertia with the swing leg free; it is positive [kg m²].

        The cosine of θ₁ − θ₂ may be an array, a float or a solver's term.
        """
        p = self.parameters
        return p.stance_inertia - p.leg_mass * p.leg_length**2 * cos**2
