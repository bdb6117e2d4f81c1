"""What a plant may meet, a start in a box or added controls, as a point of the cube [−1, 1]ⁿ."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import in_a_row
from coachable.plants.plant import Plant
from coachable.verification.gait.section import states_at
from coachable.verification.labels import actuators, control_unit, section_labels

CONTROL_DT = 0.01
"""How long a control is held [s]."""

Points = Float[np.ndarray, "walks size"]
Starts = Float[np.ndarray, "walks state"]
Controls = Float[np.ndarray, "walks steps control"]


@dataclass(frozen=True)
class StartBox:
    """Any start x0 with |x0 − centre| ≤ half_widths in each coordinate.

    **Raises:** `ParameterError` for numbers that are not finite, for a negative half-width, and where all are
    zero.
    """

    half_widths: tuple[float, ...]
    centre: tuple[float, ...]

    def __post_init__(self):
        _check_box(self.centre, self.half_widths)

    def size(self, plant: Plant) -> int:
        """n, after a check that the box is one of the plant's states.

        **Raises:** `ParameterError` for a box of another dimension.
        """
        return _checked_size(self.centre, len(plant.state_names), "state", plant)

    def sentence(self, plant: Plant) -> str:
        """The perturbation in words."""
        return f"starts x0 = {_numbers(self.centre)} ± {_numbers(self.half_widths)}"

    def at(self, plant: Plant, points: Points) -> tuple[Starts, Controls]:
        """The starts at points of the cube, and no disturbance."""
        return np.array(self.centre) + points * np.array(self.half_widths), _undisturbed(plant, points)


@dataclass(frozen=True)
class SectionBox:
    """Any state right after a touchdown with |y − centre| ≤ half_widths in each coordinate of the section.

    **Raises:** `ParameterError` as `StartBox` does.
    """

    half_widths: tuple[float, ...]
    centre: tuple[float, ...]

    def __post_init__(self):
        _check_box(self.centre, self.half_widths)

    def size(self, plant: Plant) -> int:
        """n, after a check that all of the box is on the plant's section.

        **Raises:** `ParameterError` for a box of another dimension, and for one with a corner at which no
        touchdown ends.
        """
        size = _checked_size(self.centre, len(plant.section_names), "section", plant)
        corners = np.array(list(itertools.product((-1.0, 1.0), repeat=size)))
        states = states_at(plant, np.array(self.centre) + corners * np.array(self.half_widths))
        if not all(bool(plant.on_section(jnp.asarray(state))) for state in states):
            raise ParameterError(
                f"a box on the section must be on it everywhere, but no touchdown of {plant.name} ends at "
                f"every corner of {section_labels(plant)} = {_numbers(self.centre)} ± "
                f"{_numbers(self.half_widths)}"
            )
        return size

    def sentence(self, plant: Plant) -> str:
        """The perturbation in words."""
        return (
            f"starts right after touchdown, {section_labels(plant)} = {_numbers(self.centre)} "
            f"± {_numbers(self.half_widths)}"
        )

    def at(self, plant: Plant, points: Points) -> tuple[Starts, Controls]:
        """The starts at points of the cube, and no disturbance."""
        y = np.array(self.centre) + points * np.array(self.half_widths)
        return states_at(plant, y), _undisturbed(plant, points)


@dataclass(frozen=True)
class HeldTorques:
    """Torques of at most `bound`, added to each of the controller's in the walk's first `seconds`.

    Each is held for `hold` control steps, which touchdowns cut short where they restart the clock. The sum is
    not clipped to the box of the controller's torques. The bound is in the controls' unit.

    **Raises:** `ParameterError` for a bound that is not positive, and for times that hold no torque.
    """

    bound: float
    seconds: float = 2.0
    hold: int = 5
    x0: tuple[float, ...] | None = None
    """Where it starts; `None` for the plant's start."""

    def __post_init__(self):
        if not 0 < self.bound < math.inf:
            raise ParameterError(f"the bound of a torque must be a positive number, but it is {self.bound!r}")
        if self.hold < 1 or not self.hold * CONTROL_DT <= self.seconds < math.inf:
            raise ParameterError(
                f"torques held for {self.hold} control steps do not fit into {self.seconds} s; hold each for "
                "at least one, and disturb for at least as long"
            )

    @property
    def count(self) -> int:
        """How many torques each actuator gets."""
        return int(self.seconds / CONTROL_DT + 0.5) // self.hold

    def size(self, plant: Plant) -> int:
        """n."""
        return len(plant.control_names) * self.count

    def sentence(self, plant: Plant) -> str:
        """The perturbation in words."""
        bound = f"{self.bound:g} {control_unit(plant)}".rstrip()
        return (
            f"torques of at most {bound} added at {in_a_row(actuators(plant))} in the first "
            f"{self.seconds:g} s, each held for {self.hold * CONTROL_DT:g} s"
        )

    def at(self, plant: Plant, points: Points) -> tuple[Starts, Controls]:
        """The starts, all the same one, and the disturbances at points of the cube."""
        torques = self.bound * points.reshape(-1, self.count, len(plant.control_names))
        start = np.array(plant.start if self.x0 is None else self.x0)
        return np.tile(start, (len(points), 1)), np.repeat(torques, self.hold, axis=1)


Perturbation = StartBox | SectionBox | HeldTorques


def usual_perturbations(plant: Plant, section_point: Sequence[float] | None) -> tuple[Perturbation, ...]:
    """The perturbations with which a passport searches for falls.

    **Arguments:** `section_point`, where the gait is right after touchdown, or `None` if there is none; then
    no box of the section is searched.
    """
    known = plant.disturbances()
    found: list[Perturbation] = []
    if plant.start_box:
        found.append(StartBox(plant.start_box, plant.start))
    if section_point is not None and known.section_half_widths:
        found.append(SectionBox(known.section_half_widths, tuple(map(float, section_point))))
    return (*found, HeldTorques(known.control_bound, x0=plant.start))


def _undisturbed(plant: Plant, points: Points) -> Controls:
    return np.zeros((len(points), 1, len(plant.control_names)))


def _checked_size(centre: Sequence[float], expected: int, what: str, plant: Plant) -> int:
    if len(centre) != expected:
        raise ParameterError(
            f"the {what} of {plant.name} has {expected} coordinates, but the box has {len(centre)}"
        )
    return expected


def _check_box(centre: Sequence[float], half_widths: Sequence[float]) -> None:
    if not all(map(math.isfinite, (*centre, *half_widths))):
        raise ParameterError(f"a box needs finite numbers, got {centre} ± {half_widths}")
    if min(half_widths) < 0 or not any(half_widths):
        raise ParameterError(
            f"a box's half-widths must not be negative, and not all zero, but they are {half_widths}"
        )


def _numbers(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
