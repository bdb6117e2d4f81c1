"""The frames of a film: the robot on the ground, the camera with it, its phase by colour and name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from coachable.drawing.motion import Motion, runs_of
from coachable.drawing.pen import FINER, Pen
from coachable.drawing.stage import HEIGHT, WIDTH, NamedPhase, Stage, blank_page, draw_words
from coachable.foundation.style import FAINT, HAIRLINE, INK, PAGE, phase_colours

_STRIP_LEFT, _STRIP_TOP, _STRIP_RIGHT, _STRIP_BOTTOM = 24.0, 326.0, 616.0, 338.0
"""The phases over time."""
_CAMERA_SECONDS = 0.35
"""Over which the camera's motion is smoothed."""
_TRACE_SECONDS = 1.2
"""How far back the base's path is shown."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A motion with all that its frames have in common."""

    motion: Motion
    phases: tuple[NamedPhase, ...]
    camera: Float[np.ndarray, " samples"]
    """The x in the middle of the picture [m]."""
    backdrop: Image.Image
    """What never moves: the page, the title, and the phases over time."""

    @staticmethod
    def of(motion: Motion, phases: Sequence[NamedPhase], title: str = "") -> Scene:
        """The scene of a motion with the phases of its behaviour, and a title that distinguishes it."""
        spacing = motion.seconds / max(1, len(motion.time) - 1) or 1.0
        # Wider than the whole motion, the filter only takes longer: some walkers fall within a microsecond.
        width = min(_CAMERA_SECONDS / spacing, 10.0 * len(motion.time))
        camera = gaussian_filter1d(motion.base[:, 0], width, mode="nearest")
        return Scene(motion, tuple(phases), camera, _backdrop(motion, phases, title))

    def stage(self, sample: int) -> Stage:
        """Where the camera looks at a sample."""
        return Stage(self.motion.skeleton, float(self.camera[sample]))

    def frame(self, time: float) -> Image.Image:
        """The picture at a time [s]."""
        motion = self.motion
        sample = motion.at(time)
        stage, image = self.stage(sample), self.backdrop.copy()
        pen = Pen(image)
        self._draw_where_it_was(pen, stage, sample)
        stage.draw_robot(pen, motion.points[sample], int(motion.touchdowns[sample]))
        stage.draw_ground(image, self.backdrop)
        phase, time, base_x = motion.phase[sample], motion.time[sample], motion.base[sample, 0]
        draw_words(pen, self.phases, int(phase), float(time), float(base_x))
        now = _along_strip(motion, sample)
        pen.box(now - 1, _STRIP_TOP - 4, now + 1, _STRIP_BOTTOM + 4, INK)
        return image.reduce(FINER)

    def _draw_where_it_was(self, pen: Pen, stage: Stage, sample: int) -> None:
        """The base's path, and the places where feet stood."""
        motion = self.motion
        start = motion.at(motion.time[sample] - _TRACE_SECONDS)
        pen.line([stage.place(point) for point in motion.base[start : sample + 1]], 2, HAIRLINE)
        for earlier in np.unique(motion.foot_x[: sample + 1]):
            pen.disc(stage.place(np.array([earlier, 0.0])), 5, HAIRLINE)


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
        """The picture at a time [s]; a motion that has ended stays as it ended."""
        sheet = Image.new("RGB", self.size, PAGE)
        for place, scene in enumerate(self.scenes):
            row, column = divmod(place, self.columns)
            sheet.paste(scene.frame(time), (WIDTH * column, HEIGHT * row))
        return sheet


def _backdrop(motion: Motion, phases: Sequence[NamedPhase], title: str) -> Image.Image:
    image = blank_page()
    pen, colours = Pen(image), phase_colours(len(phases))
    pen.text((24, 62), title, 13, FAINT, "lm", bold=True)
    for phase, start, stop in runs_of(motion.phase):
        pen.box(
            _along_strip(motion, start),
            _STRIP_TOP,
            _along_strip(motion, stop),
            _STRIP_BOTTOM,
            colours[phase],
        )
    return image


def _along_strip(motion: Motion, sample: int) -> float:
    """Where a sample is on the strip of phases over time."""
    return _STRIP_LEFT + (_STRIP_RIGHT - _STRIP_LEFT) * motion.progress(sample)
