"""Robots of Gymnasium's MuJoCo environments, each step of all of them at once around the simulator.

Gymnasium's own step spends as long around `mj_step` as a fifth of that takes. What is here gives the same
numbers to the bit: formulas, dtypes and their order are those of `gymnasium.envs.mujoco`.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from jaxtyping import Float

VELOCITY_BOUND = 10.0
"""Velocities [m/s, rad/s] in observations of Walker2d and Hopper are cut to ± this."""


class RobotSteps(NamedTuple):
    """A step of every robot; `truncated` is the time limit's to say."""

    observations: Float[np.ndarray, "robots numbers"]
    rewards: list[float]
    terminated: list[bool]
    infos: list[dict[str, Any]]


class Robots(abc.ABC):
    """Robots of one kind with one set of options.

    **Arguments:** `bases`, their unwrapped environments.
    """

    def __init__(self, bases: Sequence[Any]):
        import mujoco as _mujoco

        mujoco: Any = _mujoco  # its bindings say nothing of what is in it
        self._first, self._mj_step = bases[0], mujoco.mj_step
        self._feel_forces = mujoco.mj_rnePostConstraint
        self._frame_skip, self._dt = self._first.frame_skip, self._first.dt
        # Views of the simulator's own numbers, which the bindings keep for as long as there is the data.
        self._robots = [
            (base.model, base.data, base.data.ctrl, base.data.qpos, base.data.qvel) for base in bases
        ]
        self._qpos = np.empty((len(bases), self._first.model.nq))
        self._qvel = np.empty((len(bases), self._first.model.nv))

    def step(self, actions: Float[np.ndarray, "robots controls"]) -> RobotSteps:
        """One control step of every robot. **Arguments:** `actions`, what its motors are told, a row each."""
        mj_step, frame_skip, before = self._mj_step, self._frame_skip, self._places()
        feel_forces = self._feel_forces  # for whoever reads them, as Gymnasium's step does
        for index, (model, data, ctrl, qpos, qvel) in enumerate(self._robots):
            ctrl[:] = actions[index]
            mj_step(model, data, frame_skip)
            feel_forces(model, data)
            self._qpos[index], self._qvel[index] = qpos, qvel
        first, velocities = self._first, (self._places() - before) / self._dt
        forward = first._forward_reward_weight * velocities[0]
        effort = first._ctrl_cost_weight * np.sum(np.square(self._controls(actions)), -1)
        return self._steps(velocities, forward, effort)

    @abc.abstractmethod
    def _places(self) -> np.ndarray:
        """Where the robots are, for their velocities: all x, and all y where there are any."""

    def _controls(self, actions: np.ndarray) -> np.ndarray:
        """What effort is counted by."""
        return actions

    @abc.abstractmethod
    def _steps(self, velocities: np.ndarray, forward: np.ndarray, effort: np.ndarray) -> RobotSteps:
        """The steps that led to the present state, from velocities and what speed and effort are paid."""

    def _all(self, name: str) -> np.ndarray:
        """What an array of MuJoCo's holds now, a row for each robot."""
        return np.array([getattr(data, name) for _, data, *_ in self._robots]).reshape(len(self._robots), -1)

    def _observations(self, *rest: np.ndarray) -> np.ndarray:
        skipped = self._first.observation_structure["skipped_qpos"]
        return np.concatenate([self._qpos[:, skipped:], *rest], -1)


class PlanarRobots(Robots):
    """Robots that move in a plane."""

    def _places(self) -> np.ndarray:
        return np.array([[qpos.item(0) for *_, qpos, _ in self._robots]])


class HalfCheetahs(PlanarRobots):
    """As `HalfCheetahEnv` has it."""

    def _steps(self, velocities: np.ndarray, forward: np.ndarray, effort: np.ndarray) -> RobotSteps:
        infos = _infos(
            x_position=self._qpos[:, 0],
            x_velocity=velocities[0],
            reward_forward=forward,
            reward_ctrl=-effort,
        )
        rewards = (forward - effort).tolist()
        return RobotSteps(self._observations(self._qvel), rewards, [False] * len(rewards), infos)


class Walker2ds(PlanarRobots):
    """As `Walker2dEnv` has it."""

    def _steps(self, velocities: np.ndarray, forward: np.ndarray, effort: np.ndarray) -> RobotSteps:
        first, healthy = self._first, self._healthy()
        alive = healthy * first._healthy_reward
        infos = _infos(
            x_position=self._qpos[:, 0],
            z_distance_from_origin=self._qpos[:, 1] - first.init_qpos[1],
            x_velocity=velocities[0],
            reward_forward=forward,
            reward_ctrl=-effort,
            reward_survive=alive,
        )
        return RobotSteps(
            self._observations(np.clip(self._qvel, -VELOCITY_BOUND, VELOCITY_BOUND)),
            (forward + alive - effort).tolist(),
            (~healthy & first._terminate_when_unhealthy).tolist(),
            infos,
        )

    def _healthy(self) -> np.ndarray:
        first, height, angle = self._first, self._qpos[:, 1], self._qpos[:, 2]
        return _within(height, first._healthy_z_range) & _within(angle, first._healthy_angle_range)


class Hoppers(Walker2ds):
    """As `HopperEnv` has it."""

    def _healthy(self) -> np.ndarray:
        states = np.concatenate([self._qpos, self._qvel], -1)[:, 2:]
        return super()._healthy() & _within(states, self._first._healthy_state_range).all(-1)


class FreeRobots(Robots):
    """Robots that move in space, and pay for how hard they touch things."""

    def _steps(self, velocities: np.ndarray, forward: np.ndarray, effort: np.ndarray) -> RobotSteps:
        first, healthy, forces = self._first, self._healthy(), self._forces()
        alive, touch = healthy * first._healthy_reward, self._touch(forces)
        place = self._qpos[:, :2]
        infos = _infos(
            x_position=place[:, 0],
            y_position=place[:, 1],
            distance_from_origin=np.sqrt(np.vecdot(place, place)),
            x_velocity=velocities[0],
            y_velocity=velocities[1],
            reward_forward=forward,
            reward_ctrl=-effort,
            reward_contact=-touch,
            reward_survive=alive,
            **self._further_infos(),
        )
        return RobotSteps(
            self._observations(self._qvel, *self._observed(forces)),
            (forward + alive - (effort + touch)).tolist(),
            (~healthy & first._terminate_when_unhealthy).tolist(),
            infos,
        )

    def _forces(self) -> np.ndarray:
        """What contacts do to bodies: six numbers for each, first those of the world."""
        return self._all("cfrc_ext")

    def _touch(self, forces: np.ndarray) -> np.ndarray:
        """What forces cost."""
        return self._first._contact_cost_weight * np.sum(np.square(forces), -1)

    def _further_infos(self) -> dict[str, np.ndarray]:
        """Columns that only this kind has."""
        return {}

    @abc.abstractmethod
    def _healthy(self) -> np.ndarray:
        """Which robots are."""

    @abc.abstractmethod
    def _observed(self, forces: np.ndarray) -> list[np.ndarray]:
        """What is observed besides positions and velocities."""


class Ants(FreeRobots):
    """As `AntEnv` has it."""

    def _places(self) -> np.ndarray:
        return np.array([data.body(self._first._main_body).xpos[:2] for _, data, *_ in self._robots]).T

    def _forces(self) -> np.ndarray:
        return np.clip(super()._forces(), *self._first._contact_force_range)

    def _healthy(self) -> np.ndarray:
        height, (lowest, highest) = self._qpos[:, 2], self._first._healthy_z_range
        is_finite = np.isfinite(self._qpos).all(-1) & np.isfinite(self._qvel).all(-1)
        return is_finite & (lowest <= height) & (height <= highest)

    def _observed(self, forces: np.ndarray) -> list[np.ndarray]:
        return [forces[:, 6:]] if self._first._include_cfrc_ext_in_observation else []


class Humanoids(FreeRobots):
    """As `HumanoidEnv` has it."""

    def _places(self) -> np.ndarray:
        from gymnasium.envs.mujoco.humanoid_v5 import mass_center

        return np.array([mass_center(model, data) for model, data, *_ in self._robots]).T

    def _controls(self, actions: np.ndarray) -> np.ndarray:
        return self._all("ctrl")

    def _touch(self, forces: np.ndarray) -> np.ndarray:
        return np.clip(super()._touch(forces), *self._first._contact_cost_range)

    def _healthy(self) -> np.ndarray:
        return _within(self._qpos[:, 2], self._first._healthy_z_range)

    def _observed(self, forces: np.ndarray) -> list[np.ndarray]:
        first = self._first
        # The first numbers are those of the world, and the forces on the root, which no motor moves.
        parts = (
            (first._include_cinert_in_observation, "cinert", 10),
            (first._include_cvel_in_observation, "cvel", 6),
            (first._include_qfrc_actuator_in_observation, "qfrc_actuator", 6),
            (first._include_cfrc_ext_in_observation, "cfrc_ext", 6),
        )
        return [self._all(name)[:, skipped:] for is_included, name, skipped in parts if is_included is True]

    def _further_infos(self) -> dict[str, np.ndarray]:
        return {f"tendon_{what}": self._all(f"ten_{what}") for what in ("length", "velocity")}


def robots_of(envs: Sequence[gymnasium.Env]) -> Robots | None:
    """The robots of environments that are just as Gymnasium makes them; `None` for others.

    **Arguments:** `envs`, alike: made by the same call.
    """
    kinds = _kinds()
    for env in envs:
        base: Any = env.unwrapped
        if type(base) not in kinds or {"step", "do_simulation"} & vars(base).keys() or base.render_mode:
            return None
        while isinstance(env, gymnasium.wrappers.TimeLimit | gymnasium.wrappers.OrderEnforcing):
            env = env.env
        if env is not base:
            return None
    return kinds[type(envs[0].unwrapped)]([env.unwrapped for env in envs])


def _kinds() -> Mapping[type, type[Robots]]:
    try:
        from gymnasium.envs.mujoco.ant_v5 import AntEnv
        from gymnasium.envs.mujoco.half_cheetah_v5 import HalfCheetahEnv
        from gymnasium.envs.mujoco.hopper_v5 import HopperEnv
        from gymnasium.envs.mujoco.humanoid_v5 import HumanoidEnv
        from gymnasium.envs.mujoco.walker2d_v5 import Walker2dEnv
    except gymnasium.error.DependencyNotInstalled:
        return {}
    return {
        AntEnv: Ants,
        HalfCheetahEnv: HalfCheetahs,
        HopperEnv: Hoppers,
        HumanoidEnv: Humanoids,
        Walker2dEnv: Walker2ds,
    }


def _infos(**columns: np.ndarray) -> list[dict[str, Any]]:
    """An info for each robot: a number where a column has one for it, else its row."""
    rows = zip(*(column.tolist() if column.ndim == 1 else column for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _within(numbers: np.ndarray, bounds: tuple[float, float]) -> np.ndarray:
    return (bounds[0] < numbers) & (numbers < bounds[1])
