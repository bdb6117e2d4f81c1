"""What a walker may meet, a start in a box or disturbing torques, as a point of the cube [−1, 1]ⁿ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import ParameterError
from coachable.plants.compass import START

CONTROL_DT = 0.01
"""How long a torque is held [s]."""

Points = Float[np.ndarray, "walks size"]
Starts = Float[np.ndarray, "walks 4"]
Torques = Float[np.ndarray, "walks steps 2"]


@dataclass(frozen=True)
class StartBox:
    """Any start x0 with |x0 − centre| ≤ half_widths in each of (θ1, θ2, θ̇1, θ̇2) [rad, rad/s].

    **Raises:** `ParameterError` for numbers that are not finite, for a negative half-width, and where all are
    zero.
    """

    half_widths: tuple[float, float, float, float]
    centre: tuple[float, float, float, float] = START

    def __post_init__(self):
        _check_box(self.centre, self.half_widths)

    @property
    def size(self) -> int:
        """n."""
        return 4

    @property
    def sentence(self) -> str:
        """What it is, in words."""
        return f"starts x0 = {_numbers(self.centre)} ± {_numbers(self.half_widths)}"

    def at(self, points: Points) -> tuple[Starts, Torques]:
        """The starts and the disturbances at points of the cube; here nothing disturbs."""
        return np.array(self.centre) + points * np.array(self.half_widths), _undisturbed(points)


@dataclass(frozen=True)
class SectionBox:
    """Any state right after a touchdown with |y − centre| ≤ half_widths in each of y = (β, θ̇1, θ̇2).

    β = θ1 = −θ2 is half the angle between the legs [rad]; both feet are on the ground.

    **Raises:** `ParameterError` as `StartBox` does, and if β may become negative: the new stance foot would
    then be behind the other one.
    """

    half_widths: tuple[float, float, float]
    centre: tuple[float, float, float]

    def __post_init__(self):
        _check_box(self.centre, self.half_widths)
        if self.centre[0] <= self.half_widths[0]:
            raise ParameterError(
                f"a box on the section needs β > 0 everywhere, but it is {self.centre[0]} ± "
                f"{self.half_widths[0]}"
            )

    @property
    def size(self) -> int:
        """n."""
        return 3

    @property
    def sentence(self) -> str:
        """What it is, in words."""
        return (
            f"starts right after touchdown, (β, θ̇1, θ̇2) = {_numbers(self.centre)} "
            f"± {_numbers(self.half_widths)}"
        )

    def at(self, points: Points) -> tuple[Starts, Torques]:
        """The starts and the disturbances at points of the cube; here nothing disturbs."""
        beta, dtheta_1, dtheta_2 = (np.array(self.centre) + points * np.array(self.half_widths)).T
        return np.stack([beta, -beta, dtheta_1, dtheta_2], axis=-1), _undisturbed(points)


@dataclass(frozen=True)
class HeldTorques:
    """Torques of at most `bound` [N m], added to the ankle's and the hip's in the walk's first `seconds`.

    Each is held for `hold` control steps, which touchdowns cut short where they restart the clock. The sum is
    not clipped to the box of the controller's torques.

    **Raises:** `ParameterError` for a bound that is not positive, and for times that hold no torque.
    """

    bound: float
    seconds: float = 2.0
    hold: int = 5
    x0: tuple[float, float, float, float] = START

    def __post_init__(self):
        if not 0 < self.bound < math.inf:
            raise ParameterError(
                f"the bound of a torque must be a positive number of N m, but it is {self.bound!r}"
            )
        if self.hold < 1 or not self.hold * CONTROL_DT <= self.seconds < math.inf:
            raise ParameterError(
                f"torques held for {self.hold} control steps do not fit into {self.seconds} s; hold each for "
                "at least one, and disturb for at least as long"
            )

    @property
    def count(self) -> int:
        """How many torques each joint gets."""
        return int(self.seconds / CONTROL_DT + 0.5) // self.hold

    @property
    def size(self) -> int:
        """n."""
        return 2 * self.count

    @property
    def sentence(self) -> str:
        """What it is, in words."""
        return (
            f"torques of at most {self.bound:g} N m added at ankle and hip in the first {self.seconds:g} s, "
            f"each held for {self.hold * CONTROL_DT:g} s"
        )

    def at(self, points: Points) -> tuple[Starts, Torques]:
        """The starts, all the same one, and the disturbances at points of the cube."""
        torques = self.bound * points.reshape(-1, self.count, 2)
        return np.tile(np.array(self.x0), (len(points), 1)), np.repeat(torques, self.hold, axis=1)


Perturbation = StartBox | SectionBox | HeldTorques


def usual_perturbations(section_point: Sequence[float] | None) -> tuple[Perturbation, ...]:
    """What a walker is tried with in a passport.

    **Arguments:** `section_point`, where its gait is right after touchdown, (β, θ̇1, θ̇2) [rad, rad/s], or
    `None` if it has none; then no box of the section is searched.
    """
    around_start, torques = StartBox((0.03, 0.03, 0.04, 0.2)), HeldTorques(0.2)
    if section_point is None:
        return around_start, torques
    beta, dtheta_1, dtheta_2 = map(float, section_point)
    return around_start, SectionBox((0.02, 0.1, 0.1), (beta, dtheta_1, dtheta_2)), torques


def _undisturbed(points: Points) -> Torques:
    return np.zeros((len(points), 1, 2))


def _check_box(centre: Sequence[float], half_widths: Sequence[float]) -> None:
    if not all(map(math.isfinite, (*centre, *half_widths))):
        raise ParameterError(f"a box needs finite numbers, got {centre} ± {half_widths}")
    if min(half_widths) < 0 or not any(half_widths):
        raise ParameterError(
            f"a box's half-widths must not be negative, and not all zero, but they are {half_widths}"
        )


def _numbers(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
