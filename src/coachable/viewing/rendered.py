"""Frames of a robot's walk: what it looks like, the phase, the time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from PIL import Image

from coachable.drawing.motion import runs_of
from coachable.drawing.pen import FINER, Pen
from coachable.drawing.stage import NamedPhase
from coachable.foundation.errors import CoachableError
from coachable.foundation.style import FAINT, INK, PAGE, phase_colours
from coachable.viewing.animation import write_film
from coachable.viewing.side_view import SIDE

_WORDS = 56
"""Height of what is below it: the phase, and the phases over time."""
_MARGIN = 12


@runtime_checkable
class Rendered(Protocol):
    """A walk, and what it looks like."""

    @property
    def title(self) -> str:
        """What distinguishes it from others."""
        ...

    @property
    def time(self) -> np.ndarray:
        """Of every picture [s]."""
        ...

    def picture(self, sample: int) -> Image.Image:
        """What it looks like at a sample."""
        ...

    @property
    def phase(self) -> np.ndarray:
        """Location in the behaviour: 0 … K−1, or K outside all K phases."""
        ...


def draw_rendered(walks: Sequence[Rendered], path: Path, phases: Sequence[NamedPhase]) -> None:
    """Write walks side by side as a film in real time.

    **Raises:** as `write_film`.
    """
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise CoachableError(f"{path.name}: of a robot in its own environment there are films, .gif and .mp4")
    scenes = tuple(RenderedScene(walk, tuple(phases)) for walk in walks)
    write_film(path, RenderedFilm(scenes), 0.0, max(float(walk.time[-1]) for walk in walks))


@dataclass(frozen=True, eq=False)
class RenderedScene:
    """A walk with the phases of its behaviour."""

    walk: Rendered
    phases: tuple[NamedPhase, ...]

    def frame(self, time: float) -> Image.Image:
        """The picture at a time [s]; a walk that has ended stays as it ended."""
        sample = max(0, int(np.searchsorted(self.walk.time, time + 1e-6, side="right")) - 1)
        sheet = Image.new("RGB", (SIDE, SIDE + _WORDS), PAGE)
        picture = self.walk.picture(sample)
        picture.thumbnail((SIDE, SIDE), Image.Resampling.LANCZOS)
        sheet.paste(picture, ((SIDE - picture.width) // 2, (SIDE - picture.height) // 2))
        sheet.paste(self._words(sample), (0, SIDE))
        return sheet

    def _words(self, sample: int) -> Image.Image:
        words = Image.new("RGB", (FINER * SIDE, FINER * _WORDS), PAGE)
        pen, colours = Pen(words), phase_colours(len(self.phases))
        location = int(self.walk.phase[sample])
        inside = location < len(self.phases)
        title = (self.phases[location].title or self.phases[location].name) if inside else "in no phase"
        pen.box(_MARGIN, 8, _MARGIN + 16, 24, colours[location], corner=4)
        pen.text((_MARGIN + 24, 16), title, 12, INK, "lm")
        pen.text((SIDE - _MARGIN, 16), f"{self.walk.time[sample]:.2f} s", 12, INK, "rm")
        count = max(1, len(self.walk.phase))
        width = SIDE - 2 * _MARGIN
        for phase, start, stop in runs_of(self.walk.phase):
            left, right = (_MARGIN + width * index / count for index in (start, stop))
            pen.box(left, 34, right, 42, colours[phase])
        now = _MARGIN + width * sample / count
        pen.box(now - 1, 32, now + 1, 44, INK)
        pen.text((SIDE / 2, 50), self.walk.title, 10, FAINT, "mm")
        return words.reduce(FINER)


@dataclass(frozen=True, eq=False)
class RenderedFilm:
    """Scenes beside one another."""

    scenes: tuple[RenderedScene, ...]

    @property
    def size(self) -> tuple[int, int]:
        """Of a frame [pixels]."""
        return SIDE * len(self.scenes), SIDE + _WORDS

    def frame(self, time: float) -> Image.Image:
        """The picture at a time [s]."""
        sheet = Image.new("RGB", self.size, PAGE)
        for place, scene in enumerate(self.scenes):
            sheet.paste(scene.frame(time), (SIDE * place, 0))
        return sheet
