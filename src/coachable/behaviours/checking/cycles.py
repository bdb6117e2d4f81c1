"""Whether cycles can be completed, and whether phases can keep their dwell times.

A phase that lasts for a time T and in which the rate of a signal is at least m and at most M changes that
signal by at least m T and at most M T. Together with the conditions of the edges, that must be
possible all the way around.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from coachable.behaviours.behaviour import Behaviour, Dwell, Edge, Phase
from coachable.behaviours.checking.findings import Finding, Proven, Result, Subject, Unknown
from coachable.behaviours.checking.regions import Regions, rates_of
from coachable.behaviours.checking.solver import Question, State, affine, decimal, exact, is_affine
from coachable.behaviours.expressions import Arithmetic
from coachable.behaviours.predicates import OPERATORS, Comparison
from coachable.behaviours.rewriting import expanded, widened
from coachable.behaviours.tree import walk
from coachable.foundation.suggestion import in_a_row

Bounds = tuple[tuple[str, Fraction | None, Fraction | None], ...]
"""Signals, each with the least and the greatest rate that it has in a phase."""


def bounds_of(behaviour: Behaviour, phase: Phase) -> Bounds:
    """The bounds of the rates of signals in a phase, where its comparisons bound their derivatives."""
    lasting = expanded(widened(phase.predicate))
    levels: dict[str, set[Fraction]] = {}
    for comparison in walk(lasting, Comparison):
        if is_affine(difference := Arithmetic(comparison.left, "-", comparison.right)):
            multiples, number = affine(difference)
            used = [(signal, multiple) for signal, multiple in multiples.items() if multiple]
            if len(used) == 1:
                signal, multiple = used[0]
                levels.setdefault(signal, {Fraction(0)}).add(-number / multiple)
    found = []
    for signal, rate in rates_of(behaviour).items():
        known = sorted(levels.get(rate, {Fraction(0)}))

        def proven(relation: str, level: Fraction, rate: str = rate) -> bool:
            question = Question(behaviour.signal_names)
            state = question.state()
            question.require(lasting, state)
            beyond = state.symbols[rate]
            question.require_that(beyond < exact(level) if relation == ">=" else beyond > exact(level))
            return question.refuted() is True

        least = next((level for level in reversed(known) if proven(">=", level)), None)
        greatest = next((level for level in known if proven("<=", level)), None)
        if least is not None or greatest is not None:
            found.append((signal, least, greatest))
    return tuple(found)


def _last(question: Question, enter: State, leave: State, dwell: Dwell | None, bounds: Bounds) -> None:
    """Require that a phase, entered at one state and left at another, keeps its dwell times."""
    time = question.unknown_number()
    question.require_that(time >= 0)
    if dwell is not None and dwell.at_least <= dwell.at_most:
        for limit, relation in ((dwell.at_least, ">="), (dwell.at_most, "<=")):
            if math.isfinite(limit):
                question.require_that(OPERATORS[relation](time, exact(decimal(limit))))
    for signal, least, greatest in bounds:
        change = leave.symbols[signal] - enter.symbols[signal]
        if least is not None:
            question.require_that(change >= exact(least) * time)
        if greatest is not None:
            question.require_that(change <= exact(greatest) * time)


def cycles(behaviour: Behaviour, regions: Regions, broken: set[str]) -> Iterator[Result]:
    """Cycles that no trajectory can follow.

    **Arguments:** `broken`: edges already known to be impossible, as text.
    """
    phases = {phase.name: phase for phase in behaviour.phases}
    bounds = {name: bounds_of(behaviour, phase) for name, phase in phases.items()}
    closed = []
    for index, cycle in enumerate(behaviour.cycles):
        walk = " → ".join([cycle[0].source, *(edge.target for edge in cycle)])
        if any(not regions.lasting[edge.source].terms for edge in cycle):
            continue
        blocked = [str(edge) for edge in cycle if str(edge) in broken]
        if blocked:
            yield _impossible(index, walk, f"{blocked[0]} is impossible, which is an error of its own")
            continue
        # Once around, and the first edge again: so every phase is entered, lasts, and is left.
        match _followed(behaviour, regions, (*cycle, cycle[0]), phases, bounds):
            case False:
                yield _impossible(index, walk, _why(behaviour, regions, cycle, phases, bounds))
            case None:
                yield Unknown(f"whether any movement can follow the cycle {walk}")
            case True:
                closed.append(cycle)
    if closed and len(closed) == len(behaviour.cycles):
        events = list(dict.fromkeys(edge.event for cycle in closed for edge in cycle if edge.event))
        through = f" through {' and '.join(events)}" if events else ""
        yield Proven(("cycle" if len(closed) == 1 else f"{len(closed)} cycles") + f" closed{through}")


def _followed(
    behaviour: Behaviour,
    regions: Regions,
    walk: tuple[Edge, ...],
    phases: dict[str, Phase],
    bounds: dict[str, Bounds],
) -> bool | None:
    """Whether nothing excludes taking these edges, one after the other."""
    question = Question(behaviour.signal_names)
    entered: State | None = None
    for edge in walk:
        before = question.state()
        if entered is not None:
            _last(question, entered, before, phases[edge.source].dwell, bounds[edge.source])
        question.require(regions.lasting[edge.source].passage(True), before)
        entered = regions.travel(edge, question, before)
        question.require(regions.lasting[edge.target].passage(False), entered)
    refuted = question.refuted()
    return None if refuted is None else not refuted


def _why(
    behaviour: Behaviour,
    regions: Regions,
    cycle: tuple[Edge, ...],
    phases: dict[str, Phase],
    bounds: dict[str, Bounds],
) -> str:
    for into, out in zip(cycle, (*cycle[1:], *cycle[:1]), strict=True):
        if _followed(behaviour, regions, (into, out), phases, bounds) is False:
            rates = rates_of(behaviour)
            known = ", ".join(
                f"{rates[signal]} is " + " and ".join(_bound_texts(least, greatest))
                for signal, least, greatest in bounds[into.target]
            )
            return (
                f"after {into} the phase {into.target} can never be left along {out}, for the derivatives "
                f"rule out the change of the signals that this takes ({known})"
            )
    return "each edge is possible, but not one after the other all the way around"


def _bound_texts(least: Fraction | None, greatest: Fraction | None) -> Iterator[str]:
    if least is not None:
        yield f"at least {float(least):g}"
    if greatest is not None:
        yield f"at most {float(greatest):g}"


def _impossible(index: int, walk: str, why: str) -> Finding:
    return Finding(
        "impossible-cycle",
        "error",
        (Subject("cycle", str(index)),),
        f"No movement can follow the cycle {walk}: {why}.",
        "Change the order, or the conditions of the phases on the derivatives.",
    )


def dwell_times(behaviour: Behaviour, regions: Regions) -> Iterator[Result]:
    """Dwell times that no movement can keep."""
    for phase in behaviour.phases:
        if phase.dwell is None:
            continue
        complaint = _contradiction(behaviour, phase, phase.dwell)
        if complaint is None and regions.lasting[phase.name].terms:
            complaint = _no_room(behaviour, regions, phase, phase.dwell)
        if complaint is not None:
            yield Finding(
                "contradictory-dwell",
                "error",
                (Subject("phase", phase.name),),
                f"{phase.name} cannot keep its dwell times: {complaint}",
                "Change the times, or remove them.",
            )


def unlimited_phases(behaviour: Behaviour) -> Iterator[Result]:
    """Phases that may last for ever, on a cycle whose other phases may not."""
    on_cycle = {edge.source for cycle in behaviour.cycles for edge in cycle}
    endless = [
        phase.name
        for phase in behaviour.phases
        if phase.name in on_cycle and math.isinf((phase.dwell or Dwell()).at_most)
    ]
    if 0 < len(endless) < len(on_cycle):
        many = len(endless) > 1
        yield Finding(
            "unlimited-phase",
            "note",
            tuple(Subject("phase", name) for name in endless),
            f"{in_a_row(endless)} may last for ever. The reward form `schedule`, which pays for being in the "
            f"expected phase, needs a limit for {'each of them' if many else 'it'}.",
            "Say how long it may last, as in `for at most 0.3 s`; `coachable limits` proposes times from a "
            "recorded motion, and writes them into the text.",
        )


def _contradiction(behaviour: Behaviour, phase: Phase, dwell: Dwell) -> str | None:
    if dwell.at_least > dwell.at_most:
        return f"it must last at least {dwell.at_least:g} s and at most {dwell.at_most:g} s."
    if math.isinf(dwell.at_least):
        return "it must last for ever."
    if dwell.at_most == 0:
        return "it must last at most 0 s, so that every stay in it is a violation."
    if math.isfinite(dwell.at_most) and not any(
        edge.source == phase.name and edge.target != phase.name for edge in behaviour.edges
    ):
        return f"it must be left within {dwell.at_most:g} s, but no edge leaves it."
    return None


def _no_room(behaviour: Behaviour, regions: Regions, phase: Phase, dwell: Dwell) -> str | None:
    bounds = bounds_of(behaviour, phase)
    rates = rates_of(behaviour)
    units = {signal.name: signal.unit for signal in behaviour.signals}
    for bound in bounds:
        question = Question(behaviour.signal_names)
        enter, leave = question.state(), question.state()
        question.require(regions.lasting[phase.name].closure, enter)
        question.require(regions.lasting[phase.name].closure, leave)
        _last(question, enter, leave, Dwell(dwell.at_least), (bound,))
        if question.refuted():
            signal, least, greatest = bound
            unit = f" {units[rates[signal]]}" if units[rates[signal]] else ""
            rate = " and ".join(f"{text}{unit}" for text in _bound_texts(least, greatest))
            room = f"in {dwell.at_least:g} s {signal} would leave it"
            return f"{room}, for there {rates[signal]} is {rate}."
    return None
