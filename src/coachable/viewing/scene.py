"""The frames of a film: the walker on the ground, the camera with it, its phase told by colour and name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from coachable.style import FAINT, HAIRLINE, INK, PAGE, STANCE, SWING, phase_colours
from coachable.viewing.pen import FINER, Pen, Point
from coachable.viewing.walk import NamedPhase, Walk, runs_of

SIZE = WIDTH, HEIGHT = 640, 360
"""Of a frame [pixels]."""

_LEG = 196
"""Length of a leg [pixels]."""
_GROUND = 284
"""Of the ground line, from the top [pixels]."""
_STRIP_LEFT, _STRIP_TOP, _STRIP_RIGHT, _STRIP_BOTTOM = 24.0, 326.0, 616.0, 338.0
"""The phases over time."""
_CAMERA_SECONDS = 0.35
"""Over which the camera's motion is smoothed."""
_TRACE_SECONDS = 1.2
"""How far back the hip's path is shown."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A walk with all that its frames have in common."""

    walk: Walk
    phases: tuple[NamedPhase, ...]
    camera: Float[np.ndarray, " samples"]
    """The x in the middle of the picture [m]."""
    backdrop: Image.Image
    """What never moves: the page, the title, and the phases over time."""

    @staticmethod
    def of(walk: Walk, phases: Sequence[NamedPhase], title: str = "") -> Scene:
        """The scene of a walk with the phases of its behaviour, and a title that tells it from others."""
        spacing = walk.seconds / max(1, len(walk.time) - 1) or 1.0
        camera = gaussian_filter1d(walk.hip[:, 0], _CAMERA_SECONDS / spacing, mode="nearest")
        return Scene(walk, tuple(phases), camera, _backdrop(walk, phases, title))

    def frame(self, time: float) -> Image.Image:
        """The picture at a time [s] of the walk."""
        sample = self.walk.at(time)
        image = self.backdrop.copy()
        pen = Pen(image)
        self._draw_walker(pen, sample)
        # The model has no knees, its swing leg scuffs through the ground: what is below is covered.
        below = FINER * _GROUND
        image.paste(self.backdrop.crop((0, below, *self.backdrop.size)), (0, below))
        self._draw_ground(pen, sample)
        self._draw_words(pen, sample)
        return image.reduce(FINER)

    def _place(self, point: Float[np.ndarray, "2"], sample: int) -> Point:
        """Where a point of the walk is in the picture."""
        scale = _LEG / self.walk.parameters.leg_length
        x, y = point
        return WIDTH / 2 + scale * (float(x) - self.camera[sample]), _GROUND - scale * float(y)

    def _draw_walker(self, pen: Pen, sample: int) -> None:
        walk, p = self.walk, self.walk.parameters
        start = walk.at(walk.time[sample] - _TRACE_SECONDS)
        pen.line([self._place(point, sample) for point in walk.hip[start : sample + 1]], 2, HAIRLINE)
        hip = self._place(walk.hip[sample], sample)
        for earlier in np.unique(walk.stance_foot[: sample + 1, 0]):
            pen.disc(self._place(np.array([earlier, 0.0]), sample), 5, HAIRLINE)
        first_stands = bool(walk.first_leg_stands[sample])
        for foot, mass, colour, is_first in (
            (walk.swing_foot, walk.swing_mass, SWING, not first_stands),
            (walk.stance_foot, walk.stance_mass, STANCE, first_stands),
        ):
            pen.line([self._place(foot[sample], sample), hip], 6, colour)
            pen.disc(self._place(mass[sample], sample), _radius(p.leg_mass, walk), colour)
            if not is_first:
                pen.disc(self._place(mass[sample], sample), _radius(p.leg_mass, walk) - 3, PAGE)
        pen.disc(hip, _radius(p.hip_mass, walk), INK)

    def _draw_ground(self, pen: Pen, sample: int) -> None:
        pen.box(0, _GROUND, WIDTH, _GROUND + 1.67, INK)
        half = WIDTH / 2 / _LEG * self.walk.parameters.leg_length
        left, right = self.camera[sample] - half, self.camera[sample] + half
        for x in np.arange(np.floor(2 * left) / 2, right + 0.5, 0.5):
            at, _ = self._place(np.array([x, 0.0]), sample)
            whole = x == round(x)
            pen.box(at - 0.67, _GROUND, at + 0.67, _GROUND + (8 if whole else 5), INK)
            if whole:
                pen.text((at, _GROUND + 12), f"{x:.0f} m".replace("-", "−"), 11, FAINT, "ma")

    def _draw_words(self, pen: Pen, sample: int) -> None:
        walk, index = self.walk, int(self.walk.phase[sample])
        colour = phase_colours(len(self.phases))[index]
        inside = index < len(self.phases)
        name, title = (self.phases[index].name, self.phases[index].title) if inside else ("–", "in no phase")
        pen.box(24, 20, 68, 46, colour, corner=6)
        pen.text((46, 33), name, 14, INK, "mm", bold=True)
        pen.text((78, 33), title, 13, INK, "lm")
        pen.text((616, 33), f"{walk.hip[sample, 0]:.2f} m".replace("-", "−"), 14, INK, "rm")
        pen.text((536, 33), f"{walk.time[sample]:.2f} s", 14, INK, "rm")
        now = _along_strip(walk, sample)
        pen.box(now - 1, _STRIP_TOP - 4, now + 1, _STRIP_BOTTOM + 4, INK)


@dataclass(frozen=True, eq=False)
class SideBySide:
    """Scenes beside and below one another in one picture, in the order of reading."""

    scenes: tuple[Scene, ...]

    @property
    def columns(self) -> int:
        """How many stand beside one another."""
        return math.ceil(math.sqrt(len(self.scenes)))

    @property
    def size(self) -> tuple[int, int]:
        """Of a frame [pixels]."""
        return WIDTH * self.columns, HEIGHT * math.ceil(len(self.scenes) / self.columns)

    def frame(self, time: float) -> Image.Image:
        """The picture at a time [s]; a walk that has ended stays as it ended."""
        sheet = Image.new("RGB", self.size, PAGE)
        for place, scene in enumerate(self.scenes):
            row, column = divmod(place, self.columns)
            sheet.paste(scene.frame(time), (WIDTH * column, HEIGHT * row))
        return sheet


def _backdrop(walk: Walk, phases: Sequence[NamedPhase], title: str) -> Image.Image:
    image = Image.new("RGB", (FINER * WIDTH, FINER * HEIGHT), PAGE)
    pen, colours = Pen(image), phase_colours(len(phases))
    pen.text((24, 62), title, 13, FAINT, "lm", bold=True)
    for phase, start, stop in runs_of(walk.phase):
        pen.box(
            _along_strip(walk, start), _STRIP_TOP, _along_strip(walk, stop), _STRIP_BOTTOM, colours[phase]
        )
    return image


def _along_strip(walk: Walk, sample: int) -> float:
    """Where a sample is on the strip of phases over time."""
    return _STRIP_LEFT + (_STRIP_RIGHT - _STRIP_LEFT) * walk.progress(sample)


def _radius(mass: float, walk: Walk) -> float:
    """Of a point mass in the picture [pixels]: areas are as the masses."""
    return 12 * (mass / max(walk.parameters.hip_mass, walk.parameters.leg_mass)) ** 0.5
