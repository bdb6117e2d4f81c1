"""The checker: all analyses of a behaviour, in the order of its report."""

from __future__ import annotations

from collections.abc import Iterator

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.camping import camping
from coachable.behaviours.checking.cycles import cycles, dwell_times, unlimited_phases
from coachable.behaviours.checking.findings import CheckReport, Finding, Result
from coachable.behaviours.checking.partition import empty_phases, gaps, overlaps
from coachable.behaviours.checking.regions import Regions
from coachable.behaviours.checking.sides import lateral_signals
from coachable.behaviours.checking.transitions import edges, nondeterminism
from coachable.behaviours.checking.unit_findings import unit_mismatches
from coachable.behaviours.checking.usage import size, unconnected, unused


def check(behaviour: Behaviour) -> CheckReport:
    """All findings about a behaviour that need no plant.

    A finding of impossibility is a proof over the real numbers, for signals that are continuous except
    along edges with an event or a reset, and for the declared derivatives. Every witness has been evaluated
    in floats. A question that the solver leaves open is reported as unknown.

    **Returns:** the findings, gravest first; the proven clauses; the open questions.
    """
    return CheckReport.of(_results(behaviour))


def _results(behaviour: Behaviour) -> Iterator[Result]:
    yield size(behaviour)
    yield from empty_phases(behaviour)
    yield from overlaps(behaviour)
    yield from gaps(behaviour)
    regions = Regions.of(behaviour)
    of_edges = list(edges(behaviour, regions))
    broken = {
        finding.subjects[0].name
        for finding in of_edges
        if isinstance(finding, Finding) and finding.severity == "error"
    }
    yield from cycles(behaviour, regions, broken)
    yield from of_edges
    yield from nondeterminism(behaviour, regions)
    yield from dwell_times(behaviour, regions)
    yield from unlimited_phases(behaviour)
    yield from camping(behaviour)
    yield from unit_mismatches(behaviour)
    yield from lateral_signals(behaviour)
    yield from unconnected(behaviour)
    yield from unused(behaviour)
