"""Whether phases are empty, whether they overlap, and which states are in none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from coachable.behaviours.behaviour import Behaviour, Phase
from coachable.behaviours.checking.boxes import is_in_the_middle, pairs_not_apart
from coachable.behaviours.checking.cells import Cells, cells_of
from coachable.behaviours.checking.findings import Finding, Proven, Result, Subject, Unknown
from coachable.behaviours.checking.solver import conflict, essence, refuted, witness
from coachable.behaviours.predicates import Any, Not, Predicate
from coachable.behaviours.rewriting import conjuncts
from coachable.foundation.suggestion import in_a_row

_LISTED, _SHORT = 3, 5
"""The number of cells in a list, and the most comparisons of a cell in a list of more than one."""


def empty_phases(behaviour: Behaviour) -> Iterator[Result]:
    """Phases that hold nowhere."""
    for phase in behaviour.phases:
        if is_in_the_middle(phase.predicate):
            continue  # most of many phases: the solver takes a thousand times as long
        match witness(behaviour.signal_names, phase.predicate):
            case False:
                culprits = conflict(behaviour.signal_names, conjuncts(phase.predicate))
                yield Finding(
                    "empty-phase",
                    "error",
                    (Subject("phase", phase.name),),
                    f"No state is in {phase.name}: {_excluding(culprits)}.",
                    f"Change one of these, or remove {phase.name}.",
                )
            case None:
                yield Unknown(f"whether any state is in {phase.name}")


def _excluding(culprits: Sequence[Predicate]) -> str:
    if len(culprits) == 1:
        return f"`{culprits[0]}` holds nowhere"
    return in_a_row([f"`{culprit}`" for culprit in culprits]) + " never hold together"


def overlaps(behaviour: Behaviour) -> Iterator[Result]:
    """Pairs of phases that hold at one state."""
    disjoint = True
    for first, second in pairs_not_apart(behaviour.phases):
        match witness(behaviour.signal_names, first.predicate, second.predicate):
            case False:
                continue
            case None:
                yield Unknown(f"whether {first.name} and {second.name} overlap")
            case state:
                yield _overlap(behaviour, first, second, state)
        disjoint = False
    if disjoint and len(behaviour.phases) > 1:
        yield Proven("pairwise disjoint")


def _overlap(behaviour: Behaviour, first: Phase, second: Phase, state: Mapping[str, float]) -> Finding:
    hidden = refuted(behaviour.signal_names, second.predicate, Not(first.predicate))
    consequence = (
        f"Every state of {second.name} is also in {first.name}, so no state counts as {second.name}."
        if hidden
        else f"Such a state counts as {first.name} only because {first.name} is written first."
    )
    return Finding(
        "overlap",
        "error",
        (Subject("phase", second.name), Subject("phase", first.name)),
        f"A state can be in {first.name} and in {second.name} at once. {consequence}",
        f"Add to one of them a condition that excludes the other, as `not` and a phrase of {first.name} do.",
        state,
    )


def gaps(behaviour: Behaviour) -> Iterator[Result]:
    """States in no phase."""
    outside = Not(Any(*(phase.predicate for phase in behaviour.phases)))
    cells = cells_of(behaviour)
    match witness(behaviour.signal_names, outside):
        case False:
            yield Proven("no state outside")
            if behaviour.outside is not None:
                yield Finding(
                    "unused-outside",
                    "note",
                    (),
                    f'"{behaviour.outside}" names the states outside all phases, but there are none.',
                    "Remove the line.",
                )
        case None:
            yield Unknown("whether any state is outside all phases")
        case state if behaviour.outside is None:
            yield Finding("gap", "warning", (), _gap(behaviour, cells), _NAME_IT, state)
        case _:
            meant = f', which is "{behaviour.outside}"'
            yield Proven((_share(cells) if cells else "some states outside") + meant)
    if cells and behaviour.outside is None and cells.outside:
        yield Proven(_share(cells))


_NAME_IT = (
    'If this is intended, name it, as in: outside "stumbling". If not, a phase is missing or too narrow.'
)


def _share(cells: Cells) -> str:
    return f"{len(cells.outside)} of {cells.number} {cells.word} outside"


def _gap(behaviour: Behaviour, cells: Cells | None) -> str:
    if cells is None:
        return "Some states are in no phase."
    number = _LISTED if all(len(cell) <= _SHORT for cell in cells.outside) else 1
    essences = [essence(behaviour.signal_names, cell) for cell in cells.outside[:number]]
    listed = "; ".join(" and ".join(map(str, essence)) for essence in essences)
    more = len(cells.outside) - number
    rest = f"; and {more} more" if more > 0 else ""
    are = "is" if len(cells.outside) == 1 else "are"
    return (
        f"Some states are in no phase. The comparisons cut all states into {cells.number} {cells.word}, and "
        f"{len(cells.outside)} of them {are} outside: {listed}{rest}."
    )
