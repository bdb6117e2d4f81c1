"""Whether edges are possible: their phases touch, the derivatives allow it, and the choice is unique."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

from coachable.behaviours.behaviour import Behaviour, Edge
from coachable.behaviours.checking.findings import Finding, Proven, Result, Subject, Unknown
from coachable.behaviours.checking.regions import RateCondition, Regions, relaxed
from coachable.behaviours.checking.solver import Question, Witness, conflict
from coachable.behaviours.predicates import All, Predicate
from coachable.behaviours.rewriting import conjuncts, expanded, widened


def edges(behaviour: Behaviour, regions: Regions) -> Iterator[Result]:
    """Edges along which nothing can go."""
    touching = 0
    walked = [edge for edge in behaviour.edges if edge.source != edge.target or edge.reset]
    for edge in walked:
        if not regions.lasting[edge.source].terms or not regions.lasting[edge.target].terms:
            continue  # An empty phase is a finding of its own.
        touch = regions.touch(edge)
        if touch is False:
            yield _apart(behaviour, edge)
        elif regions.travelled(edge) is False:
            yield _forbidden(regions, edge)
        elif touch is None:
            yield Unknown(f"whether the phases of {edge} touch")
        elif edge.event is None and not edge.reset:
            touching += 1
    continuous = sum(edge.event is None and not edge.reset for edge in walked)
    if continuous and touching == continuous:
        yield Proven(
            "phases touch along every edge" + ("" if continuous == len(walked) else " without a jump")
        )


def _apart(behaviour: Behaviour, edge: Edge) -> Finding:
    subjects = (Subject("edge", str(edge)),)
    if edge.reset:
        jumps = ", ".join(map(str, edge.reset))
        return Finding(
            "impossible-reset",
            "error",
            subjects,
            f"The jump of {edge} never lands in {edge.target}: from wherever {edge.source} is, {jumps} leads "
            "elsewhere.",
            "Change the reset, the target, or the conditions of the source.",
        )
    phases = {phase.name: phase for phase in behaviour.phases}
    sides = [conjuncts(relaxed(widened(phases[edge.source].predicate)))]
    sides.append(conjuncts(relaxed(phases[edge.target].predicate)))
    culprits = conflict(behaviour.signal_names, list(itertools.chain(*sides)))
    between = "; ".join(f"`{culprit}`" for culprit in culprits)
    why = f" What keeps them apart, boundaries included: {between}." if 0 < len(culprits) <= 4 else ""
    return Finding(
        "no-common-boundary",
        "error",
        subjects,
        f"Nothing goes from {edge.source} to {edge.target} in one instant: the two phases have no common "
        f"boundary.{why}",
        "Add the phase that lies between them; or if the signals jump there, give the edge an event: `on`.",
    )


def _forbidden(regions: Regions, edge: Edge) -> Finding:
    source, target = regions.lasting[edge.source], regions.lasting[edge.target]
    demands = [(edge.source, condition, "Leaving") for condition in source.demands(True)]
    demands += [(edge.target, condition, "Entering") for condition in target.demands(False)]
    alone = [demand for demand in demands if regions.travelled(edge, demand[1].comparison) is False]
    required = "; ".join(_demand(*demand) for demand in (alone[:1] or demands))
    reason = "which the phase excludes" if alone else "and all of this together is impossible"
    return Finding(
        "impossible-edge",
        "error",
        (Subject("edge", str(edge)),),
        f"No movement goes from {edge.source} to {edge.target}: the derivatives rule it out. "
        f"{required}, {reason}.",
        f"Reverse the edge, or change the condition of {edge.source} or {edge.target} on the derivative.",
    )


def _demand(phase: str, condition: RateCondition, change: str) -> str:
    return (
        f"{change} {phase} across the boundary of `{condition.comparison}` requires `{condition}` in {phase}"
    )


def _both_taken(regions: Regions, phases: Mapping[str, Predicate], one: Edge, other: Edge) -> Question:
    """The question for a state in which both edges of one source can be taken.

    Without a jump, it is where the targets overlap, if that touches the source. With one, it is where both
    jumps land in their targets. An event does the same to the signals on both edges; without a reset it is
    unknown.
    """
    question = Question(regions.signals)
    state = question.state()
    targets = (phases[one.target], phases[other.target])
    event = one.event is not None
    resets = (one.reset or other.reset, other.reset or one.reset) if event else (one.reset, other.reset)
    source = regions.lasting[one.source].closure
    if any(resets):
        question.require(source, state)
        landings = [question.after(state, reset) for reset in resets]
        for target, landing in zip(targets, landings, strict=True):
            question.require(target, landing)
        if one.target == other.target:
            question.differ(*landings)
        return question
    question.require(All(*targets), state)
    if not event:
        boundary = question.state()
        question.suppose(All(source, regions.region_of(expanded(All(*targets))).closure), boundary)
    return question


def _choice(one: Edge, other: Edge, state: Witness) -> Finding:
    message = f"At one state both {one} and {other} can be taken, and nothing decides between them."
    advice = (
        f"Make {one.target} and {other.target} exclude one another there, or give the edges different events."
    )
    if one.target == other.target:
        jumps = (", ".join(map(str, edge.reset)) or "no jump" for edge in (one, other))
        message = f"{one} leads to two states at once: {' or '.join(jumps)}."
        advice = "Give the edges different events, or remove one of them."
    subjects = tuple(dict.fromkeys((Subject("edge", str(other)), Subject("edge", str(one)))))
    return Finding("two-edges-at-once", "error", subjects, message, advice, state)


def nondeterminism(behaviour: Behaviour, regions: Regions) -> Iterator[Result]:
    """Pairs of edges of one source and one event that can both be taken at one state."""
    phases = {phase.name: phase.predicate for phase in behaviour.phases}
    clear = True
    for one, other in itertools.combinations(behaviour.edges, 2):
        if (one.source, one.event) != (other.source, other.event) or one.source in (one.target, other.target):
            continue
        if one.target == other.target and one.reset == other.reset:
            continue
        question = _both_taken(regions, phases, one, other)
        match question.witness():
            case False:
                continue
            case None:
                yield Unknown(f"whether {one} and {other} are ever possible at once")
            case state:
                yield _choice(one, other, state)
        clear = False
    if clear and any(one.source == other.source for one, other in itertools.combinations(behaviour.edges, 2)):
        yield Proven("never two edges at once")
