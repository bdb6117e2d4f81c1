"""Walks whose feet come to the ground as a pattern says, and what of it a gait does not fix at random."""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st

from coachable.automata.trace import Trace
from coachable.behaviours import Signal
from coachable.gaits.footfalls import SHORTEST

PHASES = {
    "together": st.floats(-0.08, 0.08),
    "in turn": st.floats(0.43, 0.57),
    "behind": st.floats(0.2, 0.3) | st.floats(0.7, 0.8),
}
LOW, HIGH, ANY = st.floats(0.2, 0.43), st.floats(0.56, 0.75), st.floats(0.2, 0.75)


@dataclass(frozen=True)
class Pattern:
    """Footfalls that repeat.

    `landings`: by foot, when in a stride it lands. `stance`: how long a foot then stays down, in strides.
    `stride` [s]. `jitter`: how far a touchdown may be from where it should be, in strides.
    """

    landings: dict[str, list[float]]
    stance: float
    stride: float = 0.8
    jitter: float = 0.0
    chatter: bool = False
    dt: float = 0.01
    seed: int = 0
    num_strides: int = 12

    def walk(self) -> Trace:
        """The recorded walk."""
        random = np.random.default_rng(self.seed)
        time = np.arange(round(self.num_strides * self.stride / self.dt)) * self.dt
        values = {"torso_x": 1.5 * time}
        for foot, landings in self.landings.items():
            contact = np.zeros(len(time), bool)
            for stride in range(-1, self.num_strides + 1):
                for phase in landings:
                    # Half a sample off, so that rounding decides nothing.
                    off = self.jitter * random.uniform(-1, 1)
                    begin = (stride + phase + off + 0.1) * self.stride - self.dt / 2
                    ends = np.array([begin, begin + self.stance * self.stride])
                    first, last = np.clip(np.ceil(ends / self.dt), 0, None).astype(int)
                    contact[first:last] = True
            if self.chatter:
                contact = chattering(contact, self.dt, random)
            values[f"{foot}foot_contact"] = contact.astype(float)
        return Trace(time, tuple(map(Signal, values)), values)


def chattering(contact, dt, random):
    """With flips that are too short to be steps, one in half a second at most."""
    contact, longest = contact.copy(), max(1, round(SHORTEST / dt) - 1)
    if dt >= SHORTEST / 1.5:  # a flip of one sample would not be told from a step
        return contact
    for begin in range(0, len(contact), round(0.5 / dt)):
        at = begin + int(random.integers(round(0.2 / dt)))
        contact[at : at + int(random.integers(1, longest + 1))] ^= True
    return contact


def details(pattern: st.SearchStrategy[Pattern]) -> st.SearchStrategy[Pattern]:
    """The pattern with any stride, noise, sampling and chatter."""
    return st.builds(
        lambda pattern, **rest: replace(pattern, **rest),
        pattern,
        stride=st.floats(0.6, 1.2),
        jitter=st.floats(0, 0.03),
        chatter=st.booleans(),
        dt=st.sampled_from([0.004, 0.008, 0.015]),
        seed=st.integers(0, 10**6),
    )


def two(lag, stance, first="left_", second="right_"):
    return st.builds(lambda lag, stance: Pattern({first: [0.0], second: [lag]}, stance), PHASES[lag], stance)


def four(hind, fore, side, stance):
    """`side`: when the fore left foot lands after the hind left one."""
    return st.builds(
        lambda hind, fore, side, stance: Pattern(
            {
                "back_left_": [0.0],
                "back_right_": [hind],
                "front_left_": [side],
                "front_right_": [side + fore],
            },
            stance,
        ),
        PHASES[hind],
        PHASES[fore],
        side,
        stance,
    )


QUARTER = st.floats(0.2, 0.3) | st.floats(0.7, 0.8)

GAITS = {
    "walks": [two("in turn", HIGH), four("in turn", "in turn", QUARTER, HIGH)],
    "runs": [two("in turn", LOW)],
    "gallops": [
        two("behind", LOW),
        four("behind", "behind", st.floats(0, 1), LOW),
        four("together", "behind", st.floats(0, 1), LOW),
    ],
    "hops": [two("together", ANY), st.builds(lambda stance: Pattern({"": [0.0]}, stance), ANY)],
    "hops on left": [st.builds(lambda s: Pattern({"left_": [0.0], "right_": []}, s), ANY)],
    "hops on right": [st.builds(lambda s: Pattern({"left_": [], "right_": [0.0]}, s), ANY)],
    "skips": [
        st.builds(
            lambda hop, stance: Pattern({"left_": [0.0, hop], "right_": [0.5, 0.5 + hop]}, stance),
            st.floats(0.22, 0.28),
            st.floats(0.08, 0.14),
        )
    ],
    "bounds": [
        two("in turn", LOW, "back_", "front_"),
        two("behind", LOW, "back_", "front_"),
        four("together", "together", st.floats(0.3, 0.7), LOW),
    ],
    "pronks": [
        two("together", LOW, "back_", "front_"),
        four("together", "together", PHASES["together"], LOW),
    ],
    "trots": [four("in turn", "in turn", st.floats(0.45, 0.55), ANY)],
    "paces": [four("in turn", "in turn", st.floats(-0.05, 0.05), ANY)],
    "ambles": [four("in turn", "in turn", QUARTER, LOW)],
}
