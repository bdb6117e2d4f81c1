"""Strides of many compass walkers at once, in floats, by DOP853's coefficients; no code of the package."""

import numpy as np
from scipy.integrate import DOP853

from tests.plants.oracle import GRAVITY, HIP_MASS, LEG, LEG_MASS, A, B

STANCE_WEIGHT = (HIP_MASS * LEG + LEG_MASS * (A + LEG)) * GRAVITY
SWING_WEIGHT = LEG_MASS * B * GRAVITY


def flow(x, torque):
    """ẋ (4, walkers) under the joints' torque S u (2, walkers), M solved by Cramer's rule."""
    one, two, rate_1, rate_2 = x
    couple = LEG_MASS * B * LEG
    m11, m22 = (HIP_MASS + LEG_MASS) * LEG**2 + LEG_MASS * A**2, LEG_MASS * B**2
    m12 = -couple * np.cos(one - two)
    swirl = couple * np.sin(one - two)
    first = torque[0] + swirl * rate_2**2 + STANCE_WEIGHT * np.sin(one)
    second = torque[1] - swirl * rate_1**2 - SWING_WEIGHT * np.sin(two)
    det = m11 * m22 - m12**2
    return np.stack([rate_1, rate_2, (m22 * first - m12 * second) / det, (m11 * second - m12 * first) / det])


def advance(x, h, torque):
    """One step of DOP853 without its error control; `torque` is a function of the state, or held."""
    stages = []
    for row in DOP853.A[: DOP853.n_stages]:
        at = x + h * sum(weight * stage for weight, stage in zip(row, stages, strict=False) if weight)
        stages.append(flow(at, torque(at) if callable(torque) else torque))
    return x + h * sum(weight * stage for weight, stage in zip(DOP853.B, stages, strict=True))


def impact(x):
    """Right after a touchdown, from the two angular momenta that are conserved."""
    one, two, rate_1, rate_2 = x
    cos = np.cos(one - two)
    ab = LEG_MASS * A * B
    before = (
        ((HIP_MASS * LEG**2 + 2 * LEG_MASS * A * LEG) * cos - ab) * rate_1 - ab * rate_2,
        -ab * rate_1,
    )
    p11 = HIP_MASS * LEG**2 + LEG_MASS * A**2 + LEG_MASS * LEG * (LEG - B * cos)
    p12 = LEG_MASS * B * (B - LEG * cos)
    p21, p22 = -LEG_MASS * B * LEG * cos, LEG_MASS * B**2
    det = p11 * p22 - p12 * p21
    return np.stack(
        [two, one, (p22 * before[0] - p12 * before[1]) / det, (p11 * before[1] - p21 * before[0]) / det]
    )


def stride(y, controller, held, step=0.01, longest=150):
    """From y (3, walkers) right after an impact to right after the next, and how long it took, or NaN."""
    x = np.stack([y[0], -y[0], y[1], y[2]])
    after, when = np.full_like(y, np.nan), np.full(y.shape[1], np.nan)
    walking = np.arange(y.shape[1])
    for k in range(longest):
        torque = controller(x) if held else controller
        ahead = advance(x, step, torque)
        lands = (x[0] + x[1] > 0) & (ahead[0] + ahead[1] <= 0) & (ahead[1] > ahead[0])
        if lands.any():
            start, held_there = x[:, lands], torque[:, lands] if held else torque
            tau = np.full(lands.sum(), step / 2)
            for _ in range(8):
                end = advance(start, tau, held_there)
                tau -= (end[0] + end[1]) / (end[2] + end[3])
            landed = impact(advance(start, tau, held_there))
            after[:, walking[lands]], when[walking[lands]] = landed[[0, 2, 3]], k * step + tau
        walking, x = walking[~lands], ahead[:, ~lands]
        if not len(walking):
            break
    return after, when


def virtual_gravity(slope=-0.07):
    """τ = (w₁ cos θ₁, −w₂ cos θ₂) tan φ as a function of the state."""
    return lambda x: np.tan(slope) * np.stack([STANCE_WEIGHT * np.cos(x[0]), -SWING_WEIGHT * np.cos(x[1])])


def network(data):
    """τ = S u of the network in a certificate, in floats, as a function of the state."""
    layers = [
        (np.array(W), np.array(b)[:, None]) for W, b in zip(data["weights"], data["biases"], strict=True)
    ]

    def torque(x):
        *hidden, (weight, bias) = layers
        for W, b in hidden:
            x = np.tanh(W @ x + b)
        low, high = np.array(data["low"])[:, None], np.array(data["high"])[:, None]
        u = np.clip(weight @ x + bias, low, high)
        return np.stack([u[0] + u[1], -u[1]])

    return torque


def controller(data):
    """The controller in a certificate, and whether its torque is held."""
    torque = network(data) if data["kind"] == "network" else virtual_gravity(float(data["slope"]))
    return torque, data["hold"] is not None


def fixed_point(torque, held, guess, step=0.01):
    """Newton's method on the return map, by central differences: the point and DP."""
    y = np.array(guess)
    for _ in range(8):
        eye = 1e-6 * np.eye(3)
        points = np.concatenate([y[:, None], y[:, None] + eye, y[:, None] - eye], axis=1)
        images, _ = stride(points, torque, held, step)
        jacobian = (images[:, 1:4] - images[:, 4:]) / 2e-6
        y = y + np.linalg.solve(np.eye(3) - jacobian, images[:, 0] - y)
    return y, jacobian


def eigenbasis(jacobian):
    """Real and imaginary parts of the unit eigenvectors as columns."""
    values, vectors = np.linalg.eig(jacobian)
    parts = [
        p
        for v, w in zip(values, vectors.T, strict=True)
        if v.imag >= 0
        for p in ([w.real, w.imag][: 1 + (v.imag > 0)])
    ]
    return np.stack(parts, axis=1)
