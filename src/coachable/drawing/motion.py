"""A recorded motion in the plane: where every point of a robot is at every sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.foundation.errors import ParameterError
from coachable.plants.plant import Plant
from coachable.plants.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Motion:
    """Where a robot's points are over time, the ground at z = 0, and in which phase of its behaviour."""

    time: Float[np.ndarray, " samples"]
    """[s]"""
    phase: Int[np.ndarray, " samples"]
    """Phase of the behaviour: 0 … K−1, or K outside all K phases."""
    points: Float[np.ndarray, "samples points 2"]
    """(x, z) of each point [m], in the order of `skeleton.points`."""
    foot_x: Float[np.ndarray, " samples"]
    """Where the stance foot is on the ground [m]."""
    touched_down: Bool[np.ndarray, " samples"]
    """Whether the stance foot is another one than at the sample before."""
    skeleton: Skeleton

    @staticmethod
    def of(plant: Plant, columns: Mapping[str, np.ndarray]) -> Motion:
        """The motion of a plant along a trajectory.

        **Arguments:** `columns`, the trajectory as a run folder stores it: arrays by name, `t` [s], the
        plant's states, `foot_x` [m] and `phase`. Samples that are not finite are left out.

        **Raises:** `ParameterError` if the plant does not define how it is drawn.
        """
        time, foot_x = (np.asarray(columns[name], float) for name in ("t", "foot_x"))
        states = np.stack([np.asarray(columns[name], float) for name in plant.state_names]).T
        with np.errstate(all="ignore"):  # of samples that are left out
            points = plant.kinematics(states, foot_x)
        finite = np.isfinite(points).all(axis=(1, 2)) & np.isfinite(time) & np.isfinite(foot_x)
        if not finite.any():
            raise ParameterError("there is nothing to draw: no sample of the walk is finite")
        foot_x = foot_x[finite]
        return Motion(
            time=time[finite],
            phase=np.asarray(columns["phase"], int)[finite],
            points=points[finite],
            foot_x=foot_x,
            touched_down=np.diff(foot_x, prepend=foot_x[:1]) != 0,
            skeleton=plant.skeleton,
        )

    def point(self, name: str) -> Float[np.ndarray, "samples 2"]:
        """Where the point of this name is [m]."""
        return self.points[:, self.skeleton.place(name)]

    @property
    def base(self) -> Float[np.ndarray, "samples 2"]:
        """Where the base is [m]."""
        return self.point(self.skeleton.base)

    @property
    def touchdowns(self) -> Int[np.ndarray, " samples"]:
        """How many touchdowns there were up to each sample, which tells the legs apart."""
        return np.cumsum(self.touched_down)

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return float(self.time[-1] - self.time[0])

    def progress(self, sample: int) -> float:
        """Share of the time that has passed at a sample; 1 behind the last one."""
        passed = self.time[min(sample, len(self.time) - 1)] - self.time[0]
        return float(passed / self.seconds) if self.seconds else 1.0

    def at(self, time: float) -> int:
        """The last sample not after a time [s]; the first one if there is none."""
        return max(0, int(np.searchsorted(self.time, time + 1e-6, side="right")) - 1)

    def part(self, start: int, stop: int) -> Motion:
        """The samples from `start` up to `stop`."""
        rows = slice(start, stop)
        arrays = {name: value[rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        return replace(self, **arrays)


def runs_of(values: Int[np.ndarray, " samples"]) -> list[tuple[int, int, int]]:
    """Where a sequence stays the same: (value, first index, index after the last) of each stretch."""
    changes = np.flatnonzero(np.diff(values)) + 1
    bounds = [0, *changes.tolist(), len(values)]
    return [(int(values[start]), start, stop) for start, stop in pairwise(bounds)]
