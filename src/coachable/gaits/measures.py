"""Which gait it is: measures of a recorded walk, by when its feet are on the ground."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from jaxtyping import Bool

from coachable.automata.trace import Trace

CONTACT = "foot_contact"
"""How the signals of feet on the ground end; what stands before it is the foot's name."""

SHORTEST = 0.03
"""Contacts and gaps that last less are noise of the contact, not steps [s]."""

SLOWEST = 0.1
"""Slower than this is standing [m/s]."""

LEAST_LOADED = 0.1
"""A foot that touches down in fewer than this share of the touchdowns does not walk."""


POSITIONS = ("torso_x", "base_x")
"""The signals that may hold where the robot is; a walk has one of them."""

TOUCHDOWN = "touchdown_time"
"""The signal of when the last touchdown before a sample was, where that is known more exactly [s]."""

STANCE = "stance_foot_x"
"""The signal of where the foot that stands is on the ground [m]."""

_MEASURES: tuple[str, ...] = (
    "speed",
    "transport",
    "strides",
    "step_time",
    "step_length",
    "duty",
    "flight",
    "alternation",
    "lag",
    "asymmetry",
)


def feet(walk: Trace) -> dict[str, Bool[np.ndarray, " samples"]]:
    """When each foot is on the ground, by the feet's names, without contacts and gaps of under `SHORTEST`."""
    least = round(SHORTEST / walk.dt)
    names = [name for name in walk.values if name.endswith(CONTACT)]
    return {
        name.removesuffix(CONTACT).rstrip("_") or "foot": _steadied(walk.values[name] > 0.5, least)
        for name in names
    }


def measures(walk: Trace) -> dict[str, float]:
    """What the gait is like; NaN for what such a robot, or such a walk, does not have.

    | measure | is |
    |---|---|
    | `speed` | forward, on average [m/s] |
    | `transport` | cost of transport: the motors' work, braking counted as driving, per weight and distance |
    | `strides` | how many the busiest foot makes: from a touchdown to its next one |
    | `step_time` | from a touchdown to the next one, on average [s] |
    | `step_length` | from where a foot stands to where the next one does, on average [m] |
    | `duty` | share of the time that a foot is on the ground, on average over feet |
    | `flight` | share of the time without a foot on the ground |
    | `alternation` | of all touchdowns but the first, the share by another foot than the last |
    | `lag` | when in a stride of the first foot the second touches down, 0 … 1; ½ if they alternate |
    | `asymmetry` | of the feet's times on the ground, the difference over the mean [%] |

    The last three are those of two feet. `lag` is a circular mean, `asymmetry` the index of Robinson,
    Herzog and Nigg (1987), without its sign; where it is recorded when feet touch down, of whole stances.
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
    contacts = feet(walk)
    if contacts:
        on_ground = np.stack([*contacts.values()])
        found["duty"] = float(on_ground.mean())
        found["flight"] = float(1 - on_ground.any(axis=0).mean())
    landings = [touchdowns(contact) for contact in contacts.values()]
    moments = values.get(TOUCHDOWN, time)
    if landings:
        found["strides"] = max(0, max(map(len, landings)) - 1)
    elif TOUCHDOWN in values:
        landings = [np.flatnonzero(np.diff(np.nan_to_num(moments, nan=-1.0))) + 1]
    steps = np.sort(np.concatenate(landings)) if landings else np.zeros(0, int)
    if len(steps) > 1:
        found["step_time"] = float(np.diff(moments[steps]).mean())
        if STANCE in values:
            found["step_length"] = float(np.diff(values[STANCE][steps]).mean())
    if len(contacts) == 2:
        first, second = (moments[landing] for landing in landings)
        found["alternation"] = _alternation(first, second)
        found["lag"] = _lag(first, second)
        stances = np.array([contact.mean() for contact in contacts.values()])
        if TOUCHDOWN in values:
            stances = _whole_stances(first, second)
        if stances.any():
            found["asymmetry"] = 100 * float(np.ptp(stances) / stances.mean())
    return found


def gait(walk: Trace) -> str:
    """The gait in a word: *stands*, *walks*, *runs*, *hops*, *hops on left*, *gallops*, *shuffles*, *moves*.

    Of two feet that alternate, half a stride apart within 0.15, a duty factor of ½ or more makes a walk and
    one below a run (Alexander, Physiological Reviews 1989); together within 0.15 of a stride they hop; in
    between they gallop. A robot on one foot hops if it flies. Who goes without strides shuffles. Gaits of
    more than two feet have other names; such a robot moves, and so does one whose feet are not known.
    """
    found = measures(walk)
    if not abs(found["speed"]) > SLOWEST:
        return "stands"
    contacts = feet(walk)
    if not contacts or len(contacts) > 2:
        return "moves"
    counts = {name: len(touchdowns(contact)) for name, contact in contacts.items()}
    total = sum(counts.values())
    if len(counts) != 2 or total < 2:
        return "hops" if total > 1 and found["flight"] > 0 else "shuffles"
    for name, count in counts.items():
        if count < LEAST_LOADED * total:
            other = next(one for one in counts if one != name)
            return f"hops on {other}"
    if math.isnan(found["lag"]):
        return "shuffles"
    apart = abs((found["lag"] + 0.5) % 1 - 0.5)
    if apart > 0.35:
        return "walks" if found["duty"] >= 0.5 else "runs"
    return "hops" if apart < 0.15 else "gallops"


def touchdowns(contact: Bool[np.ndarray, " samples"]) -> np.ndarray:
    """The samples at which a foot comes to the ground."""
    return np.flatnonzero(contact[1:] & ~contact[:-1]) + 1


def _steadied(contact: Bool[np.ndarray, " samples"], least: int) -> Bool[np.ndarray, " samples"]:
    """Without gaps of fewer than `least` samples, then without such contacts; not at the ends."""
    steady = contact.copy()
    for kind in (False, True):
        edges = np.flatnonzero(np.diff(steady)) + 1
        for start, stop in pairwise(edges):
            if steady[start] == kind and stop - start < least:
                steady[start:stop] = not kind
    return steady


def _alternation(first: np.ndarray, second: np.ndarray) -> float:
    order = np.argsort(np.concatenate([first, second]), kind="stable")
    by_first = np.concatenate([np.ones(len(first), bool), np.zeros(len(second), bool)])[order]
    return float((by_first[1:] != by_first[:-1]).mean()) if len(by_first) > 1 else math.nan


def _whole_stances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """How long each of two feet stands on average, from its touchdown to the other's [s]."""
    moments = np.concatenate([first, second])
    order = np.argsort(moments, kind="stable")
    foot = np.repeat([0, 1], [len(first), len(second)])[order][:-1]
    lasted = np.diff(moments[order])
    both = [lasted[foot == number] for number in (0, 1)]
    return np.array([stance.mean() for stance in both]) if all(map(len, both)) else np.zeros(0)


def _lag(first: np.ndarray, second: np.ndarray) -> float:
    """Circular mean over strides of the first foot that the second one touches down in."""
    if len(first) < 2:
        return math.nan
    stride = np.searchsorted(first, second, side="right") - 1
    inside = (stride >= 0) & (stride < len(first) - 1)
    if not inside.any():
        return math.nan
    begins = first[stride[inside]]
    phases = (second[inside] - begins) / (first[stride[inside] + 1] - begins)
    return float(np.angle(np.exp(2j * np.pi * phases).mean()) / (2 * np.pi) % 1)
