"""Where the parts of a MuJoCo robot are, for a drawing: capsules and spheres."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float

from coachable.envs.mujoco_probes import MujocoSimulation


class Limbs:
    """The capsules and spheres of a robot, by the names of their geoms."""

    def __init__(self, simulation: MujocoSimulation):
        model, kinds = simulation.model, simulation.mujoco.mjtGeom
        drawn = np.isin(model.geom_type, [kinds.mjGEOM_CAPSULE, kinds.mjGEOM_SPHERE])
        self._geoms = np.flatnonzero(drawn)
        self._simulation, self._now = simulation, simulation.now
        self.names = tuple(model.geom(int(geom)).name for geom in self._geoms)
        sizes = model.geom_size[self._geoms]
        self.radii: Float[np.ndarray, " limbs"] = sizes[:, 0].copy()
        """[m]"""
        is_capsule = model.geom_type[self._geoms] == kinds.mjGEOM_CAPSULE
        self._half_lengths = np.where(is_capsule, sizes[:, 1], 0.0)

    @staticmethod
    def of(env: gymnasium.Env) -> Limbs | None:
        """The limbs of an environment's robot; `None` if it is not MuJoCo's."""
        base: Any = env.unwrapped
        return Limbs(MujocoSimulation(env)) if hasattr(base, "model") and hasattr(base, "data") else None

    def ends(self) -> Float[np.ndarray, "limbs 2 3"]:
        """Where both ends of each axis are at this moment [m]."""
        self._simulation.look()
        middles = self._now.geom_xpos[self._geoms]
        axes = self._now.geom_xmat[self._geoms].reshape(-1, 3, 3)[:, :, 2] * self._half_lengths[:, None]
        return np.stack([middles - axes, middles + axes], axis=1)
