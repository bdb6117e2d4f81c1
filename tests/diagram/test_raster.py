import io
import struct

import numpy as np
from PIL import Image

from coachable.diagram.draw import automaton_svg
from coachable.diagram.raster import svg_to_png
from tests.diagram.pictures import WALKING


def test_a_png_is_twice_as_large_and_the_same_each_time():
    svg = automaton_svg(WALKING)
    png = svg_to_png(svg)
    assert png == svg_to_png(svg)
    width, height = struct.unpack(">II", png[16:24])
    assert f'width="{width / 2:.0f}"' in svg
    assert f'height="{height / 2:.0f}"' in svg


def test_letters_are_drawn_without_any_font_of_the_system():
    words = '<svg xmlns="http://www.w3.org/2000/svg" width="120" height="30"><text y="20">θ₁ ≤ 0</text></svg>'
    image = np.asarray(Image.open(io.BytesIO(svg_to_png(words))).convert("RGBA"))
    assert (image[..., 3] > 128).sum() > 200
