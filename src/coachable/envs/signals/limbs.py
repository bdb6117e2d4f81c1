"""Where the parts of a MuJoCo robot are, for a drawing: capsules and spheres."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float


class Limbs:
    """The capsules and spheres of a robot, by the names of their geoms."""

    def __init__(self, base: Any):
        import mujoco

        lib: Any = mujoco  # it has no type stubs
        model = base.model
        drawn = np.isin(model.geom_type, [lib.mjtGeom.mjGEOM_CAPSULE, lib.mjtGeom.mjGEOM_SPHERE])
        self._geoms = np.flatnonzero(drawn)
        self.names = tuple(model.geom(int(geom)).name for geom in self._geoms)
        sizes = model.geom_size[self._geoms]
        self.radii: Float[np.ndarray, " limbs"] = sizes[:, 0].copy()
        """[m]"""
        is_capsule = model.geom_type[self._geoms] == lib.mjtGeom.mjGEOM_CAPSULE
        self._half_lengths = np.where(is_capsule, sizes[:, 1], 0.0)
        self._base, self._model, self._mujoco = base, model, lib
        self._now = lib.MjData(model)  # the environment's own is a small step behind; see MujocoSimulation

    @staticmethod
    def of(env: gymnasium.Env) -> Limbs | None:
        """The limbs of an environment's robot; `None` if it is not MuJoCo's, or has none of these shapes."""
        base: Any = env.unwrapped
        if not (hasattr(base, "model") and hasattr(base, "data") and hasattr(base.model, "geom_type")):
            return None
        limbs = Limbs(base)
        return limbs if limbs.names else None

    def ends(self) -> Float[np.ndarray, "limbs 2 3"]:
        """Where both ends of each axis are at this moment [m]."""
        if self._base.model is not self._model:  # made anew at a reset
            self._model, self._now = self._base.model, self._mujoco.MjData(self._base.model)
        self._now.qpos[:] = self._base.data.qpos
        self._mujoco.mj_kinematics(self._model, self._now)
        middles = self._now.geom_xpos[self._geoms]
        axes = self._now.geom_xmat[self._geoms].reshape(-1, 3, 3)[:, :, 2] * self._half_lengths[:, None]
        return np.stack([middles - axes, middles + axes], axis=1)
