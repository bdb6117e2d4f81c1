"""A picture of a robot at one instant, in layers: the robot, the ground over it, the words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from PIL import Image

from coachable.drawing.pen import FINER, Pen, Point
from coachable.foundation.style import FAINT, INK, PAGE, STANCE, SWING, phase_colours
from coachable.plants.skeleton import Segment, Skeleton

SIZE = WIDTH, HEIGHT = 640, 360
"""Of a picture [pixels]."""

_HEIGHT = 196
"""Of a robot that stands [pixels]."""
_GROUND = 284
"""Of the ground line, from the top [pixels]."""


@runtime_checkable
class NamedPhase(Protocol):
    """A phase of a behaviour, as far as pictures are concerned."""

    @property
    def name(self) -> str:
        """Short, such as `O1`."""
        ...

    @property
    def title(self) -> str:
        """For people."""
        ...


@dataclass(frozen=True)
class Stage:
    """Where the camera looks, and what of the robot is drawn there."""

    skeleton: Skeleton
    camera: float
    """The x in the middle of the picture [m]."""

    def place(self, point: Float[np.ndarray, "2"]) -> Point:
        """Where a point [m] is in the picture."""
        scale = _HEIGHT / self.skeleton.height
        x, y = point
        return WIDTH / 2 + scale * (float(x) - self.camera), _GROUND - scale * float(y)

    def draw_robot(self, pen: Pen, points: Float[np.ndarray, "points 2"], touchdowns: int) -> None:
        """The robot with its points there [m], after so many touchdowns.

        The stance leg is blue, the others orange, the body black. Masses are hollow on every leg but the one
        that stood first.
        """
        skeleton = self.skeleton
        for part in skeleton.parts:
            colour = leg_colour(part.leg)
            if isinstance(part, Segment):
                ends = [self.place(points[skeleton.place(end)]) for end in part.ends]
                pen.line(ends, 6, colour)
                continue
            at, radius = self.place(points[skeleton.place(part.point)]), self._radius(part.mass)
            pen.disc(at, radius, colour)
            if not skeleton.stands_first(part.leg, touchdowns) and radius > 3:
                pen.disc(at, radius - 3, PAGE)

    def draw_ground(self, image: Image.Image, backdrop: Image.Image) -> None:
        """The ground, with a mark every half metre, and the backdrop below it.

        Legs without knees scuff through the ground as they swing: what is below is covered.
        """
        below = FINER * _GROUND
        image.paste(backdrop.crop((0, below, *backdrop.size)), (0, below))
        pen = Pen(image)
        pen.box(0, _GROUND, WIDTH, _GROUND + 1.67, INK)
        half = WIDTH / 2 / _HEIGHT * self.skeleton.height
        left, right = self.camera - half, self.camera + half
        for x in np.arange(np.floor(2 * left) / 2, right + 0.5, 0.5):
            at, _ = self.place(np.array([x, 0.0]))
            whole = x == round(x)
            pen.box(at - 0.67, _GROUND, at + 0.67, _GROUND + (8 if whole else 5), INK)
            if whole:
                pen.text((at, _GROUND + 12), f"{x:.0f} m".replace("-", "−"), 11, FAINT, "ma")

    def _radius(self, mass: float) -> float:
        """Of a point mass in the picture [pixels]: areas are as the masses."""
        return 12 * (mass / self.skeleton.largest_mass) ** 0.5


def leg_colour(leg: int | None) -> str:
    """Of a part on this leg, as `Skeleton` numbers legs: the stance leg's, another leg's, or the body's."""
    return INK if leg is None else STANCE if leg == 0 else SWING


def draw_words(pen: Pen, phases: Sequence[NamedPhase], phase: int, time: float, base_x: float) -> None:
    """The phase by colour and name, the time [s] and the distance [m]; phase K is outside all K phases."""
    inside = phase < len(phases)
    name, title = (phases[phase].name, phases[phase].title) if inside else ("–", "in no phase")
    pen.box(24, 20, 68, 46, phase_colours(len(phases))[phase], corner=6)
    pen.text((46, 33), name, 14, INK, "mm", bold=True)
    pen.text((78, 33), title, 13, INK, "lm")
    pen.text((616, 33), f"{base_x:.2f} m".replace("-", "−"), 14, INK, "rm")
    pen.text((536, 33), f"{time:.2f} s", 14, INK, "rm")


def blank_page() -> Image.Image:
    """An empty picture, as large as the pen wants it."""
    return Image.new("RGB", (FINER * WIDTH, FINER * HEIGHT), PAGE)


def draw_instant(
    skeleton: Skeleton,
    points: Float[np.ndarray, "points 2"],
    touchdowns: int,
    phases: Sequence[NamedPhase],
    phase: int,
    time: float,
) -> Image.Image:
    """The robot at one instant, the camera on its base.

    **Arguments:** `points`, (x, z) of each of the skeleton's points [m]; `touchdowns`, how many there were;
    `phases` of the behaviour, in its order; `phase`, the present one, K outside all K phases; `time` [s].
    """
    base_x = float(points[skeleton.place(skeleton.base), 0])
    stage, image = Stage(skeleton, base_x), blank_page()
    stage.draw_robot(Pen(image), points, touchdowns)
    stage.draw_ground(image, blank_page())
    draw_words(Pen(image), phases, phase, time, base_x)
    return image.reduce(FINER)
