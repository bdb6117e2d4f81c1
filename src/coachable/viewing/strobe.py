"""A strobe picture: a few strides of a walk in one image, with the phases beneath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coachable.drawing.stage import NamedPhase
from coachable.foundation.style import FAINT, INK, PAGE, STANCE, SWING, drawing, phase_colours, save
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters
from coachable.viewing.walk import Walk, runs_of

WIDTH = 7.16
"""Both columns of a two-column page [in]."""
POSE_EVERY = 0.1
"""Time between two poses [s]."""
FAINTEST = 0.16
ABOVE = 1_000
"""Drawn over all poses."""

Colour = str | tuple[float, ...]


def strobe(
    trajectories: Mapping[str, object],
    phases: Sequence[NamedPhase],
    parameters: CompassParameters = PAPER_PARAMETERS,
    *,
    strides: int = 3,
) -> Figure:
    """Strobe pictures of walks by title, one below another at one scale.

    Of each walk the last `strides` whole strides and what comes after them, or all of it if there are fewer.
    A pose every 0.1 s, older ones fainter; the stance leg is blue and the swing leg orange, as in figure 3 of
    the paper. The leg masses are filled on one leg and hollow on the other, so that each can be followed
    through its steps. The strip beneath tells the phases over time, with a line at every touchdown.

    **Arguments:** each trajectory as in `Walk.of`; `phases` of the behaviour, in its order.
    """
    walks = {
        title: _last_strides(Walk.of(trajectory, parameters), strides)
        for title, trajectory in trajectories.items()
    }
    scale = parameters.leg_length
    extents = [_extent(walk, scale) for walk in walks.values()]
    length = max(right - left for left, right in extents)
    bottom, top = -0.31 * scale, (1.2 if any(walks) else 1.08) * scale
    with drawing():
        figure = Figure(figsize=(WIDTH, len(walks) * WIDTH * (top - bottom) / length))
        for row, (title, walk) in enumerate(walks.items()):
            left = sum(extents[row]) / 2 - length / 2
            axes = figure.add_axes((0, 1 - (row + 1) / len(walks), 1, 1 / len(walks)))
            axes.set(xlim=(left, left + length), ylim=(bottom, top))
            axes.set_axis_off()
            _draw_walk(axes, walk, phases, (left, left + length), bottom, scale)
            if title:
                write(axes, (left + 0.3 * scale, 1.18 * scale), title, INK, "top")
    return figure


def _draw_walk(
    axes: Axes,
    walk: Walk,
    phases: Sequence[NamedPhase],
    extent: tuple[float, float],
    bottom: float,
    scale: float,
) -> None:
    axes.plot(*walk.hip.T, color=FAINT, linewidth=0.8)
    poses = _poses(walk)
    for order, sample in enumerate(poses):
        age = 1 - (order + 1) / len(poses)
        _draw_pose(axes, walk, sample, FAINTEST + (1 - FAINTEST) * (1 - age) ** 2, 3 + order)
    left, right = extent
    _draw_ground(axes, left, right, bottom, scale)
    _draw_phases(axes, walk, phases, left + 0.08 * scale, right - 0.08 * scale, scale)


def write_strobe(
    trajectories: Mapping[str, object],
    path: Path,
    phases: Sequence[NamedPhase],
    parameters: CompassParameters = PAPER_PARAMETERS,
    *,
    strides: int = 3,
) -> None:
    """Write what `strobe` draws as PNG, SVG or PDF, as the suffix of `path` says."""
    save(strobe(trajectories, phases, parameters, strides=strides), path)


def _last_strides(walk: Walk, strides: int) -> Walk:
    touchdowns = np.flatnonzero(walk.touched_down)
    start = touchdowns[-strides - 1] if len(touchdowns) > strides else 0
    return walk.part(int(start), len(walk.time))


def _extent(walk: Walk, scale: float) -> tuple[float, float]:
    """The leftmost and the rightmost x of what is above the ground, with a margin, and never narrow."""
    above = walk.swing_foot[walk.swing_foot[:, 1] > -0.05 * scale, 0]
    x = np.concatenate([walk.hip[:, 0], walk.stance_foot[:, 0], above])
    missing = max(0.0, 2.2 * scale - np.ptp(x)) / 2
    return float(x.min() - missing - 0.1 * scale), float(x.max() + missing + 0.1 * scale)


def _poses(walk: Walk) -> list[int]:
    """Samples at even intervals that end with the last one, in order."""
    times = np.arange(walk.time[-1], walk.time[0] - 1e-6, -POSE_EVERY)
    return [walk.at(time) for time in times[::-1]]


def _draw_pose(axes: Axes, walk: Walk, sample: int, strength: float, level: int) -> None:
    p, hip = walk.parameters, walk.hip[sample]
    stance, swing = faded(STANCE, strength), faded(SWING, strength)
    first_stands = bool(walk.first_leg_stands[sample])
    for foot, colour in ((walk.swing_foot, swing), (walk.stance_foot, stance)):
        axes.plot(*zip(foot[sample], hip, strict=True), color=colour, linewidth=2.2, zorder=level)
    for mass, colour, is_first in (
        (walk.swing_mass, swing, not first_stands),
        (walk.stance_mass, stance, first_stands),
    ):
        _draw_mass(axes, mass[sample], _diameter(p.leg_mass, p), colour, colour if is_first else PAGE, level)
    ink = faded(INK, strength)
    _draw_mass(axes, hip, _diameter(p.hip_mass, p), ink, ink, level)


def _draw_mass(
    axes: Axes, at: Float[np.ndarray, "2"], diameter: float, edge: Colour, face: Colour, level: int
) -> None:
    axes.plot(
        *at, "o", markersize=diameter, color=edge, markerfacecolor=face, markeredgewidth=1.1, zorder=level
    )


def _diameter(mass: float, parameters: CompassParameters) -> float:
    """Of a point mass on the page [pt]: areas are as the masses."""
    return 7.5 * (mass / max(parameters.hip_mass, parameters.leg_mass)) ** 0.5


def faded(colour: str, strength: float) -> Colour:
    """The colour mixed with the page's: unlike transparency it hides what is behind."""
    return tuple(1 - strength * (1 - channel) for channel in to_rgb(colour))


def _draw_ground(axes: Axes, left: float, right: float, bottom: float, scale: float) -> None:
    # The model has no knees, its swing leg scuffs through the ground: what is below is covered.
    axes.add_patch(
        Rectangle((left, bottom), right - left, -bottom, facecolor=PAGE, linewidth=0, zorder=ABOVE)
    )
    axes.axhline(0, color=INK, linewidth=0.9, zorder=ABOVE)
    for x in np.arange(np.ceil(2 * left) / 2, right, 0.5):
        axes.plot([x, x], [0, -0.015 * scale], color=INK, linewidth=0.7, zorder=ABOVE)
        if left + 0.1 * scale < x < right - 0.1 * scale:
            write(axes, (x, -0.03 * scale), f"{x + 0.0:g} m".replace("-", "−"), FAINT, "top")


def _draw_phases(
    axes: Axes, walk: Walk, phases: Sequence[NamedPhase], left: float, right: float, scale: float
) -> None:
    """The phases over time, from `left` to `right`."""
    colours, names = phase_colours(len(phases)), [phase.name for phase in phases]
    low, height = -0.22 * scale, 0.09 * scale

    def place(sample: int) -> float:
        return left + (right - left) * walk.progress(sample)

    for phase, start, stop in runs_of(walk.phase):
        begin, width = place(start), place(stop) - place(start)
        axes.add_patch(
            Rectangle((begin, low), width, height, facecolor=colours[phase], linewidth=0, zorder=ABOVE)
        )
        if phase < len(names) and width > 0.06 * scale:
            middle = (begin + width / 2, low + height / 2)
            write(axes, middle, names[phase], INK, "center_baseline")
    for sample in np.flatnonzero(walk.touched_down):
        x = place(int(sample))
        axes.plot([x, x], [low, low + height], color=INK, linewidth=0.8, zorder=ABOVE)
    for second in np.arange(np.ceil(2 * walk.time[0]) / 2, walk.time[-1] + 1e-6, 0.5):
        x = place(walk.at(second))
        write(axes, (x, low - 0.015 * scale), f"{second:g} s", FAINT, "top")


def write(axes: Axes, at: tuple[float, float], text: str, colour: str, anchor: str) -> None:
    """Small words, centred, above everything."""
    axes.text(*at, text, ha="center", va=anchor, fontsize=6.5, color=colour, zorder=ABOVE)
