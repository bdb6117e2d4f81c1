"""The compass walker once more, with SciPy: what a counterexample must survive before anybody sees it.

Nothing of the plant, the integrator, the event search or the networks that the search ran on is used here:
the equations are written down again, in the paper's matrices, and integrated by DOP853.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from coachable.envs.walking_task import Clock
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.learning.policy import Policy
from coachable.plants.compass import CompassParameters, VirtualGravity
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.verification.falsification.perturbation import CONTROL_DT

_LOOKS = 16
"""In how many places of a control step events are looked for, before they are located."""
_MOST_TOUCHDOWNS = 2
"""One more within a control step is chatter, which is a fall."""

State = Float[np.ndarray, "4"]
Torque = Float[np.ndarray, "2"]


@dataclass(frozen=True, eq=False)
class Resimulation:
    """A walk as SciPy has it: a row a sample, the first and the last state included."""

    time: Float[np.ndarray, " samples"]
    """[s]"""
    states: Float[np.ndarray, "samples 4"]
    """θ1, θ2 [rad], θ̇1, θ̇2 [rad/s]."""
    torques: Float[np.ndarray, "samples 2"]
    """Ankle and hip torque as applied from the sample on, disturbance included [N m]; the last row is 0."""
    foot_x: Float[np.ndarray, " samples"]
    """Where the stance foot stands [m]."""
    fell: bool
    """Whether it ended with the hip on the ground, or with feet that chattered."""

    @property
    def seconds(self) -> float:
        """How long the walker was up [s]."""
        return float(self.time[-1])


def resimulate(
    controller: object,
    x0: State,
    disturbance: Float[np.ndarray, "steps 2"],
    parameters: CompassParameters,
    clock: Clock,
    seconds: float,
) -> Resimulation:
    """Walk from x0 until the walker falls or the time is over, in float64.

    **Arguments:** `controller`, a learned policy or a baseline; `disturbance`, torques that are added to the
    controller's in the first control steps [N m]; `clock`, whether a touchdown ends the control step;
    `seconds`, how long to walk.

    **Raises:** `ParameterError` for a controller that is written in JAX alone.
    """
    torque_at, walker = numpy_controller(controller), _Walker(parameters)
    x, foot_x, time, in_a_row, fell = np.asarray(x0, float), 0.0, 0.0, 0, False
    rows: list[tuple[float, State, Torque, float]] = []
    full_steps, time_in_others = 0, 0.0
    while not fell and time < seconds - 1e-3 * CONTROL_DT:
        push = disturbance[len(rows)] if len(rows) < len(disturbance) else np.zeros(2)
        torque = torque_at(x) + push
        rows.append((time, x, torque, foot_x))
        left, after_impact = CONTROL_DT, False
        in_a_row = in_a_row if clock == "touchdown" else 0
        while left > 0 and not fell:
            x, passed, what = walker.until_event(x, torque, left, after_impact)
            left -= passed
            if what == "touchdown":
                foot_x += walker.step_length(x)
                x, after_impact = walker.impact(x), True
                in_a_row += 1
                fell = in_a_row > _MOST_TOUCHDOWNS
                if clock == "touchdown":
                    break
            fell = fell or what == "fall"
        if fell or (after_impact and clock == "touchdown"):
            time_in_others += CONTROL_DT - left
        else:
            full_steps, in_a_row = full_steps + 1, 0
        time = full_steps * CONTROL_DT + time_in_others
    rows.append((time, x, np.zeros(2), foot_x))
    times, states, torques, feet = (np.array(column) for column in zip(*rows, strict=True))
    return Resimulation(times, states, torques, feet, fell)


def numpy_controller(controller: object) -> Callable[[State], Torque]:
    """A learned policy or a baseline as a function x ↦ u in NumPy and float64.

    **Raises:** `ParameterError` for anything else.
    """
    match controller:
        case Policy():
            return _numpy_policy(controller)
        case VirtualGravity(plant=plant, slope=slope, released=released):
            p = plant.parameters
            pull = p.gravity * math.tan(slope)

            def virtual_gravity(x: State) -> Torque:
                stance = (p.hip_mass * p.leg_length + p.leg_mass * (p.a + p.leg_length)) * math.cos(x[0])
                swing = -p.leg_mass * p.b * math.cos(x[2] if released else x[1])
                return pull * np.array([stance + swing, -swing])

            return virtual_gravity
        case ConstantTorque(torque=torque):
            return lambda x: np.array(torque)
        case NoTorque(2):
            return lambda x: np.zeros(2)
    known = ", ".join(kind.__name__ for kind in (Policy, VirtualGravity, ConstantTorque, NoTorque))
    raise ParameterError(
        f"a {type(controller).__name__} cannot be simulated a second time without JAX, so no fall of it "
        f"could be confirmed; give one of {known}"
    )


def _numpy_policy(policy: Policy) -> Callable[[State], Torque]:
    if policy.activation != "tanh" or policy.squashing not in ("clip", "tanh"):
        raise ParameterError(f"activation {policy.activation!r}; {suggestion(policy.activation, ['tanh'])}")
    weights = [np.asarray(weight, np.float64) for weight in policy.weights]
    biases = [np.asarray(bias, np.float64) for bias in policy.biases]
    low, high = np.asarray(policy.low, np.float64), np.asarray(policy.high, np.float64)

    def torque(x: State) -> Torque:
        for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
            x = np.tanh(weight @ x + bias)
        out = weights[-1] @ x + biases[-1]
        if policy.squashing == "clip":
            return np.clip(out, low, high)
        return low + (high - low) * (np.tanh(out) + 1) / 2

    return torque


@dataclass(frozen=True)
class _Walker:
    """M(θ) θ̈ + C(θ, θ̇) θ̇ + g(θ) = S u and T⁺ θ̇⁺ = T⁻ θ̇⁻, Harnack et al., CDC 2023."""

    parameters: CompassParameters

    def flow(self, _: float, x: State, u: Torque) -> list[float]:
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

    def until_event(
        self, x: State, torque: Torque, duration: float, after_impact: bool
    ) -> tuple[State, float, str]:
        """The state at the first event or after `duration`, how much time passed, and what happened.

        A touchdown is a falling zero of sin((θ1 + θ2) / 2) with the swing leg in front; a fall is one of
        cos θ1. Right after an impact the first of them is zero, whatever rounding says.
        """
        walk = solve_ivp(
            self.flow, (0, duration), x, "DOP853", args=(torque,), dense_output=True, rtol=1e-11, atol=1e-12
        )
        at = walk.sol
        times = np.linspace(0, duration, _LOOKS + 1)
        states = at(times)
        guard, height = np.sin((states[0] + states[1]) / 2), np.cos(states[0])
        guard[0] = 0.0 if after_impact else guard[0]
        height[0] = max(height[0], 0.0)
        for k in range(_LOOKS):
            found = []
            if guard[k] > 0 >= guard[k + 1]:
                root = brentq(lambda t: math.sin(sum(at(t)[:2]) / 2), times[k], times[k + 1], xtol=1e-15)
                if at(root)[1] > at(root)[0]:
                    found.append((root, "touchdown"))
            if height[k + 1] <= 0:
                inside = height[k] > 0
                found.append(
                    (
                        brentq(lambda t: math.cos(at(t)[0]), times[k], times[k + 1]) if inside else times[k],
                        "fall",
                    )
                )
            if found:
                time, what = min(found)
                return at(time), float(time), what
        return walk.y[:, -1], duration, ""
