"""The compass walker once more, in the paper's matrices, for SciPy: nothing of `walker.py` is used here."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from coachable.plants.compass.parameters import CompassParameters
from coachable.plants.restated import Control, Restated, RestatedEvent, State


def restated(parameters: CompassParameters) -> Restated:
    """M(θ) θ̈ + C(θ, θ̇) θ̇ + g(θ) = S u and T⁺ θ̇⁺ = T⁻ θ̇⁻, Harnack et al., CDC 2023."""
    walker = _Walker(parameters)
    touchdown = RestatedEvent(
        name="touchdown",
        guard=lambda x: math.sin((x[0] + x[1]) / 2),
        admissible=lambda x: x[1] > x[0],
        reset=walker.impact,
        displacement=walker.step_length,
        restarts_clock=True,
    )
    return Restated(walker.flow, (touchdown,), lambda x: math.cos(x[0]))


def virtual_gravity(
    parameters: CompassParameters, slope: float, released: bool
) -> Callable[[State], Control]:
    """The torques of virtual gravity, Asano, Luo and Yamakita (2005); see `VirtualGravity`."""
    p = parameters
    length, pull = p.a + p.b, p.gravity * math.tan(slope)

    def torques(x: State) -> Control:
        stance = (p.hip_mass * length + p.leg_mass * (p.a + length)) * math.cos(x[0])
        swing = -p.leg_mass * p.b * math.cos(x[2] if released else x[1])
        return pull * np.array([stance + swing, -swing])

    return torques


@dataclass(frozen=True)
class _Walker:
    parameters: CompassParameters

    def flow(self, x: State, u: Control) -> list[float]:
        """ẋ, the 2 × 2 system solved by Cramer's rule."""
        p = self.parameters
        l = p.a + p.b  # noqa: E741
        th1, th2, dth1, dth2 = x
        couple = p.leg_mass * l * p.b
        m11, m12, m22 = (
            (p.hip_mass + p.leg_mass) * l**2 + p.leg_mass * p.a**2,
            -couple * math.cos(th1 - th2),
            p.leg_mass * p.b**2,
        )
        swirl = couple * math.sin(th1 - th2)
        g1 = -(p.hip_mass * l + p.leg_mass * (p.a + l)) * p.gravity * math.sin(th1)
        g2 = p.leg_mass * p.b * p.gravity * math.sin(th2)
        r1 = u[0] + u[1] + swirl * dth2 * dth2 - g1
        r2 = -u[1] - swirl * dth1 * dth1 - g2
        det = m11 * m22 - m12 * m12
        return [dth1, dth2, (m22 * r1 - m12 * r2) / det, (m11 * r2 - m12 * r1) / det]

    def impact(self, x: State) -> State:
        """The state right after a touchdown, the legs having changed roles."""
        p = self.parameters
        l = p.a + p.b  # noqa: E741
        m, cos = p.leg_mass, math.cos(x[0] - x[1])
        before = np.array(
            [
                [(p.hip_mass * l**2 + 2 * m * p.a * l) * cos - m * p.a * p.b, -m * p.a * p.b],
                [-m * p.a * p.b, 0.0],
            ]
        )
        after = np.array(
            [
                [p.hip_mass * l**2 + m * p.a**2 + m * l * (l - p.b * cos), m * p.b * (p.b - l * cos)],
                [-m * p.b * l * cos, m * p.b**2],
            ]
        )
        stance, swing = np.linalg.solve(after, before @ x[2:])
        return np.array([x[1], x[0], stance, swing])

    def step_length(self, x: State) -> float:
        """How far in front of the stance foot the swing foot is [m]."""
        return (self.parameters.a + self.parameters.b) * (math.sin(x[1]) - math.sin(x[0]))
