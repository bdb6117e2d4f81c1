"""Random piecewise smooth systems, and SciPy's solution of them with its own search for events.

A mass on one of two damped springs, between a floor that it bounces off, a ceiling that it bounces off where
it is fast enough and else goes through, and a switch between the springs where it turns above a height.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from coachable.plants import Event, Plant

NUDGE = 1e-9
"""So long after an event the signs of guards are clear [s]."""


class Switching(Plant):
    """The constants of the system are parts of its state, so that one compiled program serves all of them."""

    parameters: None = None
    name = "the mass between"
    state_names = ("x", "dx", "soft", "stiffness", "softness", "damping", "pull", "bounce", "fast")
    control_names = ("push",)
    start = (0.5, 0.0, 0.0, 10.0, 1.0, 0.0, 0.0, 1.0, 0.0)
    action_box = ((-1.0,), (1.0,))

    def flow(self, x, control):
        position, speed, soft, stiffness, softness, damping, pull, _, _ = x
        force = pull - jnp.where(soft > 0.5, softness, stiffness) * position - damping * speed
        return jnp.stack([speed, force + 0 * control[0], *(jnp.zeros_like(x[0]),) * 7])

    @property
    def events(self):
        def bounce(x):
            return x.at[1].multiply(-x[7])

        def switch(x):
            return x.at[2].set(1 - x[2])

        return (
            Event("touchdown", lambda x: x[0], bounce),
            Event("ceiling", lambda x: 1 - x[0], bounce, lambda x: x[1] > x[8], restarts_clock=False),
            Event("switch", lambda x: x[1], switch, lambda x: x[0] > 0.4, restarts_clock=False),
        )

    def base(self, x, foot_x):
        return jnp.stack([foot_x, x[0]])


def random_starts(count, seed=0):
    """A start and a system in each row."""
    rng = np.random.default_rng(seed)
    stiffness = rng.uniform(20, 200, count)
    columns = [
        rng.uniform(0.1, 0.9, count),
        rng.uniform(-3, 3, count),
        rng.integers(0, 2, count),
        stiffness,
        rng.uniform(5, 40, count),
        rng.uniform(0, 0.5, count),
        stiffness * rng.uniform(-0.3, 0.5, count),
        rng.uniform(0.5, 1.0, count),
        rng.uniform(0, 3, count),
    ]
    return np.stack(columns, axis=-1)


class Solution(NamedTuple):
    state: np.ndarray
    """At the end."""
    touchdowns: list[float]
    """[s]"""


def solved(start, seconds, slowest=0.5, closest=5e-3):
    """A system's motion; a guard counts only once it was above zero, and is watched in dense output.

    `None` where a guard was nearly grazed, or two events were nearly one.
    """
    time, state, touchdowns, last = 0.0, np.array(start), [], -1.0
    guards = (lambda x: x[0], lambda x: 1 - x[0], lambda x: x[1])
    counts = (lambda x: True, lambda x: x[1] > x[8], lambda x: x[0] > 0.4)

    def flow(t, x):
        return np.array([x[1], x[6] - x[4 if x[2] > 0.5 else 3] * x[0] - x[5] * x[1], *[0.0] * 7])

    while True:
        armed = [guard(state) > 0 for guard in guards]
        searches = []
        for guard, above in zip(guards, armed, strict=True):
            searches.append(lambda t, x, guard=guard: guard(x))
            searches[-1].terminal, searches[-1].direction = True, -1 if above else 1
        piece = solve_ivp(
            flow, (time, seconds), state, "DOP853", rtol=1e-10, atol=1e-12, max_step=0.01, events=searches
        )
        time, state = piece.t[-1], piece.y[:, -1]
        if piece.status == 0:
            return Solution(state, touchdowns)
        which = next(index for index, times in enumerate(piece.t_events) if len(times))
        rates = (state[1], -state[1], flow(time, state)[1])
        if armed[which]:
            if abs(rates[which]) < slowest or time - last < closest:
                return None
            last = time
            if counts[which](state):
                if which == 0:
                    touchdowns.append(time)
                if which == 2:
                    state[2] = 1 - state[2]
                else:
                    state[1] *= -state[7]
        time, state = time + NUDGE, state + NUDGE * flow(time, state)
        if time >= seconds:
            return None
