"""Can the edges be travelled: do their phases touch, do the derivatives allow it, is the choice clear?"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour, Edge
from coachable.behaviours.checking.findings import Finding, Proven, Result, Subject, Unknown
from coachable.behaviours.checking.solver import smt
from coachable.behaviours.checking.solver.encoding import State, Witness
from coachable.behaviours.checking.solver.regions import Crossing, Region, region, relaxed
from coachable.behaviours.predicates import All, Comparison, Predicate
from coachable.behaviours.rewriting import conjuncts, expanded, widened


def rates_of(behaviour: Behaviour) -> dict[str, str]:
    """Signal → the signal that is declared to be its derivative."""
    return {
        signal.derivative_of: signal.name
        for signal in reversed(behaviour.signals)
        if signal.derivative_of is not None
    }


@dataclass(frozen=True)
class Regions:
    """Each phase as the region in which it is entered, and the one in which it lasts.

    With a deadband a phase lasts farther than it is entered.
    """

    entered: Mapping[str, Region]
    lasting: Mapping[str, Region]
    region_of: Callable[[Predicate], Region]
    signals: tuple[str, ...]

    @staticmethod
    def of(behaviour: Behaviour) -> Regions:
        """The regions of all phases."""
        rates = rates_of(behaviour)

        @functools.cache
        def refuted(predicate: Predicate) -> bool | None:
            return smt.refuted(behaviour.signal_names, predicate)

        @functools.cache
        def region_of(predicate: Predicate) -> Region:
            return region(predicate, rates, refuted)

        return Regions(
            {phase.name: region_of(expanded(phase.predicate)) for phase in behaviour.phases},
            {phase.name: region_of(widened(phase.predicate)) for phase in behaviour.phases},
            region_of,
            behaviour.signal_names,
        )

    def travel(self, edge: Edge, question: smt.Question, before: State) -> State:
        """The state right after going along an edge: the same one, the reset one, or one nobody knows."""
        if edge.reset:
            return question.after(before, edge.reset)
        return question.state() if edge.event is not None else before

    def touch(self, edge: Edge) -> bool | None:
        """Whether the edge's phases touch, across the reset if there is one; `None` if that is not known."""
        source, target = self.lasting[edge.source], self.entered[edge.target]
        return self._possible(edge, source.closure, target.closure, source.exact and target.exact)

    def travelled(self, edge: Edge, only: Comparison | None = None) -> bool | None:
        """Whether the derivatives allow it to go along the edge; `only` looks at what one comparison asks."""
        source, target = self.lasting[edge.source], self.entered[edge.target]
        leave, enter = source.passage(True, only), target.passage(False, only)
        return self._possible(edge, leave, enter, source.exact and target.exact)

    def _possible(self, edge: Edge, leave: Predicate, enter: Predicate, exact: bool) -> bool | None:
        question = smt.Question(self.signals)
        before = question.state()
        question.require(leave, before)
        question.require(enter, self.travel(edge, question, before))
        match question.refuted():
            case True:
                return False
            case False if exact:
                return True
            case _:
                return None


def edges(behaviour: Behaviour, regions: Regions) -> Iterator[Result]:
    """Edges along which nothing can go."""
    touching = 0
    walked = [edge for edge in behaviour.edges if edge.source != edge.target or edge.reset]
    for edge in walked:
        if not regions.lasting[edge.source].terms or not regions.entered[edge.target].terms:
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
            "Change the reset, the target, or what the source says.",
        )
    phases = {phase.name: phase for phase in behaviour.phases}
    sides = [conjuncts(relaxed(widened(phases[edge.source].predicate)))]
    sides.append(conjuncts(relaxed(phases[edge.target].predicate)))
    culprits = smt.conflict(behaviour.signal_names, list(itertools.chain(*sides)))
    between = "; ".join(f"`{culprit}`" for culprit in culprits)
    why = f" What keeps them apart, boundaries included: {between}." if 0 < len(culprits) <= 4 else ""
    return Finding(
        "no-common-boundary",
        "error",
        subjects,
        f"Nothing goes from {edge.source} to {edge.target} in one instant: the two phases have no common "
        f"boundary.{why}",
        "Add the phase that lies between them; or if the signals jump there, say at what event, with `on`.",
    )


def _forbidden(regions: Regions, edge: Edge) -> Finding:
    source, target = regions.lasting[edge.source], regions.entered[edge.target]
    demands = [(edge.source, crossing, "leave") for crossing in source.demands(True)]
    demands += [(edge.target, crossing, "enter") for crossing in target.demands(False)]
    alone = [demand for demand in demands if regions.travelled(edge, demand[1].comparison) is False]
    wants = "; ".join(_demand(*demand) for demand in (alone[:1] or demands))
    fate = "and the phase does not allow it" if alone else "and all that together is not possible"
    return Finding(
        "impossible-edge",
        "error",
        (Subject("edge", str(edge)),),
        f"No movement goes from {edge.source} to {edge.target}: the derivatives forbid it. {wants}, {fate}.",
        f"Turn the edge around, or change what {edge.source} or {edge.target} says about the derivative.",
    )


def _demand(phase: str, crossing: Crossing, change: str) -> str:
    return f"To {change} {phase} across the boundary of `{crossing.comparison}` takes `{crossing}` in {phase}"


def _both_taken(regions: Regions, phases: Mapping[str, Predicate], one: Edge, other: Edge) -> smt.Question:
    """The question for a state in which both edges of one source can be taken.

    Without a jump, it is where the targets overlap, if that touches the source. With one, it is where both
    jumps land in their targets. An event does the same to the signals on both edges; what, nobody knows where
    neither tells.
    """
    question = smt.Question(regions.signals)
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
    message = f"At one state both {one} and {other} can be taken, and nothing says which."
    advice = (
        f"Make {one.target} and {other.target} exclude one another there, or give the edges different events."
    )
    if one.target == other.target:
        jumps = (", ".join(map(str, edge.reset)) or "no jump" for edge in (one, other))
        message = f"{one} leads to two states at once: {' or '.join(jumps)}."
        advice = "Give the edges different events, or take one of them out."
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
