"""A robot made of limbs, from the side: x to the right, the left leg orange, the right one blue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from coachable.drawing.pen import FINER, Pen
from coachable.drawing.stage import NamedPhase
from coachable.foundation.errors import ParameterError
from coachable.foundation.style import FAINT, HAIRLINE, INK, PAGE, STANCE, SWING

SIDE = 360
"""Of a picture [pixels]."""
_GROUND = 316
"""Where the ground is, from the top [pixels]."""
_ROOM = 1.25
"""How many times as high as the robot ever is a picture shows."""
_CAMERA_SECONDS = 0.3
"""Over which the camera's motion is smoothed."""


@runtime_checkable
class Limbed(Protocol):
    """A walk of a robot whose limbs are known."""

    @property
    def title(self) -> str:
        """What distinguishes it from others."""
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
        """Their names."""
        ...

    @property
    def ends(self) -> np.ndarray | None:
        """(samples, limbs, 2, 3): where both ends of each limb's axis are [m]; `None` without limbs."""
        ...

    @property
    def radii(self) -> np.ndarray | None:
        """(limbs,) [m]"""
        ...


@dataclass(frozen=True, eq=False)
class SideView:
    """A walk from the side, with a camera that goes with it."""

    title: str
    time: Float[np.ndarray, " samples"]
    """[s]"""
    phase: Int[np.ndarray, " samples"]
    """Location in the behaviour: 0 … K−1, or K outside all K phases."""
    phases: Sequence[NamedPhase]
    """The behaviour's."""
    limbs: Sequence[str]
    """Their names."""
    ends: Float[np.ndarray, "samples limbs 2 2"]
    """Where both ends of each are, x and z [m]."""
    radii: Float[np.ndarray, " limbs"]
    """[m]"""

    @staticmethod
    def of(walk: Limbed) -> SideView:
        """The view of a walk whose robot has limbs.

        **Raises:** `ParameterError` if it has none.
        """
        if walk.ends is None or walk.radii is None:
            raise ParameterError(f"{walk.title}: nobody knows where the limbs of this robot are")
        ends = walk.ends[..., ::2]
        return SideView(walk.title, walk.time, walk.phase, walk.phases, walk.limbs, ends, walk.radii)

    def since(self, time: float) -> SideView:
        """What comes after a time [s]."""
        start = max(0, int(np.searchsorted(self.time, time)))
        part = {name: getattr(self, name)[start:] for name in ("time", "phase", "ends")}
        return replace(self, **part)

    @property
    def widths(self) -> Float[np.ndarray, " limbs"]:
        """Half of how wide limbs are drawn [m]: thinner than they are, so that legs can be told apart."""
        return 0.8 * self.radii

    @property
    def height(self) -> float:
        """The highest that any limb ever is [m]."""
        return float((self.ends[..., 1].max(axis=(0, 2)) + self.radii).max())

    @cached_property
    def colours(self) -> tuple[str, ...]:
        """Of the limbs: those of both sides, and what is neither's."""
        has_sides = any("left" in name for name in self.limbs)
        return tuple(
            SWING if "left" in name else STANCE if has_sides and "torso" not in name else INK
            for name in self.limbs
        )

    @property
    def order(self) -> list[int]:
        """The limbs from the back to the front."""
        return sorted(range(len(self.limbs)), key=lambda limb: self.colours[limb] != SWING)

    @cached_property
    def _camera(self) -> np.ndarray:
        """The x in the middle of the picture [m]."""
        spacing = float(self.time[-1]) / max(1, len(self.time) - 1) or 1.0
        middles = self.ends[..., 0].mean(axis=(1, 2))
        return gaussian_filter1d(middles, _CAMERA_SECONDS / spacing, mode="nearest")

    def picture(self, sample: int) -> Image.Image:
        """The robot at a sample, on its ground."""
        image = Image.new("RGB", (FINER * SIDE, FINER * SIDE), PAGE)
        pen, scale, middle = Pen(image), _GROUND / (_ROOM * self.height), float(self._camera[sample])

        def place(x: float, z: float) -> tuple[float, float]:
            return SIDE / 2 + scale * (x - middle), _GROUND - scale * z

        half = SIDE / 2 / scale
        for tick in range(int(np.floor(2 * (middle - half))), int(np.ceil(2 * (middle + half))) + 1):
            x, _ = place(tick / 2, 0.0)
            pen.box(x - 0.5, _GROUND, x + 0.5, _GROUND + (7 if tick % 2 == 0 else 4), FAINT)
            if tick % 2 == 0:
                pen.text((x, _GROUND + 17), f"{tick // 2} m".replace("-", "−"), 10, FAINT, "mm")
        pen.box(0, _GROUND, SIDE, _GROUND + 1.5, HAIRLINE)
        for limb in self.order:
            ends = [place(float(x), float(z)) for x, z in self.ends[sample, limb]]
            pen.line(ends, 2 * scale * float(self.widths[limb]), self.colours[limb])
        return image.reduce(FINER)
