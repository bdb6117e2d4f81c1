"""Two-dimensional slices of a basin through the gait, as a picture."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from coachable.foundation.style import BAD, GOOD, HAIRLINE, INK, PAGE, drawing, save
from coachable.verification.robustness.basin import LABELS, ON_SECTION, SECONDS

RESOLUTION = 61
"""Starts along each side of a slice."""

_AXES = ("β [rad]", "θ̇₁ [rad/s]", "θ̇₂ [rad/s]")
_COLOURS = (GOOD, PAGE, HAIRLINE)
_HATCHES = {"fell": "xxxx", "undecided": "...."}


@dataclass(frozen=True, eq=False)
class Slice:
    """A grid of starts in one plane of the section through a point of the gait."""

    across: int
    """Number of the coordinate along x."""
    up: int
    """Likewise along y."""
    starts: Float[np.ndarray, "starts 4"]
    """Row by row, y growing."""


def slices(gait_point: Float[np.ndarray, "3"]) -> tuple[Slice, ...]:
    """The three planes through a point of the gait, in the box `ON_SECTION`."""
    sides = [np.linspace(low, high, RESOLUTION) for low, high in ON_SECTION]
    made = []
    for across, up in combinations(range(3), 2):
        y = np.tile(np.asarray(gait_point, np.float64), (RESOLUTION, RESOLUTION, 1))
        y[..., across], y[..., up] = np.meshgrid(sides[across], sides[up])
        beta, dtheta_1, dtheta_2 = y.reshape(-1, 3).T
        made.append(Slice(across, up, np.stack([beta, -beta, dtheta_1, dtheta_2], axis=-1)))
    return tuple(made)


def draw_slices(
    path: Path,
    title: str,
    gait: Float[np.ndarray, "points 3"],
    labelled: list[tuple[Slice, Int[np.ndarray, " starts"]]],
) -> None:
    """Draw what became of the starts in each slice, and where the gait passes it."""
    with drawing():
        figure = Figure(figsize=(7.16, 2.9), layout="constrained")
        figure.suptitle(f"{title}: after {SECONDS:g} s", x=0.01, ha="left", fontsize=8.5, fontweight="bold")
        for axes, (plane, labels) in zip(figure.subplots(1, 3), labelled, strict=True):
            grid = labels.reshape(RESOLUTION, RESOLUTION)
            (left, right), (low, high) = ON_SECTION[plane.across], ON_SECTION[plane.up]
            axes.imshow(
                grid,
                origin="lower",
                extent=(left, right, low, high),
                aspect="auto",
                cmap=ListedColormap(list(_COLOURS)),
                vmin=-0.5,
                vmax=len(LABELS) - 0.5,
                interpolation="nearest",
            )
            across, up = np.linspace(left, right, RESOLUTION), np.linspace(low, high, RESOLUTION)
            for name, hatch in _HATCHES.items():
                mask = grid == LABELS.index(name)
                if mask.any():
                    colour = BAD if name == "fell" else INK
                    filled = axes.contourf(across, up, mask, [0.5, 1.5], colors="none", hatches=[hatch])
                    filled.set_edgecolor(colour)
                    filled.set_linewidth(0.0)
            axes.plot(gait[:, plane.across], gait[:, plane.up], "o", ms=4, mfc=PAGE, mec=INK, mew=1.0)
            axes.set(xlabel=_AXES[plane.across], ylabel=_AXES[plane.up], xlim=(left, right), ylim=(low, high))
        handles = [Patch(facecolor=GOOD, label="reached the gait")]
        for name, hatch in _HATCHES.items():
            colour = BAD if name == "fell" else INK
            handles.append(Patch(facecolor=PAGE, edgecolor=colour, hatch=hatch, linewidth=0.4, label=name))
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
    save(figure, path)
