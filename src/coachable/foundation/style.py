"""How every picture looks and is saved. The colours are told apart by colour-blind eyes (Okabe and Ito)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from coachable.foundation.files import written_beside

if TYPE_CHECKING:
    import matplotlib.figure

INK = "#222222"
FAINT = "#8c8c8c"
HAIRLINE = "#dedede"
PAGE = "#ffffff"

STANCE = "#0072b2"
SWING = "#e07b00"

GOOD = "#00795a"
BAD = "#c1440e"
"""For what holds and what falls; never told by colour alone."""

DARK_PAGE = "#14171b"

_OF_SETUP = {"sparse": "#7a7a7a", "forward": "#e69f00", "orthant": "#0072b2", "forward+orthant": "#009e73"}
_FURTHER_SETUPS = ("#cc79a7", "#56b4e9", "#d55e00", "#6a51a3", "#8c6d31", "#a50026", "#1b9e77", "#80b1d3")

_PHASES = ("#9ecae9", "#b5dfb0", "#f4dc8a", "#f7b6a0", "#d3bde6", "#a8e0d8")
OUTSIDE = "#d5d5d5"

PAID = "#00795a"
PUNISHED = "#b3482b"

DOTS_PER_INCH = 200


def setup_colours(names: Sequence[str]) -> dict[str, str]:
    """A colour for each reward setup: the paper's four keep theirs in every study, others follow in order."""
    others = [name for name in names if name not in _OF_SETUP]
    further = {name: _FURTHER_SETUPS[index % len(_FURTHER_SETUPS)] for index, name in enumerate(others)}
    return {name: _OF_SETUP.get(name) or further[name] for name in names}


def phase_colours(num_phases: int) -> tuple[str, ...]:
    """A light colour for each phase, with dark text readable on it; the last one is for outside them all."""
    return (*(_PHASES[index % len(_PHASES)] for index in range(num_phases)), OUTSIDE)


def on_dark(colour: str) -> str:
    """The colour for a dark page: the same hue, half way to white."""
    return _mixed(colour, PAGE, 0.42)


def dimmed(colour: str) -> str:
    """A light area's colour for a dark page, on which dark text stays readable."""
    return _mixed(colour, DARK_PAGE, 0.22)


def _mixed(colour: str, other: str, share: float) -> str:
    pairs = ((int(colour[i : i + 2], 16), int(other[i : i + 2], 16)) for i in (1, 3, 5))
    return "#" + "".join(f"{round((1 - share) * one + share * two):02x}" for one, two in pairs)


@contextmanager
def drawing() -> Iterator[None]:
    """Matplotlib settings for figures drawn inside the block; the caller's own are back after it."""
    import matplotlib as mpl

    with mpl.rc_context(
        {
            "font.family": "DejaVu Sans",
            "font.size": 8,
            "axes.titlesize": 8.5,
            "axes.titleweight": "bold",
            "axes.titlelocation": "left",
            "axes.labelcolor": INK,
            "axes.edgecolor": FAINT,
            "axes.linewidth": 0.6,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.axisbelow": True,
            "grid.color": HAIRLINE,
            "grid.linewidth": 0.5,
            "text.color": INK,
            "xtick.color": FAINT,
            "ytick.color": FAINT,
            "xtick.labelcolor": INK,
            "ytick.labelcolor": INK,
            "xtick.major.width": 0.6,
            "ytick.major.width": 0.6,
            "xtick.major.size": 3,
            "ytick.major.size": 3,
            "lines.linewidth": 1.4,
            "lines.solid_capstyle": "round",
            "legend.frameon": False,
            "figure.facecolor": PAGE,
            "savefig.facecolor": PAGE,
            "svg.fonttype": "path",
            "svg.hashsalt": "coachable",
        }
    ):
        yield


def save(figure: matplotlib.figure.Figure, path: Path) -> None:
    """Write a figure in the format of its suffix. Equal figures are equal bytes: no date, no random ids."""
    metadata = {
        ".svg": {"Date": None, "Creator": "coachable"},
        ".pdf": {"CreationDate": None, "Creator": "coachable"},
    }.get(path.suffix, {"Software": "coachable"})
    with drawing(), written_beside(path) as beside:
        figure.savefig(beside, format=path.suffix[1:].lower(), dpi=DOTS_PER_INCH, metadata=metadata)
