"""The contract of a plant: what a robot must provide to be simulated, trained, drawn and verified."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.controllers import NoTorque
from coachable.plants.disturbances import Disturbances, Kick
from coachable.plants.equations import Equations
from coachable.plants.impact_algebra import ImpactAlgebra
from coachable.plants.restated import Restated
from coachable.plants.skeleton import Skeleton

Controller = Callable[[Float[Array, " state"]], Float[Array, " control"]]
"""From a state to the control to be applied there."""


_NEEDED = ("name", "state_names", "control_names", "start", "action_box")


@dataclass(frozen=True)
class Event:
    """An instant at which the state jumps, x⁺ = reset(x⁻).

    It happens where `guard` falls through zero at a state where `admissible` holds.
    """

    name: str
    guard: Callable[[Array], Array]
    """x ↦ a number that falls through zero at the event."""
    reset: Callable[[Array], Array]
    """x⁻ ↦ x⁺, the reset map."""
    admissible: Callable[[Array], Array] = lambda x: jnp.array(True)
    """x ↦ whether a falling zero of the guard at x is this event."""
    displacement: Callable[[Array], Array] = lambda x: jnp.zeros_like(x[0])
    """x⁻ ↦ by how much the point that the base is measured from moves forward [m]."""
    can_repeat: bool = True
    """Whether a guard that a reset left at zero may rise and fall through zero again within the step."""
    restarts_clock: bool = True
    """Whether the event is a touchdown: it restarts the sample clock of `clock="touchdown"`, is counted in
    `Advance.touchdowns` and limited by the chatter rule. Other events pass inside a control step."""


class Dynamics(eqx.Module):
    """What is integrated: a smooth flow, interrupted by events, until the fall margin reaches zero."""

    @abc.abstractmethod
    def flow(self, x: Float[Array, " state"], control: Float[Array, " control"]) -> Float[Array, " state"]:
        """Return ẋ at state x under a control."""

    @property
    def events(self) -> tuple[Event, ...]:
        """The events, of which the earliest one happens; by default none."""
        return ()

    def fall_margin(self, x: Float[Array, " state"]) -> Float[Array, ""]:
        """Return a number that is positive while the robot is up and zero when it has fallen; default 1."""
        return jnp.ones_like(x[0])


class Plant(Dynamics):
    """A robot: its dynamics, the names of its state and control, and the numbers that its use needs.

    A subclass gives the abstract members, most of them as plain class attributes, and overrides those
    defaults that do not hold for it. The first event is the touchdown whose section the gait is analysed on.
    """

    parameters: Any = eqx.field(static=True, default=None)
    """A frozen dataclass of numbers, each with a default; a subclass gives its own default."""

    name: ClassVar[str]
    """In messages, with its article: "the compass walker"."""
    state_names: ClassVar[tuple[str, ...]]
    control_names: ClassVar[tuple[str, ...]]
    start: ClassVar[tuple[float, ...]]
    """x₀, where an episode starts."""
    action_box: ClassVar[tuple[tuple[float, ...], tuple[float, ...]]]
    """Lowest and highest control that a policy may apply."""

    state_units: ClassVar[tuple[str, ...]] = ()
    control_units: ClassVar[tuple[str, ...]] = ()
    actuators: ClassVar[tuple[str, ...]] = ()
    """Where each control acts, in words: `ankle`; empty for the controls' names."""
    section_names: ClassVar[tuple[str, ...]] = ()
    """Coordinates on the touchdown section; empty if the plant gives no chart of it."""
    section_units: ClassVar[tuple[str, ...]] = ()
    """Of each of them; empty for those that coordinates of the same name have in the state."""
    start_box: ClassVar[tuple[float, ...]] = ()
    """Half the widths of the box around `start` from which the basin is sampled; empty if none is given."""
    section_box: ClassVar[tuple[tuple[float, float], ...]] = ()
    """Lowest and highest value of each of the section's coordinates, where the basin is sampled from."""
    section_near: ClassVar[tuple[float, ...]] = ()
    """Two points of the section count as the same gait if no coordinate differs by more than this."""

    def __check_init__(self) -> None:
        """**Raises:** `ParameterError` if an attribute is missing or is not of its size."""
        missing = [name for name in _NEEDED if not hasattr(self, name)]
        if missing:
            raise ParameterError(f"the plant {type(self).__name__} does not define {', '.join(missing)}")
        state, control, section = map(len, (self.state_names, self.control_names, self.section_names))
        for attribute, size in (
            ("start", state),
            ("state_units", state if self.state_units else 0),
            ("control_units", control if self.control_units else 0),
            ("actuators", control if self.actuators else 0),
            ("section_units", section if self.section_units else 0),
            ("start_box", state if self.start_box else 0),
            ("section_box", section),
            ("section_near", section),
        ):
            if (found := len(getattr(self, attribute))) != size:
                raise ParameterError(f"{self.name}: {attribute} has {found} entries, but needs {size}")
        if [len(bound) for bound in self.action_box] != [control, control]:
            raise ParameterError(f"{self.name}: action_box must hold two rows of {control} numbers")

    @abc.abstractmethod
    def base(self, x: Float[Array, " state"], foot_x: Float[Array, ""]) -> Float[Array, "2"]:
        """Return the base's position (x, z) [m], given where the stance foot is on the ground [m]."""

    def power(self, x: Float[Array, " state"], control: Float[Array, " control"]) -> Float[Array, ""]:
        """Return Σ |τ ω| over the actuators, braking counted as driving [W].

        **Raises:** `ParameterError` if the plant does not define it.
        """
        raise ParameterError(f"{self.name} does not define the power of its actuators")

    @property
    def weight(self) -> float:
        """The robot's weight [N], to which the cost of transport is relative.

        **Raises:** `ParameterError` if the plant does not define it.
        """
        raise ParameterError(f"{self.name} does not define its weight")

    def signals(self, x: Float[Array, " state"], names: tuple[str, ...]) -> Float[Array, " signals"]:
        """Return the named signals at state x, in the given order; by default the state's coordinates.

        **Raises:** `ParameterError` if the plant has no signal of a name.
        """
        for name in names:
            if name not in self.state_names:
                hint = suggestion(name, self.state_names)
                raise ParameterError(f"{self.name} has no signal {name!r}; {hint}")
        if names == self.state_names:
            return x
        return jnp.stack([x[self.state_names.index(name)] for name in names])

    def to_section(self, x: Float[Array, " state"]) -> Float[Array, " section"]:
        """Return the point of the touchdown section that a state right after a touchdown is at.

        **Raises:** `ParameterError` if the plant gives no chart of its section.
        """
        raise ParameterError(f"{self.name} gives no coordinates on its touchdown section")

    def from_section(self, y: Float[Array, " section"]) -> Float[Array, " state"]:
        """Return the state right after a touchdown at a point of the section.

        **Raises:** `ParameterError` if the plant gives no chart of its section.
        """
        raise ParameterError(f"{self.name} gives no coordinates on its touchdown section")

    def on_section(self, x: Float[Array, " state"]) -> Bool[Array, ""]:
        """Whether a state is one right after a touchdown; by default where the section's chart gives it back.

        **Raises:** `ParameterError` if the plant gives no chart of its section.
        """
        back = self.from_section(self.to_section(x))
        return jnp.all(jnp.abs(back - x) <= jnp.finfo(x.dtype).eps ** 0.5)

    def pace(self, x: Float[Array, " state"]) -> Float[Array, ""]:
        """How far the robot is from losing its way forward, in (0, 1); a half where it stands. By default 1.

        The fall margin of a walk is proportional to it: near falls of a robot that falls back are found so.
        """
        return jnp.ones_like(x[0])

    def disturbances(self) -> Disturbances:
        """What the robot is tried with; by default kicks along each velocity and no other constants."""
        velocities = [index for index, unit in enumerate(self.state_units) if unit.endswith("/s")]
        kicks = [
            Kick(
                name=f"{self.state_names[index]} {'up' if sign > 0 else 'down'}",
                direction=tuple(sign * float(k == index) for k in range(len(self.state_names))),
                greatest=3.0,
                unit=self.state_units[index],
            )
            for index in velocities
            for sign in (1.0, -1.0)
        ]
        return Disturbances(tuple(kicks), section_half_widths=self.section_near)

    def disturbed(self, changes: Mapping[str, Float[Array, ""]]) -> Dynamics:
        """The robot with other values of what `disturbances` calls nominal; by default nothing can change."""
        return self

    def placed(
        self, x: Float[Array, " state"], changes: Mapping[str, Float[Array, ""]]
    ) -> Float[Array, " state"]:
        """A state, right after a touchdown, as it is on the disturbed ground; by default the same."""
        return x

    def restated(self) -> Restated | None:
        """The physics written down a second time, for SciPy; `None`: then no fall found can be confirmed."""
        return None

    def equations(self) -> Equations | None:
        """The physics as text; `None`: then no model of the robot can be exported."""
        return None

    def impact_algebra(self) -> ImpactAlgebra | None:
        """The touchdown's reset map as arithmetic; `None`: then no solver can reason about it."""
        return None

    def controllers(self) -> Mapping[str, Controller]:
        """The written controllers by name, the first one the baseline that learning is measured against."""
        return {"none": NoTorque(len(self.control_names))}

    def behaviour_under(self, semantics: str) -> str:
        """Return the name of the shipped behaviour that the plant is trained for by default.

        **Raises:** `ParameterError` if there is none.
        """
        raise ParameterError(f"no behaviour ships for {self.name}; give one")

    def under(self, semantics: str) -> Plant:
        """Return the plant as a semantics has it.

        **Raises:** `ParameterError` for a semantics that the plant does not have.
        """
        if semantics != "paper":
            raise ParameterError(f"{self.name} has no {semantics!r} semantics; use 'paper'")
        return self

    def observation_bounds(
        self,
        box: tuple[Sequence[float], Sequence[float]],
        largest_start: Sequence[float],
        seconds: float,
    ) -> Float[np.ndarray, " state"]:
        """Return the largest magnitude of each coordinate of the state in an episode; by default infinite.

        **Arguments:** `box`, lowest and highest control; `largest_start`, the largest magnitude of each
        coordinate of a start; `seconds`, the longest that an episode lasts.
        """
        return np.full(len(self.state_names), np.inf, np.float32)

    @property
    def skeleton(self) -> Skeleton:
        """What of the robot is drawn.

        **Raises:** `ParameterError` if the plant does not define it.
        """
        raise ParameterError(f"{self.name} does not define its skeleton, so it cannot be drawn")

    def kinematics(
        self, states: Float[np.ndarray, "*samples state"], foot_x: Float[np.ndarray, "*samples"]
    ) -> Float[np.ndarray, "*samples points 2"]:
        """Return (x, z) of the skeleton's points [m], the ground at z = 0.

        **Arguments:** `states`, at one instant or at many; `foot_x`, where the stance foot is [m].

        **Raises:** `ParameterError` if the plant does not define it.
        """
        raise ParameterError(f"{self.name} does not define its kinematics, so it cannot be drawn")
