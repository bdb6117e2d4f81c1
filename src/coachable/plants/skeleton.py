"""What of a robot is drawn: segments and point masses, between and at named points in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion


@dataclass(frozen=True)
class Segment:
    """A straight part of a robot, from one of its points to another."""

    ends: tuple[str, str]
    """Names of the points that it joins."""
    leg: int | None = None
    """The leg that it belongs to, as `Skeleton` numbers legs; `None` for the body."""


@dataclass(frozen=True)
class PointMass:
    """A mass concentrated at one of a robot's points."""

    point: str
    """Name of the point."""
    mass: float
    """[kg]"""
    leg: int | None = None
    """The leg that it belongs to, as `Skeleton` numbers legs; `None` for the body."""


Part = Segment | PointMass


@dataclass(frozen=True)
class Skeleton:
    """What of a robot is drawn, in any state; `Plant.kinematics` gives where its points are.

    Legs are numbered by when they stand: leg 0 is the stance leg, leg k the one that stands after k further
    touchdowns. A touchdown renumbers them, leg k becomes leg k − 1 and the stance leg the last one. A walker
    with two legs has the stance leg 0 and the swing leg 1, which exchange their roles; of a rimless wheel
    every spoke is a leg; a hopper has the one leg 0.

    **Raises:** `ParameterError` if a part refers to a point that the robot does not have, the legs' numbers
    leave one out, or a mass or the height is not positive and finite.
    """

    points: tuple[str, ...]
    """Names of the points, in the order in which `Plant.kinematics` returns them."""
    base: str
    """The point at `Plant.base`: its path is drawn, and the camera follows it."""
    segments: tuple[Segment, ...]
    height: float
    """How high the robot reaches when it stands [m]: the scale of a picture."""
    masses: tuple[PointMass, ...] = ()

    def __post_init__(self):
        named = [self.base, *(mass.point for mass in self.masses)]
        for name in named + [end for segment in self.segments for end in segment.ends]:
            if name not in self.points:
                raise ParameterError(f"the skeleton has no point {name!r}; {suggestion(name, self.points)}")
        legs = {part.leg for part in self.parts if part.leg is not None}
        if legs != set(range(len(legs))):
            raise ParameterError(f"legs are numbered 0, 1, …, but these parts have legs {sorted(legs)}")
        for what, value in [("height", self.height), *(("mass", mass.mass) for mass in self.masses)]:
            if not (math.isfinite(value) and value > 0):
                raise ParameterError(f"the {what} must be positive and finite, got {value}")

    @property
    def num_legs(self) -> int:
        """How many legs take turns to stand."""
        return len({part.leg for part in self._unordered if part.leg is not None})

    @property
    def parts(self) -> tuple[Part, ...]:
        """All parts from back to front: the last leg … the stance leg, the body; masses over segments."""
        by_depth = sorted(self._unordered, key=lambda part: math.inf if part.leg is None else -part.leg)
        return tuple(by_depth)

    @property
    def largest_mass(self) -> float:
        """[kg]; masses are drawn relative to it. 0 without masses."""
        return max((mass.mass for mass in self.masses), default=0.0)

    @property
    def _unordered(self) -> tuple[Part, ...]:
        return (*self.segments, *self.masses)

    def stands_first(self, leg: int | None, touchdowns: int) -> bool:
        """Whether a leg, numbered as after so many touchdowns, is the one that stood before all of them.

        The body counts as standing first.
        """
        return leg is None or (leg + touchdowns) % self.num_legs == 0

    def place(self, name: str) -> int:
        """The index of a point in what `Plant.kinematics` returns."""
        return self.points.index(name)
