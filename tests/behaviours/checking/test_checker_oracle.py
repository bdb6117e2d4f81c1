"""The checker against exhaustion: on a grid of thresholds, every cell is tried."""

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import All, Any, Behaviour, Comparison, Edge, Not, Phase, Signal, holds
from coachable.behaviours.checking.cells import cells_of
from coachable.behaviours.checking.checker import check
from coachable.behaviours.checking.findings import CheckReport
from coachable.behaviours.checking.transitions import Regions, edges
from coachable.behaviours.tree import walk

THRESHOLDS = (-1.0, 0.0, 1.0)
AXIS = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)
"""One number from every piece that the thresholds cut a line into: open, point, open, …"""
GRID = tuple(itertools.product(range(len(AXIS)), repeat=2))

COMPARISONS = st.builds(
    Comparison,
    st.sampled_from(["x", "v"]),
    st.sampled_from(["<", "<=", ">", ">="]),
    st.sampled_from(THRESHOLDS),
)
PREDICATES = st.recursive(
    COMPARISONS,
    lambda inner: (
        st.lists(inner, min_size=1, max_size=3).map(lambda parts: All(*parts))
        | st.lists(inner, min_size=1, max_size=3).map(lambda parts: Any(*parts))
        | inner.map(Not)
    ),
    max_leaves=5,
)


def described(predicates, derivative=None):
    names = [f"P{index}" for index in range(len(predicates))]
    return Behaviour(
        "random",
        "",
        (Signal("x"), Signal("v", derivative_of=derivative)),
        tuple(Phase(name, name, predicate) for name, predicate in zip(names, predicates, strict=True)),
        tuple(Edge(*pair) for pair in itertools.permutations(names, 2)),
    )


def inside(predicate):
    return {cell for cell in GRID if holds(predicate, values(cell))}


def values(cell):
    return {"x": AXIS[cell[0]], "v": AXIS[cell[1]]}


def closure_of(cell):
    """A point is closed; an open piece has the points at its ends, too."""
    sides = [
        [piece] if piece % 2 else [end for end in (piece - 1, piece, piece + 1) if 0 <= end < len(AXIS)]
        for piece in cell
    ]
    return set(itertools.product(*sides))


def closure(cells):
    return set().union(*map(closure_of, cells))


def found(report, kind):
    return {frozenset(s.name for s in f.subjects) for f in report.findings if f.kind == kind}


@settings(max_examples=25, deadline=None)
@given(st.lists(PREDICATES, min_size=2, max_size=3))
def test_overlaps_empty_phases_gaps_and_touching_are_those_of_exhaustion(predicates):
    behaviour = described(predicates)
    report = check(behaviour)
    cells = {phase.name: inside(phase.predicate) for phase in behaviour.phases}
    assert found(report, "empty-phase") == {frozenset([name]) for name in cells if not cells[name]}
    assert found(report, "overlap") == {
        frozenset(pair) for pair in itertools.combinations(cells, 2) if cells[pair[0]] & cells[pair[1]]
    }
    phases = {phase.name: phase.predicate for phase in behaviour.phases}
    for finding in report.findings:
        if finding.kind == "overlap":
            assert all(holds(phases[subject.name], finding.witness) for subject in finding.subjects)
        if finding.kind == "gap":
            assert not any(holds(predicate, finding.witness) for predicate in phases.values())
    assert bool(found(report, "gap")) == bool(set(GRID) - set().union(*cells.values()))
    assert found(report, "no-common-boundary") == {
        frozenset([str(edge)])
        for edge in behaviour.edges
        if cells[edge.source]
        and cells[edge.target]
        and not closure(cells[edge.source]) & closure(cells[edge.target])
    }


@settings(max_examples=25, deadline=None)
@given(st.lists(PREDICATES, min_size=1, max_size=3))
def test_cells_are_counted_as_exhaustion_counts_them(predicates):
    behaviour = described(predicates)
    comparisons = [part for predicate in predicates for part in walk(predicate, Comparison)]
    sides = {cell: tuple(holds(comparison, values(cell)) for comparison in comparisons) for cell in GRID}
    outside = {
        sides[cell]
        for cell in GRID
        if not any(holds(phase.predicate, values(cell)) for phase in behaviour.phases)
    }
    cells = cells_of(behaviour)
    assert cells is not None
    assert (cells.number, len(cells.outside)) == (len(set(sides.values())), len(outside))


def crosses(source, target):
    """Whether a point (x, v) with dx/dt = v can go from one set of cells to another.

    It comes to a common point of the boundary out of one cell and goes on into another. Where x changes on
    the way, the speed in that cell must have the sign of the change.
    """
    for before, after in itertools.product(source, target):
        for meeting in closure_of(before) & closure_of(after):
            if all(
                change == 0 or AXIS[cell[1]] * change > 0
                for change, cell in ((meeting[0] - before[0], before), (after[0] - meeting[0], after))
            ):
                return True
    return False


@settings(max_examples=40, deadline=None)
@given(st.lists(PREDICATES, min_size=2, max_size=2))
def test_edges_that_derivatives_forbid_are_those_of_exhaustion(predicates):
    behaviour = described(predicates, derivative="x")
    cells = {phase.name: inside(phase.predicate) for phase in behaviour.phases}
    results = edges(behaviour, Regions.of(behaviour))
    forbidden = found(CheckReport.of(results), "impossible-edge")
    for edge in behaviour.edges:
        source, target = cells[edge.source], cells[edge.target]
        if source and target and closure(source) & closure(target):
            assert (frozenset([str(edge)]) in forbidden) == (not crosses(source, target)), str(edge)
