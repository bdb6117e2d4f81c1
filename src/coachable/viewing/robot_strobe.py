"""Strobe pictures of a robot that is made of limbs: a few poses in one image, with the phases beneath."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coachable.drawing.motion import runs_of
from coachable.foundation.style import FAINT, INK, drawing, phase_colours
from coachable.viewing.side_view import SideView
from coachable.viewing.strobe import FAINTEST, WIDTH, faded, write

STROBE_SECONDS = 1.5
"""How much of a walk is shown."""
_BELOW = 0.55
"""What is under the ground: its scale, the phases, and names for which the strip is too narrow [m]."""
_MARGIN = 0.5
"""To the left and right of the robot [m]."""


def robot_strobe(views: Sequence[SideView], seconds: float = STROBE_SECONDS, every: float = 0.12) -> Figure:
    """The last seconds of walks, one below another at one scale.

    A pose every `every` seconds, older ones fainter. The strip beneath shows the phases over time.
    """
    views = [view.since(float(view.time[-1]) - seconds) for view in views]
    length = max(np.ptp(view.ends[..., 0]) for view in views) + 2 * _MARGIN
    above = 1.15 * max(view.height for view in views)
    with drawing():
        figure = Figure(figsize=(WIDTH, len(views) * WIDTH * (_BELOW + above) / length))
        for row, view in enumerate(views):
            axes = figure.add_axes((0, 1 - (row + 1) / len(views), 1, 1 / len(views)))
            x = view.ends[..., 0]
            left = (x.min() + x.max() - length) / 2
            axes.set(xlim=(left, left + length), ylim=(-_BELOW, above))
            axes.set_axis_off()
            _draw_poses(axes, view, every, WIDTH * 72 / length)
            _draw_ground(axes)
            _draw_phases(axes, view)
            axes.text(left + 0.1, above - 0.06, view.title, ha="left", va="top", fontsize=8, color=INK)
    return figure


def _draw_poses(axes: Axes, view: SideView, every: float, points_a_metre: float) -> None:
    count = len(view.time)
    step = max(1, round(every * (count - 1) / float(np.ptp(view.time)))) if count > 1 else 1
    poses = range((count - 1) % step, count, step)
    for level, sample in enumerate(poses):
        strength = FAINTEST + (1 - FAINTEST) * ((level + 1) / len(poses)) ** 2
        for limb in view.order:
            axes.plot(
                *view.ends[sample, limb].T,
                color=faded(view.colours[limb], strength),
                linewidth=2 * view.widths[limb] * points_a_metre,
                zorder=3 + level,
            )


def _draw_ground(axes: Axes) -> None:
    left, right = axes.get_xlim()
    axes.axhline(0, color=INK, linewidth=0.9, zorder=2)
    for x in np.arange(np.ceil(left), right):
        axes.plot([x, x], [0, -0.03], color=INK, linewidth=0.7)
        if left + 0.2 < x < right - 0.2:
            write(axes, (x, -0.05), f"{x + 0.0:g} m".replace("-", "−"), FAINT, "top")


def _draw_phases(axes: Axes, view: SideView) -> None:
    """The phases over time; the strip is as long as the time that is shown.

    Phases that are nowhere long enough for their names are named beneath, as many as there is room for.
    """
    names = [*(phase.name.replace("_", " ") for phase in view.phases), "in no phase"]
    colours, count = phase_colours(len(view.phases)), len(view.time)
    left, right = axes.get_xlim()
    left, right = left + 0.1, right - 0.1
    low, height, letter = -0.36, 0.13, 0.0075 * (right - left)
    seen, named = set(), set()
    for phase, start, stop in runs_of(view.phase):
        begin, end = (left + (right - left) * sample / count for sample in (start, stop))
        axes.add_patch(Rectangle((begin, low), end - begin, height, facecolor=colours[phase], linewidth=0))
        seen.add(phase)
        if end - begin > letter * len(names[phase]):
            named.add(phase)
            write(axes, ((begin + end) / 2, low + height / 2), names[phase], INK, "center_baseline")
    for phase in sorted(seen - named):
        width = letter * len(names[phase])
        if left + 0.1 + width > right:
            break
        axes.add_patch(Rectangle((left, -0.5), 0.07, 0.07, facecolor=colours[phase], linewidth=0))
        write(axes, (left + 0.1 + width / 2, -0.465), names[phase], INK, "center_baseline")
        left += 0.2 + width
