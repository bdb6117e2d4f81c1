"""A picture of the walker at one instant, in layers: the walker, the ground over it, the words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from PIL import Image

from coachable.drawing.pen import FINER, Pen, Point
from coachable.drawing.pose import Pose
from coachable.foundation.style import FAINT, INK, PAGE, STANCE, SWING, phase_colours
from coachable.plants.compass import CompassParameters

SIZE = WIDTH, HEIGHT = 640, 360
"""Of a picture [pixels]."""

_LEG = 196
"""Length of a leg [pixels]."""
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
    """Where the camera looks, and who walks there."""

    parameters: CompassParameters
    camera: float
    """The x in the middle of the picture [m]."""

    def place(self, point: Float[np.ndarray, "2"]) -> Point:
        """Where a point [m] is in the picture."""
        scale = _LEG / self.parameters.leg_length
        x, y = point
        return WIDTH / 2 + scale * (float(x) - self.camera), _GROUND - scale * float(y)

    def draw_walker(self, pen: Pen, pose: Pose, first_leg_stands: bool) -> None:
        """The stance leg blue, the swing leg orange; the first leg's mass filled, the other's hollow."""
        hip, leg_radius = self.place(pose.hip), self._radius(self.parameters.leg_mass)
        for foot, mass, colour, is_first in (
            (pose.swing_foot, pose.swing_mass, SWING, not first_leg_stands),
            (pose.stance_foot, pose.stance_mass, STANCE, first_leg_stands),
        ):
            pen.line([self.place(foot), hip], 6, colour)
            pen.disc(self.place(mass), leg_radius, colour)
            if not is_first:
                pen.disc(self.place(mass), leg_radius - 3, PAGE)
        pen.disc(hip, self._radius(self.parameters.hip_mass), INK)

    def draw_ground(self, image: Image.Image, backdrop: Image.Image) -> None:
        """The ground, with a mark every half metre, and the backdrop below it.

        The model has no knees, its swing leg scuffs through the ground: what is below is covered.
        """
        below = FINER * _GROUND
        image.paste(backdrop.crop((0, below, *backdrop.size)), (0, below))
        pen = Pen(image)
        pen.box(0, _GROUND, WIDTH, _GROUND + 1.67, INK)
        half = WIDTH / 2 / _LEG * self.parameters.leg_length
        left, right = self.camera - half, self.camera + half
        for x in np.arange(np.floor(2 * left) / 2, right + 0.5, 0.5):
            at, _ = self.place(np.array([x, 0.0]))
            whole = x == round(x)
            pen.box(at - 0.67, _GROUND, at + 0.67, _GROUND + (8 if whole else 5), INK)
            if whole:
                pen.text((at, _GROUND + 12), f"{x:.0f} m".replace("-", "−"), 11, FAINT, "ma")

    def _radius(self, mass: float) -> float:
        """Of a point mass in the picture [pixels]: areas are as the masses."""
        return 12 * (mass / max(self.parameters.hip_mass, self.parameters.leg_mass)) ** 0.5


def draw_words(pen: Pen, phases: Sequence[NamedPhase], phase: int, time: float, hip_x: float) -> None:
    """The phase by colour and name, the time [s] and the distance [m]; phase K is outside all K phases."""
    inside = phase < len(phases)
    name, title = (phases[phase].name, phases[phase].title) if inside else ("–", "in no phase")
    pen.box(24, 20, 68, 46, phase_colours(len(phases))[phase], corner=6)
    pen.text((46, 33), name, 14, INK, "mm", bold=True)
    pen.text((78, 33), title, 13, INK, "lm")
    pen.text((616, 33), f"{hip_x:.2f} m".replace("-", "−"), 14, INK, "rm")
    pen.text((536, 33), f"{time:.2f} s", 14, INK, "rm")


def blank_page() -> Image.Image:
    """An empty picture, as large as the pen wants it."""
    return Image.new("RGB", (FINER * WIDTH, FINER * HEIGHT), PAGE)


def draw_instant(
    pose: Pose,
    first_leg_stands: bool,
    phases: Sequence[NamedPhase],
    phase: int,
    time: float,
    parameters: CompassParameters,
) -> Image.Image:
    """The walker at one instant, the camera on its hip."""
    stage, image = Stage(parameters, float(pose.hip[0])), blank_page()
    stage.draw_walker(Pen(image), pose, first_leg_stands)
    stage.draw_ground(image, blank_page())
    draw_words(Pen(image), phases, phase, time, float(pose.hip[0]))
    return image.reduce(FINER)
