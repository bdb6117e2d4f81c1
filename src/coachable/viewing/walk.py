"""Where every part of the walker is at every sample: what is drawn, whatever it is drawn with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.drawing.pose import Pose
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters


@dataclass(frozen=True, eq=False)
class Walk:
    """A trajectory of the compass walker in the plane: a point (x, y) [m] a sample, the ground at y = 0."""

    time: Float[np.ndarray, " samples"]
    """[s]"""
    phase: Int[np.ndarray, " samples"]
    """Phase of the behaviour: 0 … K−1, or K outside all K phases."""
    hip: Float[np.ndarray, "samples 2"]
    stance_foot: Float[np.ndarray, "samples 2"]
    swing_foot: Float[np.ndarray, "samples 2"]
    stance_mass: Float[np.ndarray, "samples 2"]
    swing_mass: Float[np.ndarray, "samples 2"]
    touched_down: Bool[np.ndarray, " samples"]
    """Whether the stance foot is another one than at the sample before."""
    parameters: CompassParameters

    @staticmethod
    def of(trajectory: object, parameters: CompassParameters = PAPER_PARAMETERS) -> Walk:
        """The walk along a trajectory.

        **Arguments:** `trajectory`, an object whose attributes are arrays by name, or a mapping of them:
        `time` (or `t`) [s], `theta_1`, `theta_2` [rad], `foot_x` [m] and `phase`, as a rollout gives and a
        run folder stores them. Samples that are not finite are left out.
        """
        columns: Mapping[str, Any] = trajectory if isinstance(trajectory, Mapping) else vars(trajectory)
        names = ("time" if "time" in columns else "t", "theta_1", "theta_2", "foot_x")
        samples = np.stack([np.asarray(columns[name], float) for name in names])
        finite = np.isfinite(samples).all(axis=0)
        time, theta_1, theta_2, foot_x = samples[:, finite]
        return Walk(
            time=time,
            phase=np.asarray(columns["phase"], int)[finite],
            **vars(Pose.of(theta_1, theta_2, foot_x, parameters)),
            touched_down=np.diff(foot_x, prepend=foot_x[:1]) != 0,
            parameters=parameters,
        )

    def pose(self, sample: int) -> Pose:
        """Where every part is at a sample."""
        return Pose(
            self.hip[sample],
            self.stance_foot[sample],
            self.swing_foot[sample],
            self.stance_mass[sample],
            self.swing_mass[sample],
        )

    @property
    def first_leg_stands(self) -> Bool[np.ndarray, " samples"]:
        """Whether the leg that stands first is the stance leg: the legs change roles at every touchdown."""
        return np.cumsum(self.touched_down) % 2 == 0

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

    def part(self, start: int, stop: int) -> Walk:
        """The samples from `start` up to `stop`."""
        rows = slice(start, stop)
        arrays = {name: value[rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        return Walk(**arrays, parameters=self.parameters)


def runs_of(values: Int[np.ndarray, " samples"]) -> list[tuple[int, int, int]]:
    """Where a sequence stays the same: (value, first index, index after the last) of each stretch."""
    changes = np.flatnonzero(np.diff(values)) + 1
    bounds = [0, *changes.tolist(), len(values)]
    return [(int(values[start]), start, stop) for start, stop in pairwise(bounds)]
