"""A plant simulated once more, with SciPy: what a counterexample must survive before it is shown.

Nothing of the plant, the integrator, the event search or the networks that the search ran on is used here:
the plant's second statement (`plants/restated.py`) is integrated by DOP853.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from jaxtyping import Float
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ndtr

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.learning.policy import Policy
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.plants.restated import Control, Restated, RestatedEvent, State
from coachable.plants.sampled import Clock
from coachable.rewards.controller_memory import ControllerMemory, Remembered
from coachable.verification.falsification.perturbation import CONTROL_DT

_LOOKS = 16
"""In how many places of a control step events are looked for, before they are located."""
_MOST_TOUCHDOWNS, _MOST_OTHERS = 2, 63
"""One more of them, or of other events, within a control step is chatter, which is a fall."""


@dataclass(frozen=True, eq=False)
class Resimulation:
    """A walk as SciPy has it: a row a sample, the first and the last state included."""

    time: Float[np.ndarray, " samples"]
    """[s]"""
    states: Float[np.ndarray, "samples state"]
    controls: Float[np.ndarray, "samples control"]
    """As applied from the sample on, disturbance included; the last row is 0."""
    foot_x: Float[np.ndarray, " samples"]
    """Where the stance foot stands [m]."""
    fell: bool
    """Whether it ended in a fall, or with feet that chattered."""

    @property
    def seconds(self) -> float:
        """How long the plant was up [s]."""
        return float(self.time[-1])


def resimulate(
    plant: Restated,
    controller: object,
    x0: State,
    disturbance: Float[np.ndarray, "steps control"],
    clock: Clock,
    seconds: float,
) -> Resimulation:
    """Walk from x0 until the plant falls or the time is over, in float64.

    **Arguments:** `plant`, its second statement; `controller`, as `numpy_controller` takes it;
    `disturbance`, what is added to its controls in the first control steps; `clock`, whether an event that
    restarts the clock ends the control step; `seconds`, how long to walk.
    """
    control_at, memory = numpy_controller(controller), _Recall.of(controller)
    x, foot_x, time, in_a_row, fell = np.asarray(x0, float), 0.0, 0.0, 0, False
    rows: list[tuple[float, State, Control, float]] = []
    full_steps, time_in_others = 0, 0.0
    nothing = np.zeros(disturbance.shape[1])
    while not fell and time < seconds - 1e-3 * CONTROL_DT:
        push = disturbance[len(rows)] if len(rows) < len(disturbance) else nothing
        control = control_at(x if memory is None else memory.beside(x, time)) + push
        rows.append((time, x, control, foot_x))
        left, cut, others = CONTROL_DT, False, 0
        last: RestatedEvent | None = None
        in_a_row = in_a_row if clock == "touchdown" else 0
        while left > 0 and not fell:
            x, passed, event, fell = _until_event(plant, x, control, left, last)
            left -= passed
            if event is not None:
                foot_x += event.displacement(x)
                x, last = event.reset(x), event
                in_a_row, others = in_a_row + event.restarts_clock, others + (not event.restarts_clock)
                fell = in_a_row > _MOST_TOUCHDOWNS or others > _MOST_OTHERS
                if event.restarts_clock and clock == "touchdown":
                    cut = True
                    break
        if fell or cut:
            time_in_others += CONTROL_DT - left
        else:
            full_steps, in_a_row = full_steps + 1, 0
        time = full_steps * CONTROL_DT + time_in_others
    rows.append((time, x, nothing, foot_x))
    times, states, controls, feet = (np.array(column) for column in zip(*rows, strict=True))
    return Resimulation(times, states, controls, feet, fell)


def numpy_controller(controller: object) -> Callable[[State], Control]:
    """A learned policy or a controller that is written down as a function in NumPy and float64.

    It takes what the controller observes: x, and of a policy with a memory what it shows.

    **Raises:** `ParameterError` for a controller without such a form.
    """
    match controller:
        case Policy():
            _Recall.of(controller)
            return _numpy_policy(controller)
        case ConstantTorque(torque=torque):
            return lambda x: np.array(torque)
        case NoTorque(size=size):
            return lambda x: np.zeros(size)
    if (restated := getattr(controller, "restated", None)) is not None:
        return restated()
    raise ParameterError(
        f"a {type(controller).__name__} cannot be simulated a second time without JAX, so no fall of it "
        "could be confirmed; give a Policy, a ConstantTorque, NoTorque or a controller with `restated`"
    )


def _numpy_policy(policy: Policy) -> Callable[[State], Control]:
    if policy.activation != "tanh" or policy.squashing not in ("clip", "tanh"):
        raise ParameterError(f"activation {policy.activation!r}; {suggestion(policy.activation, ['tanh'])}")
    weights = [np.asarray(weight, np.float64) for weight in policy.weights]
    biases = [np.asarray(bias, np.float64) for bias in policy.biases]
    low, high = np.asarray(policy.low, np.float64), np.asarray(policy.high, np.float64)
    std = None if policy.std is None else np.asarray(policy.std, np.float64)

    def control(x: State) -> Control:
        for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
            x = np.tanh(weight @ x + bias)
        out = weights[-1] @ x + biases[-1]
        if policy.deterministic == "expected-action" and std is not None:
            return low + std * (_mean_excess((out - low) / std) - _mean_excess((out - high) / std))
        if policy.squashing == "clip":
            return np.clip(out, low, high)
        return low + (high - low) * (np.tanh(out) + 1) / 2

    return control


class _Recall:
    """What a policy remembers along one walk, and observes behind the state."""

    def __init__(self, memory: ControllerMemory, rows: list[int]):
        self._memory, self._rows = memory, rows
        self._now: Remembered | None = None
        self._time = 0.0

    @staticmethod
    def of(controller: object) -> _Recall | None:
        """Before the walk's first sample; `None` of a state feedback.

        **Raises:** `ParameterError` where phases are not written in the state's coordinates alone.
        """
        memory = ControllerMemory.of(controller)
        if memory is None or not isinstance(controller, Policy):
            return None
        names = controller.observation_names
        if missing := [name for name in memory.signal_names if name not in names]:
            raise ParameterError(
                f"the policy's phases are written in {missing[0]!r}, which is no coordinate of the state, so "
                "no fall of it could be confirmed without JAX"
            )
        return _Recall(memory, [names.index(name) for name in memory.signal_names])

    def beside(self, x: State, time: float) -> Float[np.ndarray, " observation"]:
        """The observation at the next sample."""
        signals = x[self._rows]
        if self._now is None:
            self._now = self._memory.begun(signals)
        else:
            self._now = self._memory.after(self._now, signals, time - self._time)
        self._time = time
        return np.append(x, self._memory.shown(self._now, signals))


def _mean_excess(z: Control) -> Control:
    """E[max(Z + z, 0)] of a standard normal Z: z Φ(z) + φ(z)."""
    return z * ndtr(z) + np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)


def _until_event(
    plant: Restated, x: State, control: Control, duration: float, last: RestatedEvent | None
) -> tuple[State, float, RestatedEvent | None, bool]:
    """The state at the first event or fall or after `duration`, the time passed, the event, whether it fell.

    An event is a falling zero of a guard at an admissible state; a fall is one of the fall margin. Right
    after an event its guard is zero, whatever rounding gives.
    """
    walk = solve_ivp(
        lambda _, x: plant.flow(x, control),
        (0, duration),
        x,
        "DOP853",
        dense_output=True,
        rtol=1e-11,
        atol=1e-12,
    )
    at = walk.sol
    times = np.linspace(0, duration, _LOOKS + 1)
    states = at(times).T
    guards = [[0.0 if event is last else event.guard(states[0])] for event in plant.events]
    for event, values in zip(plant.events, guards, strict=True):
        values += [event.guard(state) for state in states[1:]]
    margin = [plant.fall_margin(state) for state in states]
    margin[0] = max(margin[0], 0.0)
    for k in range(_LOOKS):
        found: list[tuple[float, int]] = []  # a fall is number −1, and comes first where times are equal
        for number, (event, guard) in enumerate(zip(plant.events, guards, strict=True)):
            if guard[k] > 0 >= guard[k + 1]:
                root = _root(lambda t, event=event: event.guard(at(t)), times[k], times[k + 1], xtol=1e-15)
                if event.admissible(at(root)):
                    found.append((root, number))
        if margin[k + 1] <= 0:
            inside = margin[k] > 0
            root = _root(lambda t: plant.fall_margin(at(t)), times[k], times[k + 1]) if inside else times[k]
            found.append((float(root), -1))
        if found:
            time, number = min(found)
            return at(time), time, plant.events[number] if number >= 0 else None, number < 0
    return walk.y[:, -1], duration, None, False


def _root(function: Callable[[float], float], low: float, high: float, xtol: float = 2e-12) -> float:
    return cast(float, brentq(function, low, high, xtol=xtol))
