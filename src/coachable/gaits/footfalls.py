"""When which foot is on the ground, what one landing is, and when they repeat."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Shaped

from coachable.automata.trace import Trace

CONTACT = "foot_contact"
"""How the signals of feet on the ground end; what stands before it is the foot's name."""

SHORTEST = 0.03
"""Contacts and gaps that last less are noise of the contact, not steps [s]."""

TOUCHDOWN = "touchdown_time"
"""The signal of when the last touchdown before a sample was, where that is known more exactly [s]."""

TOGETHER = 0.15
"""Feet that touch down within this share of the time after which the footfalls repeat land together."""

ENDS = {"back", "front"}
"""The names of two feet of which one is behind the other, each at a hip of its own."""

ALIKE = 0.7
"""Footfalls repeat after a time if they correlate with themselves this share as well as they ever do."""


def feet(walk: Trace) -> dict[str, Bool[np.ndarray, " samples"]]:
    """When each foot is on the ground, by the feet's names, without contacts and gaps of under `SHORTEST`."""
    least = round(SHORTEST / walk.dt)
    names = [name for name in walk.values if name.endswith(CONTACT)]
    return {
        name.removesuffix(CONTACT).rstrip("_") or "foot": _steadied(walk.values[name] > 0.5, least)
        for name in names
    }


def touchdowns(contact: Bool[np.ndarray, " samples"]) -> np.ndarray:
    """The samples at which a foot comes to the ground."""
    return np.flatnonzero(contact[1:] & ~contact[:-1]) + 1


def repeat_samples(contacts: Mapping[str, Bool[np.ndarray, " samples"]]) -> float:
    """The shortest time after which the footfalls repeat [samples]; NaN if they never do.

    Foot by foot, or at least in how many feet are down: feet that walk, run or skip repeat so after half a
    stride already, and those that gallop after one, whichever leads.
    """
    on_ground = np.stack([*contacts.values()])
    both = [_repeat(on_ground), _repeat(on_ground.sum(axis=0, keepdims=True))]
    return min((samples for samples in both if samples > 0), default=math.nan)


def landings(contacts: Mapping[str, Bool[np.ndarray, " samples"]]) -> list[dict[str, int]]:
    """Each landing in turn: the feet that land together, and at which sample each first touches down.

    A touchdown belongs to the landing of the one before, of whichever feet they are, if it is within
    `TOGETHER` of the time after which the footfalls repeat: feet that bounce in turn within one step land
    once. Of many feet, half the time from one to the next is less, and then counts. Where the footfalls do
    not repeat, every touchdown is a landing.
    """
    steps = sorted((int(sample), foot) for foot, on in contacts.items() for sample in touchdowns(on))
    apart = min(TOGETHER, 0.5 / len(contacts)) * repeat_samples(contacts) if steps else math.nan
    found: list[dict[str, int]] = []
    last = -math.inf
    for sample, foot in steps:
        if sample - last <= apart:
            found[-1].setdefault(foot, sample)
        else:
            found.append({foot: sample})
        last = sample
    return found


def alone(landed: list[dict[str, int]]) -> list[str]:
    """Of each landing the foot, if it lands alone, and nothing if several land."""
    return [next(iter(landing)) if len(landing) == 1 else "" for landing in landed]


def times_of(walk: Trace, foot: str, landed: list[dict[str, int]]) -> Float[np.ndarray, " landings"]:
    """When a foot lands [s]."""
    samples = [landing[foot] for landing in landed if foot in landing]
    return np.asarray(walk.values.get(TOUCHDOWN, walk.time)[samples], float)


def phases(
    first: Float[np.ndarray, " landings"], second: Float[np.ndarray, " others"]
) -> Float[np.ndarray, " inside"]:
    """When in the strides of the first foot the second one lands, 0 … 1; nothing outside its strides.

    Of touchdowns, as Hildebrand (1965) has them, and not of the middles of stances: a touchdown is sharp, and
    of some robots known exactly, while feet drag when they leave the ground.
    """
    stride = np.searchsorted(first, second, side="right") - 1
    inside = (stride >= 0) & (stride < len(first) - 1)
    begins = first[stride[inside]]
    return (second[inside] - begins) / (first[stride[inside] + 1] - begins)


def circular_mean(phase: Float[np.ndarray, " phases"]) -> float:
    """The mean of phases on a circle of circumference 1; NaN of none."""
    return float(np.angle(np.exp(2j * np.pi * phase).mean()) / (2 * np.pi) % 1) if len(phase) else math.nan


def four_legs(names: Collection[str]) -> tuple[str, ...]:
    """The back left, back right, front left and front right foot of a quadruped; of other robots none."""
    named = {frozenset(name.split("_")): name for name in names}
    wanted = [frozenset({end, side}) for end in ("back", "front") for side in ("left", "right")]
    return tuple(named[words] for words in wanted) if len(names) == 4 and set(named) == set(wanted) else ()


def _repeat(on_ground: Shaped[np.ndarray, "rows samples"]) -> float:
    """The first time after which the rows' autocorrelation, summed, is as high as it ever is [samples].

    Or `ALIKE` of that, as no two strides are the same. Bounces, which resemble each other less than the steps
    that they are part of do, make it no shorter.
    """
    changes = np.flatnonzero((on_ground[:, 1:] != on_ground[:, :-1]).any(axis=0)) + 1
    if len(changes) < 2:
        return math.nan
    # Standing before the first step and after the last one would correlate with itself at any lag.
    moving = on_ground[:, changes[0] : changes[-1]].astype(float)
    moving -= moving.mean(axis=1, keepdims=True)
    length = moving.shape[1]
    spectrum = np.fft.rfft(moving, 2 * length)
    # Not divided by how much overlaps, so that of equally good times the shortest is the highest.
    alike = np.fft.irfft(np.abs(spectrum) ** 2, 2 * length).sum(axis=0)[:length]
    opposed = np.flatnonzero(alike < 0)
    later = alike[opposed[0] :] if len(opposed) else np.zeros(1)
    if later.max() < 1e-9 * length:  # what is left of rounding where nothing repeats
        return math.nan
    high = later >= ALIKE * later.max()
    begin = int(np.argmax(high))
    end = begin + int(np.argmin(np.append(high[begin:], False)))
    return float(opposed[0] + begin + np.argmax(later[begin:end]))


def _steadied(contact: Bool[np.ndarray, " samples"], least: int) -> Bool[np.ndarray, " samples"]:
    """Without gaps of fewer than `least` samples, then without such contacts; not at the ends."""
    steady = contact.copy()
    for kind in (False, True):
        edges = np.flatnonzero(np.diff(steady)) + 1
        for start, stop in pairwise(edges):
            if steady[start] == kind and stop - start < least:
                steady[start:stop] = not kind
    return steady
