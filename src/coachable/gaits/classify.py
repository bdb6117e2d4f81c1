"""Which gait it is, in a word, by which feet land when."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from coachable.automata.trace import Trace
from coachable.gaits.footfalls import (
    ENDS,
    TOGETHER,
    alone,
    circular_mean,
    feet,
    four_legs,
    landings,
    phases,
    times_of,
)
from coachable.gaits.measures import SLOWEST, measures

HALF = 0.35
"""Feet that touch down at least this share of a stride apart take turns, half a stride apart."""

LEAST_FLIGHT = 0.1
"""Who is off the ground for at most this share of the time, and goes nowhere, stands."""

LEAST_LOADED = 0.1
"""A foot that touches down in fewer than this share of the touchdowns does not walk."""

MOST = 0.5
"""What a gait does at this share of its steps, it does."""

SKIPPING = 0.8
"""Of two successive steps one changes the foot and one does not, in this share of a skip's steps."""

PAIRED = 0.125
"""Of four feet, those that land within this share of a stride, half of a quarter, land as a pair."""


def gait(walk: Trace) -> str:
    """The gait in a word, that of a robot with one, two or four feet.

    - Slower than `SLOWEST` it *stands*, unless it is off the ground for more than `LEAST_FLIGHT`, as who hops
      on the spot; without strides it *shuffles*.
    - On one foot it *hops* if it leaves the ground; on two, of which one hardly lands, it *hops on left*.
    - Two feet that take turns half a stride apart make a *walk* if the duty factor is ½ or more, and a *run*
      if it is less (Alexander, Physiological Reviews 69, 1989); closer than that, with one that leads, a
      *gallop*. If each lands twice before the other does, it *skips*; that is also what a gallop is whose
      leading foot changes every stride (Minetti, Proc. R. Soc. B 265, 1998). Feet that seldom take turns,
      such as those that land together, *hop* if they leave the ground, and *shuffle* if they do not.
    - A back and a front foot *bound* in turn, and *pronk* together.
    - Four feet whose pairs, the hind and the fore ones, take turns: the fore foot lands with the hind one of
      its side in a *pace*, with the other one in a *trot*, in between in a *walk*, or, with a duty factor of
      under ½, an *amble* (Hildebrand, Science 150, 1965). Pairs that land together *bound*, and *pronk* if
      all four do; pairs of which one leads *gallop* (Hildebrand, BioScience 39, 1989).

    Whose feet are not known, or more, or otherwise named or moved, *moves*.
    """
    found = measures(walk)
    if not abs(found["speed"]) > SLOWEST and not found["flight"] > LEAST_FLIGHT:
        return "stands"
    contacts = feet(walk)
    names = tuple(contacts)
    if len(names) not in (1, 2, 4):
        return "moves"
    if not found["strides"]:
        return "shuffles"
    landed = landings(contacts)
    landed_at = {name: times_of(walk, name, landed) for name in names}
    if len(names) == 4:
        return _of_four(landed_at, found)
    total = sum(map(len, landed_at.values()))
    for name in names:
        if len(landed_at[name]) > (1 - LEAST_LOADED) * total:
            on = f" on {name}" if len(names) == 2 else ""
            # Where it never leaves the ground, it drags the other foot along.
            return f"hops{on}" if found["flight"] > 0 else "shuffles"
    return _of_two(landed_at, alone(landed), found)


def _of_two(landed_at: dict[str, Float[np.ndarray, "..."]], order: list[str], found: dict[str, float]) -> str:
    end_to_end = landed_at.keys() == ENDS
    if not end_to_end and _skips(order):
        return "skips"
    if found["alternation"] < MOST:
        if not found["flight"] > 0:
            return "shuffles"
        return "pronks" if end_to_end and order.count("") >= MOST * len(order) else "hops"
    apart = _apart(*landed_at.values())
    if not apart >= 0:
        return "shuffles"
    if end_to_end:
        return "bounds"
    if apart < HALF:
        return "gallops"
    return "walks" if found["duty"] >= 0.5 else "runs"


def _of_four(landed_at: dict[str, Float[np.ndarray, "..."]], found: dict[str, float]) -> str:
    legs = four_legs(landed_at)
    if not legs:
        return "moves"
    back_left, back_right, front_left, front_right = (landed_at[leg] for leg in legs)
    back, front = _apart(back_left, back_right), _apart(front_left, front_right)
    sides = np.concatenate([phases(back_left, front_left), phases(back_right, front_right)])
    if not (back >= 0 and front >= 0 and len(sides)):
        return "shuffles"
    lag = abs((circular_mean(sides) + 0.5) % 1 - 0.5)
    if back >= HALF and front >= HALF:
        if lag < PAIRED:
            return "paces"
        if lag > 0.5 - PAIRED:
            return "trots"
        return "walks" if found["duty"] >= 0.5 else "ambles"
    if back < TOGETHER and front < TOGETHER:
        return "pronks" if lag < TOGETHER else "bounds"
    return "gallops" if back < HALF and front < HALF else "moves"


def _apart(first: Float[np.ndarray, " landings"], second: Float[np.ndarray, " others"]) -> float:
    """How far apart two feet land, in strides of either, on average: 0 together, ½ in turn, or NaN.

    Whichever leads: of feet that lead in turn, a circular mean would be as of feet half a stride apart.
    """
    phase = np.concatenate([phases(first, second), phases(second, first)])
    return float(np.abs((phase + 0.5) % 1 - 0.5).mean()) if len(phase) else float("nan")


def _skips(order: list[str]) -> bool:
    """Whether each of two feet lands twice in turn, by the feet that land alone."""
    # 1 where the foot changes, −1 where it does not, 0 where that cannot be said.
    changes = np.array([bool(one and other) * (1 - 2 * (one == other)) for one, other in pairwise(order)])
    return len(changes) > 1 and float((changes[1:] * changes[:-1] == -1).mean()) >= SKIPPING
