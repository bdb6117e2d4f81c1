"""An SVG picture as PNG, with neither a browser nor Graphviz."""

from __future__ import annotations

from pathlib import Path


def svg_to_png(svg: str, scale: float = 2.0) -> bytes:
    """The picture as PNG, in a font that is always there, so equal pictures are equal on every machine.

    resvg draws it; it has no fonts of its own, so it uses the DejaVu Sans that comes with Matplotlib.

    **Arguments:** `scale`: pixels a unit of the SVG.
    """
    import matplotlib
    import resvg_py

    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return resvg_py.svg_to_bytes(
        svg_string=svg,
        zoom=scale,
        skip_system_fonts=True,
        font_family="DejaVu Sans",
        sans_serif_family="DejaVu Sans",
        font_files=[str(fonts / f"DejaVuSans{weight}.ttf") for weight in ("", "-Bold")],
    )
