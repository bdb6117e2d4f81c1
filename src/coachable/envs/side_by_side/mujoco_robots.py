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
    infos: list[dict[str, float]]


class Robots(abc.ABC):
    """Robots of one kind with one set of options.

    **Arguments:** `bases`, their unwrapped environments.
    """

    def __init__(self, bases: Sequence[Any]):
        import mujoco as _mujoco

        mujoco: Any = _mujoco  # its bindings say nothing of what is in it
        self._first, self._mj_step = bases[0], mujoco.mj_step
        self._frame_skip, self._dt = self._first.frame_skip, self._first.dt
        # Views of the simulator's own numbers, which the bindings keep for as long as there is the data.
        self._robots = [
            (base.model, base.data, base.data.ctrl, base.data.qpos, base.data.qvel) for base in bases
        ]
        self._before = np.empty(len(bases))
        self._qpos = np.empty((len(bases), self._first.model.nq))
        self._qvel = np.empty((len(bases), self._first.model.nv))

    def step(self, actions: Float[np.ndarray, "robots controls"]) -> RobotSteps:
        """One control step of every robot. **Arguments:** `actions`, what its motors are told, a row each."""
        mj_step, frame_skip = self._mj_step, self._frame_skip
        before, positions, velocities = self._before, self._qpos, self._qvel
        for index, (model, data, ctrl, qpos, qvel) in enumerate(self._robots):
            before[index] = qpos.item(0)
            ctrl[:] = actions[index]
            mj_step(model, data, frame_skip)
            positions[index], velocities[index] = qpos, qvel
        first, speed = self._first, (positions[:, 0] - before) / self._dt
        forward = first._forward_reward_weight * speed
        effort = first._ctrl_cost_weight * np.sum(np.square(actions), -1)
        return self._steps(speed, forward, effort)

    @abc.abstractmethod
    def _steps(self, speed: np.ndarray, forward: np.ndarray, effort: np.ndarray) -> RobotSteps:
        """The steps that led to the present state, from speeds and what is paid for these and for effort."""

    def _observations(self, velocities: np.ndarray) -> np.ndarray:
        skipped = int(self._first._exclude_current_positions_from_observation)
        return np.concatenate([self._qpos[:, skipped:], velocities], -1)


class HalfCheetahs(Robots):
    """As `HalfCheetahEnv` has it."""

    def _steps(self, speed: np.ndarray, forward: np.ndarray, effort: np.ndarray) -> RobotSteps:
        infos = _infos(
            x_position=self._qpos[:, 0], x_velocity=speed, reward_forward=forward, reward_ctrl=-effort
        )
        rewards = (forward - effort).tolist()
        return RobotSteps(self._observations(self._qvel), rewards, [False] * len(rewards), infos)


class Walker2ds(Robots):
    """As `Walker2dEnv` has it."""

    def _steps(self, speed: np.ndarray, forward: np.ndarray, effort: np.ndarray) -> RobotSteps:
        first, healthy = self._first, self._healthy()
        alive = healthy * first._healthy_reward
        infos = _infos(
            x_position=self._qpos[:, 0],
            z_distance_from_origin=self._qpos[:, 1] - first.init_qpos[1],
            x_velocity=speed,
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
        from gymnasium.envs.mujoco.half_cheetah_v5 import HalfCheetahEnv
        from gymnasium.envs.mujoco.hopper_v5 import HopperEnv
        from gymnasium.envs.mujoco.walker2d_v5 import Walker2dEnv
    except gymnasium.error.DependencyNotInstalled:
        return {}
    return {HalfCheetahEnv: HalfCheetahs, HopperEnv: Hoppers, Walker2dEnv: Walker2ds}


def _infos(**columns: np.ndarray) -> list[dict[str, float]]:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _within(numbers: np.ndarray, bounds: tuple[float, float]) -> np.ndarray:
    return (bounds[0] < numbers) & (numbers < bounds[1])
