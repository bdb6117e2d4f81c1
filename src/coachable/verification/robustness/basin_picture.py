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

from coachable.behaviours.notation import pretty_name
from coachable.foundation.style import BAD, GOOD, HAIRLINE, INK, PAGE, drawing, save
from coachable.plants.plant import Plant
from coachable.verification.gait.section import states_at
from coachable.verification.labels import section_units
from coachable.verification.robustness.basin import LABELS, SECONDS

RESOLUTION = 61
"""Starts along each side of a slice."""

_COLOURS = (GOOD, PAGE, HAIRLINE)
_HATCHES = {"fell": "xxxx", "undecided": "...."}


@dataclass(frozen=True, eq=False)
class Slice:
    """A grid of starts in one plane of the section through a point of the gait."""

    across: int
    """Number of the coordinate along x."""
    up: int
    """Likewise along y."""
    starts: Float[np.ndarray, "starts state"]
    """Row by row, y growing."""


def slices(plant: Plant, gait_point: Float[np.ndarray, " section"]) -> tuple[Slice, ...]:
    """The planes through a point of the gait along two coordinates each, in the plant's `section_box`."""
    sides = [np.linspace(low, high, RESOLUTION) for low, high in plant.section_box]
    made = []
    for across, up in combinations(range(len(sides)), 2):
        y = np.tile(np.asarray(gait_point, np.float64), (RESOLUTION, RESOLUTION, 1))
        y[..., across], y[..., up] = np.meshgrid(sides[across], sides[up])
        made.append(Slice(across, up, states_at(plant, y.reshape(-1, len(sides)))))
    return tuple(made)


def draw_slices(
    path: Path,
    title: str,
    plant: Plant,
    gait: Float[np.ndarray, "points section"],
    labelled: list[tuple[Slice, Int[np.ndarray, " starts"]]],
) -> None:
    """Draw what became of the starts in each slice, and where the gait passes it."""
    names = [
        pretty_name(name) + (f" [{unit}]" if unit else "")
        for name, unit in zip(plant.section_names, section_units(plant), strict=True)
    ]
    with drawing():
        figure = Figure(figsize=(7.16, 2.9), layout="constrained")
        figure.suptitle(f"{title}: after {SECONDS:g} s", x=0.01, ha="left", fontsize=8.5, fontweight="bold")
        panels = figure.subplots(1, len(labelled), squeeze=False)
        for axes, (plane, labels) in zip(panels.flat, labelled, strict=True):
            grid = labels.reshape(RESOLUTION, RESOLUTION)
            (left, right), (low, high) = plant.section_box[plane.across], plant.section_box[plane.up]
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
            axes.set(xlabel=names[plane.across], ylabel=names[plane.up], xlim=(left, right), ylim=(low, high))
        handles = [Patch(facecolor=GOOD, label="reached the gait")]
        for name, hatch in _HATCHES.items():
            colour = BAD if name == "fell" else INK
            handles.append(Patch(facecolor=PAGE, edgecolor=colour, hatch=hatch, linewidth=0.4, label=name))
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
    save(figure, path)
