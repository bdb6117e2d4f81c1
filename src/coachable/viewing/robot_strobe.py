"""Strobe pictures of a robot that is made of limbs: a few poses in one image, with the phases beneath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coachable.drawing.stage import NamedPhase
from coachable.errors import CoachableError
from coachable.style import FAINT, INK, STANCE, SWING, drawing, phase_colours
from coachable.viewing.strobe import FAINTEST, WIDTH, faded, write
from coachable.viewing.walk import runs_of

STROBE_SECONDS = 1.5
"""How much of a walk is shown."""
_BELOW = 0.42
"""What is under the ground: its scale and the phases [m]."""
_ABOVE = 1.75
"""What is over it [m]."""
_MARGIN = 0.5
"""To the left and right of the robot [m]."""


@runtime_checkable
class Limbed(Protocol):
    """A walk of a robot that can be drawn."""

    @property
    def title(self) -> str:
        """What tells it from others."""
        ...

    @property
    def time(self) -> np.ndarray:
        """[s]"""
        ...

    @property
    def phase(self) -> np.ndarray:
        """Location in the behaviour: 0 … K−1, or K outside all K phases."""
        ...

    @property
    def phases(self) -> Sequence[NamedPhase]:
        """The behaviour's."""
        ...

    @property
    def limbs(self) -> Sequence[str]:
        """Names; those with `left` in them are drawn in the colour of that side."""
        ...

    @property
    def ends(self) -> np.ndarray | None:
        """(samples, limbs, 2, 3): where both ends of each are [m]."""
        ...

    @property
    def radii(self) -> np.ndarray | None:
        """(limbs,) [m]"""
        ...


def robot_strobe(walks: Mapping[str, Limbed], seconds: float = STROBE_SECONDS, every: float = 0.12) -> Figure:
    """The last seconds of walks by title, one below another at one scale.

    Seen from the side, x to the right. A pose every `every` seconds, older ones fainter; the left leg is
    orange, the right one blue. The strip beneath tells the phases over time.
    """
    parts = {title: _Part.of(walk, seconds) for title, walk in walks.items()}
    length = max(part.right - part.left for part in parts.values())
    height = _BELOW + _ABOVE
    with drawing():
        figure = Figure(figsize=(WIDTH, len(parts) * WIDTH * height / length))
        for row, (title, part) in enumerate(parts.items()):
            axes = figure.add_axes((0, 1 - (row + 1) / len(parts), 1, 1 / len(parts)))
            left = (part.left + part.right - length) / 2
            axes.set(xlim=(left, left + length), ylim=(-_BELOW, _ABOVE))
            axes.set_axis_off()
            _draw(axes, part, every, WIDTH * 72 / length)
            axes.text(left + 0.1, _ABOVE - 0.06, title, ha="left", va="top", fontsize=8, color=INK)
    return figure


@dataclass(frozen=True, eq=False)
class _Part:
    """The end of a walk, from the side."""

    time: Float[np.ndarray, " samples"]
    phase: Int[np.ndarray, " samples"]
    names: Sequence[str]
    colours: Sequence[str]
    """Of the limbs."""
    ends: Float[np.ndarray, "samples limbs 2 2"]
    radii: Float[np.ndarray, " limbs"]
    titles: Sequence[str]
    """Of the phases."""

    @staticmethod
    def of(walk: Limbed, seconds: float) -> _Part:
        if walk.ends is None or walk.radii is None:
            raise CoachableError(f"{walk.title}: this robot cannot be drawn as a strobe picture; take a film")
        start = max(0, int(np.searchsorted(walk.time, walk.time[-1] - seconds)))
        colours = [SWING if "left" in name else INK if "torso" in name else STANCE for name in walk.limbs]
        titles = [phase.name.replace("_", " ") for phase in walk.phases]
        ends = walk.ends[start:, :, :, ::2]
        return _Part(walk.time[start:], walk.phase[start:], walk.limbs, colours, ends, walk.radii, titles)

    @property
    def left(self) -> float:
        return float(self.ends[..., 0].min()) - _MARGIN

    @property
    def right(self) -> float:
        return float(self.ends[..., 0].max()) + _MARGIN


def _draw(axes: Axes, part: _Part, every: float, points_a_metre: float) -> None:
    step = max(1, round(every / float(part.time[1] - part.time[0])))
    poses = range((len(part.time) - 1) % step, len(part.time), step)
    order = sorted(range(len(part.names)), key=lambda limb: part.colours[limb] != SWING)
    for level, sample in enumerate(poses):
        strength = FAINTEST + (1 - FAINTEST) * ((level + 1) / len(poses)) ** 2
        for limb in order:
            axes.plot(
                *part.ends[sample, limb].T,
                color=faded(part.colours[limb], strength),
                linewidth=2 * part.radii[limb] * points_a_metre * 0.8,
                zorder=3 + level,
            )
    left, right = axes.get_xlim()
    axes.axhline(0, color=INK, linewidth=0.9, zorder=2)
    for x in np.arange(np.ceil(left), right):
        axes.plot([x, x], [0, -0.03], color=INK, linewidth=0.7)
        if left + 0.2 < x < right - 0.2:
            write(axes, (x, -0.05), f"{x:g} m".replace("-", "−"), FAINT, "top")
    _draw_phases(axes, part, left + 0.1, right - 0.1)


def _draw_phases(axes: Axes, part: _Part, left: float, right: float) -> None:
    colours, count = phase_colours(len(part.titles)), len(part.time)
    low, height = -0.36, 0.13
    for phase, start, stop in runs_of(part.phase):
        begin, width = (left + (right - left) * sample / count for sample in (start, stop))
        width -= begin
        axes.add_patch(Rectangle((begin, low), width, height, facecolor=colours[phase], linewidth=0))
        if phase < len(part.titles) and width > 0.03 * (right - left) * len(part.titles[phase]) / 6:
            write(axes, (begin + width / 2, low + height / 2), part.titles[phase], INK, "center_baseline")
