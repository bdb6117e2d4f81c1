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
    steps, previous, began, left = [], None, {}, {}
    for index, x in enumerate(xs):
        phase = behaviour.phase_at({"x": x})
        if previous is not None and _stays(phases[previous], x):
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


def _stays(phase, x):
    """Whether every comparison of a phase that has a deadband holds, or fails by no more than that."""
    parts = phase.predicate.parts if isinstance(phase.predicate, All) else (phase.predicate,)
    if math.isnan(x) or not any(part.deadband and part.deadband.value for part in parts):
        return False
    for part in parts:
        wide = part.deadband.value if part.deadband else 0.0
        bound = part.right.value
        met = {
            "<": x < bound + wide,
            "<=": x <= bound + wide,
            ">": x > bound - wide,
            ">=": x >= bound - wide,
        }
        if not met[part.relation]:
            return False
    return True
