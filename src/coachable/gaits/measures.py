"""Measures of a recorded walk: how fast it is, what it costs, and when its feet are on the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from coachable.automata.trace import Trace
from coachable.gaits.footfalls import (
    ENDS,
    TOUCHDOWN,
    alone,
    circular_mean,
    feet,
    four_legs,
    landings,
    phases,
    times_of,
)

SLOWEST = 0.1
"""Slower than this is standing [m/s]."""

POSITIONS = ("torso_x", "base_x")
"""The signals that may hold where the robot is; a walk has one of them."""

STANCE = "stance_foot_x"
"""The signal of where the foot that stands is on the ground [m]."""

FOOT_X = "foot_x"
"""How the signals of where a foot is ahead of its hip end [m]."""

_MEASURES: tuple[str, ...] = (
    "speed",
    "transport",
    "strides",
    "step_time",
    "step_length",
    "duty",
    "overlap",
    "flight",
    "alternation",
    "lag",
    "asymmetry",
    "step_asymmetry",
)


def measures(walk: Trace) -> dict[str, float]:
    """What the gait is like; NaN for what such a robot, or such a walk, does not have.

    | measure | is |
    |---|---|
    | `speed` | forward, on average [m/s] |
    | `transport` | cost of transport: the motors' work, braking counted as driving, per weight and distance |
    | `strides` | how many the busiest foot makes: from a landing to its next one |
    | `step_time` | from a landing to the next one, on average [s] |
    | `step_length` | from where a foot stands to where the next one does, on average [m] |
    | `duty` | duty factor: share of the time that a foot is on the ground, on average over feet |
    | `overlap` | share of the time with two feet or more on the ground |
    | `flight` | share of the time without a foot on the ground |
    | `alternation` | of all steps, the share from a landing of one foot alone to one of the other alone |
    | `lag` | when in a stride of the first foot the second lands, 0 … 1; ½ if they alternate |
    | `asymmetry` | of the feet's times on the ground, the difference over the mean [%] |
    | `step_asymmetry` | of the lengths of steps onto one foot and onto the other, the same [%] |

    What is a landing says `landings`. Shares of the time are those of the busiest foot's whole strides, if it
    makes any. The last four are those of two feet; `lag` is a circular mean, and of four feet that of a fore
    foot after the hind foot of its side (Hildebrand, Science 150, 1965). `asymmetry` is the index of
    Robinson, Herzog and Nigg (1987), without its sign; where it is recorded when feet touch down, of whole
    stances. A step onto a foot is as long as that foot is ahead of the other one when it lands alone, by the
    signals that end in `foot_x`; steps have a length if half of them or more alternate, and the feet hang
    from hips side by side.
    """
    time, values = walk.time, walk.values
    found: dict[str, float] = dict.fromkeys(_MEASURES, math.nan)
    position = next((values[name] for name in POSITIONS if name in values), np.zeros(0))
    there = np.flatnonzero(np.isfinite(position))
    if len(there) > 1:
        distance = float(position[there[-1]] - position[there[0]])
        found["speed"] = distance / float(time[there[-1]] - time[there[0]])
        if {"power", "weight"} <= values.keys() and found["speed"] > SLOWEST:
            work = float(values["power"][1:] @ np.diff(time))
            found["transport"] = work / (float(values["weight"][0]) * distance)
    moments = values.get(TOUCHDOWN, time)
    steps = np.zeros(0, int)
    if contacts := feet(walk):
        landed = landings(contacts)
        steps = np.array([min(landing.values()) for landing in landed], int)
        found |= _of_feet(walk, contacts, landed)
    elif TOUCHDOWN in values:
        steps = np.flatnonzero(np.diff(np.nan_to_num(moments, nan=-1.0))) + 1
    if len(steps) > 1:
        found["step_time"] = float(np.diff(moments[steps]).mean())
        if STANCE in values:
            found["step_length"] = float(np.diff(values[STANCE][steps]).mean())
    return found


def _of_feet(
    walk: Trace, contacts: Mapping[str, Bool[np.ndarray, " samples"]], landed: list[dict[str, int]]
) -> dict[str, float]:
    """What is measured of when the feet are on the ground, and where they land."""
    busiest = max(([one[foot] for one in landed if foot in one] for foot in contacts), key=len)
    strides = slice(busiest[0], busiest[-1]) if len(busiest) > 1 else slice(None)
    on_ground = np.stack([*contacts.values()])[:, strides]
    found = {
        "strides": float(max(0, len(busiest) - 1)),
        "duty": float(on_ground.mean()),
        "overlap": float((on_ground.sum(axis=0) > 1).mean()) if len(contacts) > 1 else math.nan,
        "flight": float(1 - on_ground.any(axis=0).mean()),
    }
    landed_at = {foot: times_of(walk, foot, landed) for foot in contacts}
    if legs := four_legs(contacts):
        back, front = legs[:2], legs[2:]
        lags = [phases(landed_at[hind], landed_at[fore]) for hind, fore in zip(back, front, strict=True)]
        return found | {"lag": circular_mean(np.concatenate(lags))}
    if len(contacts) != 2:
        return found
    first, second = landed_at.values()
    order = alone(landed)
    turns = [bool(one and other and one != other) for one, other in pairwise(order)]
    alternation = float(np.mean(turns)) if turns else math.nan
    lengths = _step_lengths(walk, tuple(contacts), landed) if alternation >= 0.5 else np.zeros(0)
    stances = _whole_stances(first, second) if TOUCHDOWN in walk.values else on_ground.mean(axis=1)
    return found | {
        "alternation": alternation,
        "lag": circular_mean(phases(first, second)),
        "asymmetry": _difference(stances),
        "step_asymmetry": _difference(lengths),
    }


def _difference(both: Float[np.ndarray, " feet"]) -> float:
    """The difference of two numbers over their mean [%], without its sign; NaN if there are none."""
    mean = abs(float(both.mean())) if len(both) else 0.0
    return 100 * float(np.ptp(both)) / mean if mean > 0 else math.nan


def _whole_stances(
    first: Float[np.ndarray, " landings"], second: Float[np.ndarray, " others"]
) -> Float[np.ndarray, " feet"]:
    """How long each of two feet stands on average, from its touchdown to the other's [s]."""
    moments = np.concatenate([first, second])
    order = np.argsort(moments, kind="stable")
    foot = np.repeat([0, 1], [len(first), len(second)])[order][:-1]
    lasted = np.diff(moments[order])
    both = [lasted[foot == number] for number in (0, 1)]
    return np.array([stance.mean() for stance in both]) if all(map(len, both)) else np.zeros(0)


def _step_lengths(
    walk: Trace, names: tuple[str, ...], landed: list[dict[str, int]]
) -> Float[np.ndarray, " feet"]:
    """How long the steps onto each of two feet are on average [m]; none if that is not known of both."""
    ahead = [walk.values.get(f"{name}_{FOOT_X}") for name in names]
    if ahead[0] is None or ahead[1] is None or set(names) == ENDS:
        return np.zeros(0)
    apart = ahead[0] - ahead[1]
    lengths = [
        sign * apart[[one[name] for one in landed if one.keys() == {name}]]
        for name, sign in zip(names, (1, -1), strict=True)
    ]
    return np.array([length.mean() for length in lengths]) if all(map(len, lengths)) else np.zeros(0)
