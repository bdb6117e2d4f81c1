"""The compass walker once more, in NumPy and SciPy, from the paper; shares no code with the package."""

import numpy as np
from scipy.integrate import solve_ivp

HIP_MASS, LEG_MASS, A, B, GRAVITY = 1.0, 0.5, 0.5, 0.5, 9.807
LEG = A + B
X0 = np.array([0.0, 0.0, -0.4, 2.0])


def flow(_, x, u):
    theta, dtheta = x[:2], x[2:]
    cos, sin = np.cos(theta[0] - theta[1]), np.sin(theta[0] - theta[1])
    couple = LEG_MASS * B * LEG
    mass = np.array(
        [[(HIP_MASS + LEG_MASS) * LEG**2 + LEG_MASS * A**2, -couple * cos], [-couple * cos, LEG_MASS * B**2]]
    )
    coriolis = couple * sin * np.array([[0, -dtheta[1]], [dtheta[0], 0]])
    gravity = GRAVITY * np.array(
        [
            -(HIP_MASS * LEG + LEG_MASS * A + LEG_MASS * LEG) * np.sin(theta[0]),
            LEG_MASS * B * np.sin(theta[1]),
        ]
    )
    torque = np.array([[1, 1], [0, -1]]) @ u
    return np.concatenate([dtheta, np.linalg.solve(mass, torque - coriolis @ dtheta - gravity)])


def impact(x):
    cos = np.cos(x[0] - x[1])
    before = np.array(
        [
            [(HIP_MASS * LEG**2 + 2 * LEG_MASS * A * LEG) * cos - LEG_MASS * A * B, -LEG_MASS * A * B],
            [-LEG_MASS * A * B, 0],
        ]
    )
    after = np.array(
        [
            [
                HIP_MASS * LEG**2 + LEG_MASS * A**2 + LEG_MASS * LEG * (LEG - B * cos),
                LEG_MASS * B * (B - LEG * cos),
            ],
            [-LEG_MASS * B * LEG * cos, LEG_MASS * B**2],
        ]
    )
    return np.concatenate([x[1::-1], np.linalg.solve(after, before @ x[2:])])


def virtual_gravity(x, slope=-0.07):
    pull = GRAVITY * np.tan(slope)
    stance = (HIP_MASS * LEG + LEG_MASS * (A + LEG)) * np.cos(x[0]) * pull
    swing = -LEG_MASS * B * np.cos(x[1]) * pull
    return np.array([stance + swing, -swing])


def swing_foot_comes_down(_, x, u):
    return LEG * (np.cos(x[0]) - np.cos(x[1])) if x[1] > x[0] else -1.0


swing_foot_comes_down.direction = -1
swing_foot_comes_down.terminal = True


def walk(controller, num_steps, control_dt=0.01):
    """States and hip positions at the samples, with the torque held in between."""
    x, foot_x = X0, 0.0
    states, hips = [x], [0.0]
    for _ in range(num_steps):
        u, left = controller(x), control_dt
        while left > 0:
            solution = solve_ivp(
                flow, (0, left), x, "DOP853", args=(u,), events=swing_foot_comes_down, rtol=1e-12, atol=1e-13
            )
            x, left = solution.y[:, -1], left - solution.t[-1]
            if solution.status == 1:
                foot_x += LEG * (np.sin(x[1]) - np.sin(x[0]))
                x = impact(x)
        states.append(x)
        hips.append(foot_x - LEG * np.sin(x[0]))
    return np.array(states), np.array(hips)
