"""How a MuJoCo robot is read: joints, bodies and geoms by their names."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np

from coachable.envs.signals.probes import Probe, Reading, ReadingOf, angle

X, Y, Z = 0, 1, 2


class MujocoSimulation:
    """A MuJoCo environment's model and data, and a look at what was asked for of where its parts are.

    After a step MuJoCo's positions of bodies and geoms are those before its last small step, while joints are
    where they are after it. So positions are worked out anew, on data of our own: the environment's stay as
    they are. Contacts are those of that last small step, with whatever is not the robot: the floor under any
    name, a box, a stair.
    """

    def __init__(self, env: gymnasium.Env):
        import mujoco

        self.model: Any = env.unwrapped.model  # pyright: ignore[reportAttributeAccessIssue]
        self.data: Any = env.unwrapped.data  # pyright: ignore[reportAttributeAccessIssue]
        self.mujoco: Any = mujoco
        self._place, self._contact_force = self.mujoco.mj_kinematics, self.mujoco.mj_contactForce
        self._now: Any = None
        self._touching: dict[int, float] | None = None
        self._loads: dict[int, float] | None = None
        # MuJoCo's bindings give the same views for as long as there is the data; asking again takes time.
        self._roots: list[int] = np.asarray(self.model.body_rootid)[self.model.geom_bodyid].tolist()
        self._qpos, self._contact, self._force = self.data.qpos, self.data.contact, np.zeros(6)
        self._normal_force = partial(self._force.item, 0)

    def is_of(self, env: gymnasium.Env) -> bool:
        """Whether the environment's model and data are still these."""
        base: Any = env.unwrapped
        return self.data is base.data and self.model is base.model

    @property
    def floor(self) -> int:
        """The geom called `floor`, or else the first plane that does not move.

        **Raises:** `KeyError` if there is none.
        """
        model, plane = self.model, self.mujoco.mjtGeom.mjGEOM_PLANE
        names = [model.geom(index).name for index in range(model.ngeom)]
        if "floor" in names:
            return names.index("floor")
        fixed = np.asarray(model.body_weldid)[model.geom_bodyid] == 0
        planes = np.flatnonzero(fixed & (np.asarray(model.geom_type) == plane))
        if not len(planes):
            raise KeyError("the model has no geom called 'floor', and no plane that could be it")
        return int(planes[0])

    @property
    def now(self) -> Any:
        """Where everything is at this moment, for a probe to keep; no forces, no velocities."""
        if self._now is None:
            self._now = self.mujoco.MjData(self.model)
            self._now_qpos = self._now.qpos
        return self._now

    @property
    def touching(self) -> dict[int, float]:
        """The geoms that press on what is not their robot at this moment, 1 for each, for a probe to keep."""
        if self._touching is None:
            self._touching = {}
        return self._touching

    @property
    def loads(self) -> dict[int, float]:
        """How hard [N] each of them is pressed upwards, for a probe to keep."""
        if self._loads is None:
            self._loads = {}
        return self._loads

    def look(self) -> None:
        """Work out where everything is and what presses on what, each if a probe has asked for it."""
        if self._now is not None:
            self._now_qpos[:] = self._qpos
            self._place(self.model, self._now)
        touching, loads = self._touching, self._loads
        if touching is not None:
            touching.clear()
        if loads is not None:
            loads.clear()
        if (touching is not None or loads is not None) and self.data.ncon:
            self._feel({} if touching is None else touching, loads)

    def _feel(self, touching: dict[int, float], loads: dict[int, float] | None) -> None:
        """Find out what presses on another thing, and how hard it is pressed upwards if that is asked."""
        roots, frames = self._roots, self._contact.frame
        for index, pair in enumerate(self._contact.geom.tolist()):
            one, other = pair
            if one < 0 or other < 0 or roots[one] == roots[other]:
                continue  # a robot's own parts, or what no geom is (flexible bodies)
            # Where loads do not matter, one contact that presses is as good as several.
            if loads is None and one in touching and other in touching:
                continue
            self._contact_force(self.model, self.data, index, self._force)
            if (normal_force := self._normal_force()) > 0:
                touching[one] = touching[other] = 1.0
                if loads is not None:
                    # The force acts on the second geom; the frame's rows are the normal and two tangents.
                    rise, *slopes = frames[index][Z::3].tolist()
                    upwards = rise * normal_force
                    if any(slopes):
                        upwards += slopes[0] * self._force.item(1) + slopes[1] * self._force.item(2)
                    loads[other] = loads.get(other, 0.0) + upwards
                    loads[one] = loads.get(one, 0.0) - upwards


def joint(name: str, sign: int = 1) -> ReadingOf:
    """A joint's coordinate, a positive one of the joint as `sign`."""

    def of(simulation: MujocoSimulation) -> Reading:
        return _signed(simulation.data.qpos, int(simulation.model.joint(name).qposadr[0]), sign)

    return of


def joint_velocity(name: str, sign: int = 1, offset: int = 0) -> ReadingOf:
    """A joint's velocity; a free joint has several, chosen by `offset`."""

    def of(simulation: MujocoSimulation) -> Reading:
        return _signed(simulation.data.qvel, int(simulation.model.joint(name).dofadr[0]) + offset, sign)

    return of


def _signed(numbers: np.ndarray, index: int, sign: int) -> Reading:
    # `item` is the quickest way from an array to a plain float.
    return partial(numbers.item, index) if sign == 1 else lambda: sign * numbers.item(index)


def joint_angle(name: str, description: str, hinge: str, sign: int) -> tuple[Probe, Probe]:
    """A hinge's angle and its velocity, a positive one of the hinge as `sign`."""
    return angle(name, description, joint(hinge, sign), joint_velocity(hinge, sign))


def torso(axis: int) -> ReadingOf:
    """A coordinate of the origin of the torso's frame."""

    def of(simulation: MujocoSimulation) -> Reading:
        place = simulation.now.body("torso").xpos
        return partial(place.item, axis)

    return of


def foot_contact(foot: str) -> ReadingOf:
    """Whether a geom presses on what is not the robot, 1 or 0."""

    def of(simulation: MujocoSimulation) -> Reading:
        return partial(simulation.touching.get, int(simulation.model.geom(foot).id), 0.0)

    return of


def feet_down(*feet: str) -> ReadingOf:
    """The share of some geoms that press on what is not the robot."""

    def of(simulation: MujocoSimulation) -> Reading:
        touching = simulation.touching
        geoms = [int(simulation.model.geom(foot).id) for foot in feet]
        return lambda: sum(geom in touching for geom in geoms) / len(geoms)

    return of


def foot_load(foot: str) -> ReadingOf:
    """How hard the ground, or whatever it stands on, presses a geom upwards."""

    def of(simulation: MujocoSimulation) -> Reading:
        return partial(simulation.loads.get, int(simulation.model.geom(foot).id), 0.0)

    return of


def motor_power(simulation: MujocoSimulation) -> Reading:
    """What the motors give and take together: the sum of |force × velocity| over them."""
    force, velocity = simulation.data.actuator_force, simulation.data.actuator_velocity
    return lambda: math.fsum(map(abs, map(operator.mul, force.tolist(), velocity.tolist())))


def weight(simulation: MujocoSimulation) -> Reading:
    """Of all bodies together."""
    masses, gravity = simulation.model.body_mass, simulation.model.opt.gravity
    return lambda: float(masses.sum() * -gravity[Z])


def lean(*hinges: str) -> ReadingOf:
    """Of a segment in a plane: the torso's pitch, less what the hinges between them bend forward."""

    def of(simulation: MujocoSimulation) -> Reading:
        model, qpos = simulation.model, simulation.data.qpos
        first, *others = (int(model.joint(name).qposadr[0]) for name in ("rooty", *hinges))
        return lambda: qpos.item(first) - sum(map(qpos.item, others))

    return of


def foot_height(foot: str) -> ReadingOf:
    """Of the lowest point of a sphere, or a capsule along its own z axis, over the floor."""

    def of(simulation: MujocoSimulation) -> Reading:
        geom = simulation.model.geom(foot).id
        is_capsule = simulation.model.geom_type[geom] == simulation.mujoco.mjtGeom.mjGEOM_CAPSULE
        size = simulation.model.geom_size[geom]  # a view, for sizes may be drawn anew at a reset
        place, axes = simulation.now.geom_xpos[geom], simulation.now.geom_xmat[geom]
        floor = simulation.now.geom_xpos[simulation.floor]

        def reading() -> float:
            half_length = size.item(1) if is_capsule else 0.0
            return place.item(Z) - half_length * abs(axes.item(8)) - size.item(0) - floor.item(Z)

        return reading

    return of


def foot_from_hip(foot: str, hip: str, axis: int) -> ReadingOf:
    """How far the middle of a foot is from a hip joint along an axis of the world."""

    def of(simulation: MujocoSimulation) -> Reading:
        foot_at = simulation.now.geom_xpos[simulation.model.geom(foot).id]
        hip_at = simulation.now.xanchor[simulation.model.joint(hip).id]
        return lambda: foot_at.item(axis) - hip_at.item(axis)

    return of


def leg_angle(foot: str, hip: str) -> ReadingOf:
    """Of the line from a hip joint to the middle of a foot, in a plane, from upright; forward is positive."""

    def of(simulation: MujocoSimulation) -> Reading:
        x, z = (foot_from_hip(foot, hip, axis)(simulation) for axis in (X, Z))
        return lambda: math.atan2(x(), -z())

    return of


def leg_angle_velocity(foot: str, hip: str, *others: str) -> ReadingOf:
    """Its derivative, from the velocities of the torso's hinge and of those on the way from hip to foot.

    A hinge with the axis (0, s, 0) and the rate q̇ moves a foot that is r from it by q̇ s (r_z, −r_x); the
    torso's moves the hip, too, so it counts as if it were there.
    """

    def of(simulation: MujocoSimulation) -> Reading:
        model, now, qvel = simulation.model, simulation.now, simulation.data.qvel
        foot_at, hip_at = now.geom_xpos[model.geom(foot).id], now.xanchor[model.joint(hip).id]
        hinges = []
        for name in ("rooty", hip, *others):
            joint = model.joint(name)
            anchor = hip_at if name == "rooty" else now.xanchor[joint.id]
            hinges.append((partial(qvel.item, int(joint.dofadr[0])), now.xaxis[joint.id], anchor))

        def reading() -> float:
            foot_x, foot_z = foot_at.item(X), foot_at.item(Z)
            x, z = foot_x - hip_at.item(X), foot_z - hip_at.item(Z)
            x_rate = z_rate = 0.0
            for rate, axis, anchor in hinges:
                turning = rate() * axis.item(Y)
                x_rate += turning * (foot_z - anchor.item(Z))
                z_rate -= turning * (foot_x - anchor.item(X))
            return (x * z_rate - z * x_rate) / (x * x + z * z)

        return reading

    return of


def foot_as_torso_heads(foot: str, hip: str, axis: int) -> ReadingOf:
    """The same ahead (x) or to the left (y) as the torso heads, for a robot that can turn."""

    def of(simulation: MujocoSimulation) -> Reading:
        along_x, along_y = (foot_from_hip(foot, hip, of_world)(simulation) for of_world in (X, Y))
        rows = simulation.now.xmat[simulation.model.body("torso").id]

        def reading() -> float:
            cos, sin = _heading(rows)
            return cos * along_x() + sin * along_y() if axis == X else cos * along_y() - sin * along_x()

        return reading

    return of


def _heading(rows: np.ndarray) -> tuple[float, float]:
    """Cosine and sine of the torso's yaw, from its rotation matrix in rows."""
    x, y = float(rows[0]), float(rows[3])
    length = math.hypot(x, y)
    return (x / length, y / length) if length else (1.0, 0.0)


def attitude(angle_of: Callable[[np.ndarray], float]) -> ReadingOf:
    """An angle of the torso, from its rotation matrix in rows."""

    def of(simulation: MujocoSimulation) -> Reading:
        rows = simulation.now.xmat[simulation.model.body("torso").id]
        return lambda: angle_of(rows)

    return of


def attitude_rate(index: int) -> ReadingOf:
    """d/dt of roll, pitch, yaw (in this order; intrinsic z-y-x angles) from the torso's angular velocity ω.

    ω = yaw˙ ẑ + pitch˙ l + roll˙ x̂, with l to the left of the heading and x̂ the torso's own x axis. A free
    joint's last three velocities are ω in the torso's frame.
    """

    def of(simulation: MujocoSimulation) -> Reading:
        rows = simulation.now.xmat[simulation.model.body("torso").id]
        qvel, first = simulation.data.qvel, int(simulation.model.joint("root").dofadr[0]) + 3

        def reading() -> float:
            omega_x, omega_y, omega_z = rows.reshape(3, 3) @ qvel[first : first + 3]
            cos, sin = _heading(rows)
            along = cos * omega_x + sin * omega_y
            lean = pitch(rows)
            rates = (
                along / math.cos(lean),
                cos * omega_y - sin * omega_x,
                omega_z + math.tan(lean) * along,
            )
            return float(rates[index])

        return reading

    return of


def roll(rows: np.ndarray) -> float:
    """From a rotation matrix in rows; positive to the right."""
    return math.atan2(rows[7], rows[8])


def pitch(rows: np.ndarray) -> float:
    """From a rotation matrix in rows; positive forward."""
    return math.asin(max(-1.0, min(1.0, -rows[6])))


def yaw(rows: np.ndarray) -> float:
    """From a rotation matrix in rows; positive to the left."""
    return math.atan2(rows[3], rows[0])
