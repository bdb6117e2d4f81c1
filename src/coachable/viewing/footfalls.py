"""Footfall diagrams: when which foot is on the ground, walk by walk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coachable.drawing.motion import runs_of
from coachable.foundation.style import FAINT, INK, STANCE, SWING, drawing

WIDTH = 7.16
"""Both columns of a two-column page [in]."""
_PANEL = 0.62
"""Height of a panel [in]."""
_MOST = 5
"""Walks side by side; more of a setup go into further rows, so that their titles have room."""


@runtime_checkable
class Footfall(Protocol):
    """Of a walk, when its feet are on the ground."""

    @property
    def title(self) -> str:
        """What distinguishes it from others, and which gait it is."""
        ...

    @property
    def time(self) -> np.ndarray:
        """[s]"""
        ...

    @property
    def feet(self) -> Mapping[str, np.ndarray]:
        """By a foot's name, whether it is on the ground at each sample."""
        ...


def footfalls(rows: Mapping[str, Sequence[Footfall]], seconds: float = 2.0) -> Figure:
    """The last seconds of walks, setup by setup: a bar where a foot is on the ground.

    After Hildebrand's gait diagrams (Science 1965). A walk that was over sooner fills less of its panel.
    """
    parts = [
        ("" if first else setup, walks[first : first + _MOST])
        for setup, walks in rows.items()
        for first in range(0, len(walks), _MOST)
    ]
    columns = max(len(walks) for _, walks in parts)
    with drawing():
        figure = Figure(figsize=(WIDTH, len(parts) * _PANEL + 0.75), layout="constrained")
        grid = figure.subplots(len(parts), columns, squeeze=False, sharex=True)
        for row, (setup, walks) in enumerate(parts):
            for column, axes in enumerate(grid[row]):
                if column >= len(walks):
                    axes.set_axis_off()
                    continue
                _draw(axes, walks[column], seconds)
                if column == 0:
                    axes.set_ylabel(setup, rotation=0, ha="right", va="center", color=INK)
                    axes.set_yticklabels([*walks[column].feet][::-1])
        for axes in grid[-1]:
            axes.set_xlabel("time [s]")
    return figure


def _draw(axes: Axes, walk: Footfall, seconds: float) -> None:
    start = max(0, int(np.searchsorted(walk.time, walk.time[-1] - seconds)))
    time = walk.time[start:] - walk.time[start]
    step = time[1] - time[0] if len(time) > 1 else 0.0
    count = len(walk.feet)
    for place, (contact, colour) in enumerate(zip(walk.feet.values(), _colours(count), strict=True)):
        bars = [
            (time[begin], time[end - 1] + step - time[begin])
            for down, begin, end in runs_of(contact[start:].astype(int))
            if down
        ]
        axes.broken_barh(bars, (count - 1 - place - 0.36, 0.72), facecolor=colour, linewidth=0)
    axes.set(xlim=(0, seconds), ylim=(-0.6, count - 0.4), yticks=range(count), yticklabels=[""] * count)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.set_title(walk.title, fontsize=7, fontweight="normal", color=FAINT)


def _colours(count: int) -> tuple[str, ...]:
    # The left leg is orange and the right one blue, as in the pictures of robots.
    return (SWING, STANCE) if count == 2 else (STANCE,) * count
