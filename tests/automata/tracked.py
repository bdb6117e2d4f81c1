"""Random behaviours with deadbands and dwell times, and an oracle that follows a run in plain Python."""

import math
from typing import NamedTuple

from hypothesis import strategies as st

from coachable.behaviours import All, Behaviour, Comparison, Dwell, Edge, Phase, Signal

DT = 0.25
"""Sums of quarters are exact in every float."""

X = st.sampled_from([-0.3, -0.1, -0.05, 0.0, 0.05, 0.1, 0.3, math.nan])
RUNS = st.lists(X, min_size=1, max_size=30)

_COMPARISONS = st.builds(
    Comparison,
    st.just("x"),
    st.sampled_from(["<", "<=", ">", ">="]),
    st.sampled_from([-0.1, 0.0, 0.1]),
    st.sampled_from([None, None, 0.0, 0.07, 0.25]),
)
_DWELLS = st.sampled_from(
    [None, Dwell(0.5), Dwell(at_most=0.5), Dwell(0.5, 0.75), Dwell(), Dwell(at_most=0.0)]
)


@st.composite
def descriptions(draw):
    """Phases and pairs of them. Tests make the `Behaviour`: its type checks draw random numbers."""
    names = [f"P{index}" for index in range(draw(st.integers(1, 3)))]
    phases = [
        Phase(name, "", All(*draw(st.lists(_COMPARISONS, min_size=1, max_size=2))), draw(_DWELLS))
        for name in names
    ]
    pairs = draw(st.lists(st.tuples(st.sampled_from(names), st.sampled_from(names)), unique=True, max_size=5))
    return phases, pairs


def behaviour_of(description):
    phases, pairs = description
    edges = tuple(Edge(*pair) for pair in pairs)
    return Behaviour("random", "", (Signal("x"),), tuple(phases), edges)


class Step(NamedTuple):
    previous: str | None
    phase: str | None
    first: bool
    too_short: bool
    too_long: bool
    stay: int
    """The number of the sample at which the stay began."""


def follow(behaviour, xs, flicker=1):
    """What every sample brings, by the words of the decision on deadband, dwell and flicker [samples]."""
    phases = {phase.name: phase for phase in behaviour.phases}
    steps, previous, began, left, held = [], None, {}, {}, {}
    parts = {part for phase in behaviour.phases for part in parts_of(phase)}
    for index, x in enumerate(xs):
        lasting = {part for part in held if held[part] and _holds(part, x, _deadband(part))}
        held = {
            part: part in lasting
            or (_holds(part, x, 0.0) and not any(_opposed(part, other) for other in lasting))
            for part in parts
        }
        inside = [
            name for name, one in phases.items() if not math.isnan(x) and all(held[p] for p in parts_of(one))
        ]
        phase = inside[0] if inside else None
        if previous in inside and any(map(_deadband, parts_of(phases[previous]))):
            phase = previous
        too_short = too_long = False
        if index and previous != phase and previous is not None:
            left[previous] = index
            least = (phases[previous].dwell or Dwell()).at_least
            too_short = began[previous] > 0 and (index - began[previous]) * DT < least
        new = phase not in left or index - left[phase] > flicker
        if phase is not None and (not index or previous != phase) and new:
            began[phase] = index
        if phase is not None and began[phase] < index:
            too_long = (index - began[phase]) * DT > (phases[phase].dwell or Dwell()).at_most
        stay = index if phase is None else began[phase]
        steps.append(Step(previous, phase, index == 0, too_short, too_long, stay))
        previous = phase
    return steps


def parts_of(phase):
    return phase.predicate.parts if isinstance(phase.predicate, All) else (phase.predicate,)


def _deadband(part):
    return part.deadband.value if part.deadband else 0.0


def _holds(part, x, wide):
    bound = part.right.value
    return {
        "<": x < bound + wide,
        "<=": x <= bound + wide,
        ">": x > bound - wide,
        ">=": x >= bound - wide,
    }[part.relation]


def _opposed(one, other):
    """Whether two comparisons with the same deadband are the two sides of one bound."""
    same = one.right.value == other.right.value and _deadband(one) == _deadband(other) > 0
    return same and one.relation[0] != other.relation[0]
