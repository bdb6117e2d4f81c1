"""A strobe picture: a few strides of a motion in one image, with the phases beneath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coachable.drawing.motion import Motion, runs_of
from coachable.drawing.stage import NamedPhase, leg_colour
from coachable.foundation.style import FAINT, INK, PAGE, drawing, phase_colours, save
from coachable.plants.skeleton import PointMass

WIDTH = 7.16
"""Both columns of a two-column page [in]."""
POSE_EVERY = 0.1
"""Time between two poses [s]."""
FAINTEST = 0.16
ABOVE = 1_000
"""Drawn over all poses."""

Colour = str | tuple[float, ...]


def strobe(motions: Mapping[str, Motion], phases: Sequence[NamedPhase], *, strides: int = 3) -> Figure:
    """Strobe pictures of motions by title, one below another at one scale.

    Of each motion the last `strides` whole strides and what comes after them, or all of it if there are
    fewer. A pose every 0.1 s, older ones fainter; the stance leg is blue, other legs are orange, as in
    figure 3 of the paper. Masses are filled on the leg that stood first and hollow on the others, so that
    each can be followed through its steps. The strip beneath shows the phases over time, with a line at every
    touchdown.

    **Arguments:** `phases` of the behaviour, in its order.
    """
    motions = {title: _last_strides(motion, strides) for title, motion in motions.items()}
    scale = max(motion.skeleton.height for motion in motions.values())
    extents = [_extent(motion, scale) for motion in motions.values()]
    length = max(right - left for left, right in extents)
    bottom, top = -0.31 * scale, (1.2 if any(motions) else 1.08) * scale
    with drawing():
        figure = Figure(figsize=(WIDTH, len(motions) * WIDTH * (top - bottom) / length))
        for row, (title, motion) in enumerate(motions.items()):
            left = sum(extents[row]) / 2 - length / 2
            axes = figure.add_axes((0, 1 - (row + 1) / len(motions), 1, 1 / len(motions)))
            axes.set(xlim=(left, left + length), ylim=(bottom, top))
            axes.set_axis_off()
            _draw_motion(axes, motion, phases, (left, left + length), bottom, scale)
            if title:
                write(axes, (left + 0.3 * scale, 1.18 * scale), title, INK, "top")
    return figure


def _draw_motion(
    axes: Axes,
    motion: Motion,
    phases: Sequence[NamedPhase],
    extent: tuple[float, float],
    bottom: float,
    scale: float,
) -> None:
    axes.plot(*motion.base.T, color=FAINT, linewidth=0.8)
    poses = _poses(motion)
    for order, sample in enumerate(poses):
        age = 1 - (order + 1) / len(poses)
        _draw_pose(axes, motion, sample, FAINTEST + (1 - FAINTEST) * (1 - age) ** 2, 3 + order)
    left, right = extent
    _draw_ground(axes, left, right, bottom, scale)
    _draw_phases(axes, motion, phases, left + 0.08 * scale, right - 0.08 * scale, scale)


def write_strobe(
    motions: Mapping[str, Motion], path: Path, phases: Sequence[NamedPhase], *, strides: int = 3
) -> None:
    """Write what `strobe` draws as PNG, SVG or PDF, by the suffix of `path`."""
    save(strobe(motions, phases, strides=strides), path)


def _last_strides(motion: Motion, strides: int) -> Motion:
    touchdowns = np.flatnonzero(motion.touched_down)
    start = touchdowns[-strides - 1] if len(touchdowns) > strides else 0
    return motion.part(int(start), len(motion.time))


def _extent(motion: Motion, scale: float) -> tuple[float, float]:
    """The leftmost and the rightmost x of what is above the ground, with a margin, and never narrow."""
    skeleton = motion.skeleton
    ends = motion.points[:, [skeleton.place(end) for part in skeleton.segments for end in part.ends]]
    x = np.concatenate([motion.base[:, 0], ends[ends[..., 1] > -0.05 * scale][:, 0]])
    missing = max(0.0, 2.2 * scale - np.ptp(x)) / 2
    return float(x.min() - missing - 0.1 * scale), float(x.max() + missing + 0.1 * scale)


def _poses(motion: Motion) -> list[int]:
    """Samples at even intervals that end with the last one, in order."""
    times = np.arange(motion.time[-1], motion.time[0] - 1e-6, -POSE_EVERY)
    return [motion.at(time) for time in times[::-1]]


def _draw_pose(axes: Axes, motion: Motion, sample: int, strength: float, level: int) -> None:
    skeleton, points, touchdowns = motion.skeleton, motion.points[sample], int(motion.touchdowns[sample])
    masses: list[PointMass] = []
    for part in skeleton.parts:
        if isinstance(part, PointMass):
            masses.append(part)  # over all segments, so that overlapping poses stay readable
            continue
        ends = [points[skeleton.place(end)] for end in part.ends]
        axes.plot(
            *zip(*ends, strict=True), color=faded(leg_colour(part.leg), strength), linewidth=2.2, zorder=level
        )
    for mass in masses:
        colour = faded(leg_colour(mass.leg), strength)
        face = colour if skeleton.stands_first(mass.leg, touchdowns) else PAGE
        axes.plot(
            *points[skeleton.place(mass.point)],
            "o",
            markersize=7.5 * (mass.mass / skeleton.largest_mass) ** 0.5,  # [pt]: areas are as the masses
            color=colour,
            markerfacecolor=face,
            markeredgewidth=1.1,
            zorder=level,
        )


def faded(colour: str, strength: float) -> Colour:
    """The colour mixed with the page's: unlike transparency it hides what is behind."""
    return tuple(1 - strength * (1 - channel) for channel in to_rgb(colour))


def _draw_ground(axes: Axes, left: float, right: float, bottom: float, scale: float) -> None:
    # Legs without knees scuff through the ground as they swing: what is below is covered.
    axes.add_patch(
        Rectangle((left, bottom), right - left, -bottom, facecolor=PAGE, linewidth=0, zorder=ABOVE)
    )
    axes.axhline(0, color=INK, linewidth=0.9, zorder=ABOVE)
    for x in np.arange(np.ceil(2 * left) / 2, right, 0.5):
        axes.plot([x, x], [0, -0.015 * scale], color=INK, linewidth=0.7, zorder=ABOVE)
        if left + 0.1 * scale < x < right - 0.1 * scale:
            write(axes, (x, -0.03 * scale), f"{x + 0.0:g} m".replace("-", "−"), FAINT, "top")


def _draw_phases(
    axes: Axes, motion: Motion, phases: Sequence[NamedPhase], left: float, right: float, scale: float
) -> None:
    """The phases over time, from `left` to `right`."""
    colours, names = phase_colours(len(phases)), [phase.name for phase in phases]
    low, height = -0.22 * scale, 0.09 * scale

    def place(sample: int) -> float:
        return left + (right - left) * motion.progress(sample)

    for phase, start, stop in runs_of(motion.phase):
        begin, width = place(start), place(stop) - place(start)
        axes.add_patch(
            Rectangle((begin, low), width, height, facecolor=colours[phase], linewidth=0, zorder=ABOVE)
        )
        if phase < len(names) and width > 0.06 * scale:
            middle = (begin + width / 2, low + height / 2)
            write(axes, middle, names[phase], INK, "center_baseline")
    for sample in np.flatnonzero(motion.touched_down):
        x = place(int(sample))
        axes.plot([x, x], [low, low + height], color=INK, linewidth=0.8, zorder=ABOVE)
    for second in np.arange(np.ceil(2 * motion.time[0]) / 2, motion.time[-1] + 1e-6, 0.5):
        x = place(motion.at(second))
        write(axes, (x, low - 0.015 * scale), f"{second:g} s", FAINT, "top")


def write(axes: Axes, at: tuple[float, float], text: str, colour: str, anchor: str) -> None:
    """Small words, centred, above everything."""
    axes.text(*at, text, ha="center", va=anchor, fontsize=6.5, color=colour, zorder=ABOVE)
