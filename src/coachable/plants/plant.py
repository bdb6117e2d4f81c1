"""What a plant must provide so that it can be integrated through its impacts."""

import abc

import equinox as eqx
from jaxtyping import Array, Bool, Float


class HybridSystem(eqx.Module):
    """A mechanical system that flows smoothly and jumps when a foot touches the ground.

    Between touchdowns ẋ = flow(x, u). A touchdown is a zero of `guard` that is passed *falling*, at a state
    where `can_touch_down` holds; there the state jumps, x⁺ = impact(x⁻), and the stance foot moves by
    step_length(x⁻). When `fall_margin` reaches zero the walker has fallen.
    """

    @abc.abstractmethod
    def flow(self, x: Float[Array, " state"], control: Float[Array, " control"]) -> Float[Array, " state"]:
        """Return ẋ at state x under the given control."""

    @abc.abstractmethod
    def guard(self, x: Float[Array, " state"]) -> Float[Array, ""]:
        """Return a number that falls through zero at a touchdown."""

    @abc.abstractmethod
    def can_touch_down(self, x: Float[Array, " state"]) -> Bool[Array, ""]:
        """Return whether a falling zero of the guard at x is a touchdown at all."""

    @property
    @abc.abstractmethod
    def can_bounce(self) -> bool:
        """Whether a guard that an impact left at zero may rise and fall through zero again at once."""

    @abc.abstractmethod
    def impact(self, x: Float[Array, " state"]) -> Float[Array, " state"]:
        """Return the state right after a touchdown at x."""

    @abc.abstractmethod
    def step_length(self, x: Float[Array, " state"]) -> Float[Array, ""]:
        """Return how far in front of the stance foot the swing foot stands [m]."""

    @abc.abstractmethod
    def fall_margin(self, x: Float[Array, " state"]) -> Float[Array, ""]:
        """Return a number that is positive while the walker is up and reaches zero when it has fallen."""
