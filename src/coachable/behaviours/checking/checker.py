"""The checker: what a behaviour says that its author did not mean, each with a state that shows it."""

from __future__ import annotations

from collections.abc import Iterator

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.camping import camping
from coachable.behaviours.checking.cycles import cycles, dwell_times
from coachable.behaviours.checking.findings import Finding, Report, Result
from coachable.behaviours.checking.partition import empty_phases, gaps, overlaps
from coachable.behaviours.checking.transitions import Regions, edges, nondeterminism
from coachable.behaviours.checking.unit_findings import unit_mismatches
from coachable.behaviours.checking.usage import size, unconnected, unused


def check(behaviour: Behaviour) -> Report:
    """Everything that can be found out about a behaviour without a plant.

    What is reported as impossible is proven, over the real numbers, for signals that are continuous except
    along edges with an event or a reset, and derivatives that are what they are declared to be. Every witness
    has been evaluated in floats. A question that the solver leaves open is reported as unknown.

    **Returns:** the findings, gravest first; what was proven; what is not known.
    """
    return Report.of(_results(behaviour))


def _results(behaviour: Behaviour) -> Iterator[Result]:
    yield size(behaviour)
    yield from empty_phases(behaviour)
    yield from overlaps(behaviour)
    yield from gaps(behaviour)
    regions = Regions.of(behaviour)
    travelled = list(edges(behaviour, regions))
    broken = {
        finding.subjects[0].name
        for finding in travelled
        if isinstance(finding, Finding) and finding.severity == "error"
    }
    yield from cycles(behaviour, regions, broken)
    yield from travelled
    yield from nondeterminism(behaviour, regions)
    yield from dwell_times(behaviour, regions)
    yield from camping(behaviour)
    yield from unit_mismatches(behaviour)
    yield from unconnected(behaviour)
    yield from unused(behaviour)
