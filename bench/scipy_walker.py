"""The compass walker as a Gymnasium environment on SciPy's `solve_ivp`: what one writes for one robot.

It is the opponent of the benchmark, so all around the integrator it is written to be fast: plain floats
instead of small arrays, orthants by comparison. The equations of motion are there twice: `matrix_flow` as one
writes them down from the paper, and `scalar_flow` as after a day with the profiler, in plain floats. Physics,
task and reward are those of the paper with the setup "orthant".
"""

from __future__ import annotations

from math import cos, hypot, pi, sin

import gymnasium
import numpy as np
from scipy.integrate import solve_ivp

HIP_MASS, LEG_MASS = 1.0, 0.5  # kg
A, B = 0.5, 0.5  # m, foot to leg mass and leg mass to hip
LENGTH = A + B
GRAVITY = 9.807  # m/s²
CONTROL_DT, SECONDS = 0.01, 10.0  # s
START = (0.0, 0.0, -0.4, 2.0)
MOST_TOUCHDOWNS = 2  # in one control step; one more is chatter
CLEARANCE = 1e-12  # rad

INERTIA_STANCE = (HIP_MASS + LEG_MASS) * LENGTH**2 + LEG_MASS * A**2
INERTIA_SWING = LEG_MASS * B**2
COUPLING = LEG_MASS * LENGTH * B
STANCE_WEIGHT = (HIP_MASS * LENGTH + LEG_MASS * (A + LENGTH)) * GRAVITY
SWING_WEIGHT = LEG_MASS * B * GRAVITY


INPUTS = np.array([[1.0, 1.0], [0.0, -1.0]])


def matrix_flow(_time, x, ankle, hip):
    """The derivative of (θ1, θ2, θ̇1, θ̇2) under M(θ)θ̈ + C(θ,θ̇)θ̇ + g(θ) = Su (paper, eq. 1)."""
    theta_1, theta_2, dtheta_1, dtheta_2 = x
    off = -COUPLING * np.cos(theta_1 - theta_2)
    twist = COUPLING * np.sin(theta_1 - theta_2)
    mass = np.array([[INERTIA_STANCE, off], [off, INERTIA_SWING]])
    coriolis = np.array([[0.0, -twist * dtheta_2], [twist * dtheta_1, 0.0]])
    gravity = np.array([-STANCE_WEIGHT * np.sin(theta_1), SWING_WEIGHT * np.sin(theta_2)])
    velocity = x[2:]
    torque = INPUTS @ np.array([ankle, hip])
    return np.concatenate([velocity, np.linalg.solve(mass, torque - coriolis @ velocity - gravity)])


def scalar_flow(_time, x, ankle, hip):
    """`matrix_flow` in plain floats."""
    theta_1, theta_2, dtheta_1, dtheta_2 = x.tolist()
    off = -COUPLING * cos(theta_1 - theta_2)
    twist = COUPLING * sin(theta_1 - theta_2)
    right_1 = ankle + hip + twist * dtheta_2 * dtheta_2 + STANCE_WEIGHT * sin(theta_1)
    right_2 = -hip - twist * dtheta_1 * dtheta_1 - SWING_WEIGHT * sin(theta_2)
    determinant = INERTIA_STANCE * INERTIA_SWING - off * off
    return (
        dtheta_1,
        dtheta_2,
        (INERTIA_SWING * right_1 - off * right_2) / determinant,
        (INERTIA_STANCE * right_2 - off * right_1) / determinant,
    )


FLOWS = {"matrix": matrix_flow, "scalar": scalar_flow}


def touchdown(_time, x, _ankle, _hip):
    """Zero where the swing foot meets the ground in front of the stance foot."""
    return x[0] + x[1]


def fall(_time, x, _ankle, _hip):
    """Zero where the hip meets the ground."""
    return pi / 2 - abs(x[0])


touchdown.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
touchdown.direction = -1.0  # pyright: ignore[reportFunctionMemberAccess]
fall.terminal = True  # pyright: ignore[reportFunctionMemberAccess]


def impact(theta_1, theta_2, dtheta_1, dtheta_2):
    """The state after touchdown: legs swapped, angular momenta about the new foot and the hip conserved."""
    c = cos(theta_1 - theta_2)
    momentum_hip = -LEG_MASS * A * B * dtheta_1
    momentum_foot = (
        momentum_hip
        + (HIP_MASS * LENGTH**2 + 2 * LEG_MASS * A * LENGTH) * c * dtheta_1
        - LEG_MASS * A * B * dtheta_2
    )
    stance_row = (INERTIA_STANCE - COUPLING * c, INERTIA_SWING - COUPLING * c)
    swing_row = (-COUPLING * c, INERTIA_SWING)
    determinant = stance_row[0] * swing_row[1] - stance_row[1] * swing_row[0]
    new_stance = (swing_row[1] * momentum_foot - stance_row[1] * momentum_hip) / determinant
    new_swing = (stance_row[0] * momentum_hip - swing_row[0] * momentum_foot) / determinant
    return theta_2, theta_1, new_stance, new_swing


def orthant(theta_1, theta_2, dtheta_1, dtheta_2):
    """1 to 4 in the walking cycle, 0 outside (paper, μ2)."""
    if theta_2 > 0 and dtheta_1 <= 0:
        if dtheta_2 > 0:
            return 2 if theta_1 > 0 else 3
        return 4 if theta_1 <= 0 else 0
    if theta_1 > 0 and theta_2 <= 0 and dtheta_1 <= 0 and dtheta_2 > 0:
        return 1
    return 0


class ScipyWalker(gymnasium.Env):
    """The paper's walking task: 10 s, torques in [−2, 0]² N m held for 0.01 s, reward setup "orthant"."""

    def __init__(self, flow):
        self.flow = flow
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4,), np.float32)
        self.action_space = gymnasium.spaces.Box(-2.0, 0.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        """Stand at the paper's x0 with the stance foot at 0 m."""
        super().reset(seed=seed)
        self.x = START
        self.foot_x = 0.0
        self.steps = 0
        self.action = None
        self.orthant = orthant(*START)
        return np.array(self.x, np.float32), {}

    def step(self, action):
        """Hold the clipped torque for one control step."""
        ankle, hip = (min(max(float(u), -2.0), 0.0) for u in action)
        fallen = self._advance(ankle, hip)
        self.steps += 1
        done = self.steps >= round(SECONDS / CONTROL_DT)

        last, self.orthant = self.orthant, orthant(*self.x)
        in_order = self.orthant > 0 and (last in (0, self.orthant) or self.orthant == last % 4 + 1)
        last_ankle, last_hip = self.action or (ankle, hip)
        self.action = (ankle, hip)
        reward = 0.01 if in_order else -0.01
        reward -= 0.001 * hypot(ankle - last_ankle, hip - last_hip)
        if fallen:
            reward -= 10.0
        elif done:
            reward += self.hip_x
        return np.array(self.x, np.float32), reward, fallen or done, False, {}

    @property
    def hip_x(self):
        """Where the hip is [m]."""
        return self.foot_x - LENGTH * sin(self.x[0])

    def _advance(self, ankle, hip):
        """Integrate over one control step, through touchdowns; whether it ended in a fall."""
        time, touchdowns = 0.0, 0
        while time < CONTROL_DT:
            # RK45 with rtol 1e-3 and atol 1e-6 are solve_ivp's own defaults.
            solution = solve_ivp(
                self.flow, (time, CONTROL_DT), self.x, events=(touchdown, fall), args=(ankle, hip)
            )
            time, self.x = float(solution.t[-1]), tuple(solution.y[:, -1].tolist())
            if len(solution.t_events[1]):
                return True
            if solution.status == 0:
                return False
            theta_1, theta_2 = self.x[:2]
            if theta_2 > theta_1:
                touchdowns += 1
                if touchdowns > MOST_TOUCHDOWNS:
                    return True
                self.foot_x += LENGTH * (sin(theta_2) - sin(theta_1))
                self.x = impact(*self.x)
            # Just past the surface, or the same crossing would be found again.
            self.x = (self.x[0], -self.x[0] - CLEARANCE, *self.x[2:])
        return False
