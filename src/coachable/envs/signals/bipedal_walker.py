"""The signals of Gymnasium's BipedalWalker, from the bodies of its Box2D world."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from coachable.behaviours.predicates import Signal
from coachable.envs.signals.probes import Probe, Reading, ReadingOf, angle, probe

_LEFT, _RIGHT = 0, 1


class BipedalWalkerSimulation:
    """A BipedalWalker: its hull, and two legs of a thigh and a shank.

    It walks to the right of the picture, so the leg that is drawn behind the other one is its left leg. The
    environment keeps it first. A reset makes all bodies anew, so they are asked for at every reading.
    Contacts are those that the last step began with, as Box2D has them.
    """

    def __init__(self, env: gymnasium.Env):
        self._env: Any = env.unwrapped

    def is_of(self, env: gymnasium.Env) -> bool:
        """Whether it is this environment's."""
        return self._env is env.unwrapped

    def look(self) -> None:
        """Nothing is kept, so there is nothing to do."""

    @property
    def hull(self) -> Any:
        """The torso."""
        return self._env.hull

    def hip(self, leg: int) -> Any:
        """The joint between hull and thigh."""
        return self._env.joints[2 * leg]

    def thigh(self, leg: int) -> Any:
        """The upper leg."""
        return self._env.legs[2 * leg]

    def shank(self, leg: int) -> Any:
        """The lower leg, which ends as the foot."""
        return self._env.legs[2 * leg + 1]

    def corners(self, leg: int) -> np.ndarray:
        """The corners of the shank in the world, (x, y) [m]."""
        shank = self.shank(leg)
        return np.array([shank.transform * corner for corner in shank.fixtures[0].shape.vertices])

    def foot(self, leg: int) -> np.ndarray:
        """The middle of the shank's lower end in the world, (x, y) [m]."""
        low = min(y for _, y in self.shank(leg).fixtures[0].shape.vertices)
        return np.array(self.shank(leg).transform * (0.0, low))

    def ground(self, x: Any) -> Any:
        """The height of the ground [m]; of its slopes, not of what stands on it in the hardcore version."""
        return np.interp(x, self._env.terrain_x, self._env.terrain_y)


def _hull_x(walker: BipedalWalkerSimulation) -> Reading:
    return lambda: float(walker.hull.worldCenter[0])


def _hull_height(walker: BipedalWalkerSimulation) -> Reading:
    return lambda: float(walker.hull.worldCenter[1] - walker.ground(walker.hull.worldCenter[0]))


def _contact(leg: int) -> ReadingOf:
    # The environment's own flag goes out where a foot leaves one piece of the ground for the next.
    def of(walker: BipedalWalkerSimulation) -> Reading:
        return lambda: float(any(edge.contact.touching for edge in walker.shank(leg).contacts))

    return of


def _feet_down(walker: BipedalWalkerSimulation) -> Reading:
    readings = [_contact(leg)(walker) for leg in (_LEFT, _RIGHT)]
    return lambda: sum(reading() for reading in readings) / len(readings)


def _foot_x(leg: int) -> ReadingOf:
    def of(walker: BipedalWalkerSimulation) -> Reading:
        return lambda: float(walker.foot(leg)[0] - walker.hip(leg).anchorA[0])

    return of


def _foot_height(leg: int) -> ReadingOf:
    def of(walker: BipedalWalkerSimulation) -> Reading:
        def reading() -> float:
            x, y = walker.corners(leg).T
            return float(np.min(y - walker.ground(x)))

        return reading

    return of


def _leg(side: str, leg: int) -> tuple[Probe, ...]:
    # A joint's own angle counts from how the leg stood at first, which is 0.1 rad apart for the two legs.
    return (
        *angle(
            f"{side}_hip",
            "positive: flexed, the thigh in front",
            lambda walker: lambda: float(walker.thigh(leg).angle - walker.hull.angle),
            lambda walker: lambda: float(walker.thigh(leg).angularVelocity - walker.hull.angularVelocity),
        ),
        *angle(
            f"{side}_knee",
            "positive: flexed, the shank behind the thigh",
            lambda walker: lambda: float(walker.thigh(leg).angle - walker.shank(leg).angle),
            lambda walker: (
                lambda: float(walker.thigh(leg).angularVelocity - walker.shank(leg).angularVelocity)
            ),
        ),
        probe(f"{side}_foot_contact", "", "1 while the shank touches the ground, else 0", _contact(leg)),
        probe(f"{side}_foot_x", "m", "how far the shank's lower end is ahead of the hip", _foot_x(leg)),
        probe(f"{side}_foot_height", "m", "of the shank's lowest point over the ground", _foot_height(leg)),
    )


BIPEDAL_WALKER = (
    probe("torso_x", "m", "where the hull's centre of mass is, forward from the edge of the world", _hull_x),
    probe("torso_height", "m", "of the hull's centre of mass over the ground beneath", _hull_height),
    Probe(
        Signal("forward_speed", "m/s", "of the hull, along x", "torso_x"),
        lambda walker: lambda: float(walker.hull.linearVelocity[0]),
    ),
    probe(
        "vertical_speed",
        "m/s",
        "of the hull; positive while it rises",
        lambda walker: lambda: float(walker.hull.linearVelocity[1]),
    ),
    *angle(
        "pitch",
        "positive: the hull leans forward, its nose down",
        lambda walker: lambda: -float(walker.hull.angle),
        lambda walker: lambda: -float(walker.hull.angularVelocity),
    ),
    *_leg("left", _LEFT),
    *_leg("right", _RIGHT),
    probe("feet_down", "", "share of the shanks that touch the ground, 0 to 1", _feet_down),
)
"""BipedalWalker: two legs with hips and knees, and no ankles."""
