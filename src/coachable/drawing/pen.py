"""Drawing with smooth edges: everything is drawn three times as large and then reduced."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import matplotlib as mpl
from PIL import Image, ImageDraw, ImageFont

FINER = 3

Pixels = float | int
"""A length in the finished picture."""

Point = tuple[Pixels, Pixels]
"""(x, y) from the top left of the finished picture [pixels]."""


class Pen:
    """Draws on an image that is `FINER` times as large as the finished picture."""

    def __init__(self, image: Image.Image):
        self._draw = ImageDraw.Draw(image)

    def line(self, points: Sequence[Point], width: Pixels, colour: str) -> None:
        """A line through the points with round joints and ends."""
        fine = [(FINER * x, FINER * y) for x, y in points]
        self._draw.line(fine, fill=colour, width=round(FINER * width), joint="curve")
        for end in (points[0], points[-1]):
            self.disc(end, width / 2, colour)

    def disc(self, centre: Point, radius: Pixels, colour: str) -> None:
        """A filled circle."""
        x, y, r = FINER * centre[0], FINER * centre[1], FINER * radius
        self._draw.ellipse([x - r, y - r, x + r, y + r], fill=colour)

    def box(
        self, left: Pixels, top: Pixels, right: Pixels, bottom: Pixels, colour: str, *, corner: Pixels = 0.0
    ) -> None:
        """A filled rectangle with rounded corners. One that is thinner than a pixel still shows."""
        corners = [FINER * left, FINER * top, max(FINER * left, FINER * right - 1), FINER * bottom - 1]
        self._draw.rounded_rectangle(corners, FINER * corner, fill=colour)

    def text(
        self, at: Point, text: str, size: Pixels, colour: str, anchor: str, *, bold: bool = False
    ) -> float:
        """Text at a point, `anchor` as in Pillow; returns its width."""
        font = _font(round(FINER * size), bold)
        self._draw.text((FINER * at[0], FINER * at[1]), text, fill=colour, font=font, anchor=anchor)
        return font.getlength(text) / FINER


@cache
def _font(pixels: int, bold: bool) -> ImageFont.FreeTypeFont:
    # Matplotlib brings the font, so that pictures look the same on every machine.
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(mpl.get_data_path()) / "fonts" / "ttf" / name, pixels)
