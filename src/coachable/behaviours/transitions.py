"""Can the edges be travelled: do their phases touch, do the derivatives allow it, is the choice clear?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from coachable.behaviours import smt
from coachable.behaviours.behaviour import Behaviour, Edge
from coachable.behaviours.encoding import State
from coachable.behaviours.findings import Finding, Proven, Result, Subject, Unknown
from coachable.behaviours.predicates import Comparison, Predicate, conjuncts, widened
from coachable.behaviours.regions import Crossing, Region, region, relaxed


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
    signals: tuple[str, ...]

    @staticmethod
    def of(behaviour: Behaviour) -> Regions:
        """The regions of all phases."""
        rates = rates_of(behaviour)

        def refuted(predicate: Predicate) -> bool | None:
            return smt.refuted(behaviour.signal_names, predicate)

        return Regions(
            {phase.name: region(phase.predicate, rates, refuted) for phase in behaviour.phases},
            {phase.name: region(widened(phase.predicate), rates, refuted) for phase in behaviour.phases},
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
    demands = [(edge.source, crossing, "stop") for crossing in source.demands(True)]
    demands += [(edge.target, crossing, "begin") for crossing in target.demands(False)]
    alone = [demand for demand in demands if regions.travelled(edge, demand[1].comparison) is False]
    wants = " and ".join(_demand(*demand) for demand in (alone[:1] or demands))
    return Finding(
        "impossible-edge",
        "error",
        (Subject("edge", str(edge)),),
        f"No movement goes from {edge.source} to {edge.target}: the derivatives forbid it. {wants}.",
        f"Turn the edge around, or change what {edge.source} or {edge.target} says about the derivative.",
    )


def _demand(phase: str, crossing: Crossing, change: str) -> str:
    how = "leaves it by" if change == "stop" else "enters it by"
    return (
        f"Whoever {how} the boundary of `{crossing.comparison}` has `{crossing}` in {phase} at that moment, "
        "and nowhere there is that so"
    )


def _after_either(regions: Regions, question: smt.Question, one: Edge, other: Edge) -> tuple[State, State]:
    """The states after the one and after the other edge, taken at one state of their source.

    What an event does to the signals is the same on both; where neither edge tells, nobody knows it.
    """
    event = one.event is not None
    resets = (one.reset or other.reset, other.reset or one.reset) if event else (one.reset, other.reset)
    before = question.state()
    if event and not any(resets):
        return before, before
    question.require(regions.lasting[one.source].closure, before)
    return question.after(before, resets[0]), question.after(before, resets[1])


def nondeterminism(behaviour: Behaviour, regions: Regions) -> Iterator[Result]:
    """Pairs of edges of one source and one event that can both be taken at one state."""
    phases = {phase.name: phase.predicate for phase in behaviour.phases}
    clear = True
    for one, other in itertools.combinations(behaviour.edges, 2):
        if (one.source, one.event) != (other.source, other.event) or one.source in (one.target, other.target):
            continue
        if one.target == other.target and one.reset == other.reset:
            continue
        question = smt.Question(behaviour.signal_names)
        after = _after_either(regions, question, one, other)
        for edge, state in zip((one, other), after, strict=True):
            question.require(phases[edge.target], state)
        if one.target == other.target:
            question.differ(*after)
        match question.witness():
            case False:
                continue
            case None:
                yield Unknown(f"whether {one} and {other} are ever possible at once")
            case state:
                yield Finding(
                    "two-edges-at-once",
                    "error",
                    (Subject("edge", str(other)), Subject("edge", str(one))),
                    f"At one state both {one} and {other} can be taken, and nothing says which.",
                    f"Make {one.target} and {other.target} exclude one another there, or give the edges "
                    "different events.",
                    state,
                )
        clear = False
    if clear and any(one.source == other.source for one, other in itertools.combinations(behaviour.edges, 2)):
        yield Proven("never two edges at once")
