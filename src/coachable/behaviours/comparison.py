"""Where two behaviours see a state in different phases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.expressions import Expression
from coachable.behaviours.predicates import (
    All,
    Any,
    Comparison,
    Not,
    Predicate,
    holds,
    signals_of,
    widened,
)
from coachable.behaviours.smt import Answer, State, Terms, find_state, to_z3


@dataclass(frozen=True)
class Disagreement:
    """A state that the first behaviour has in one location and the second in another.

    Locations are counted in the order of the phases, from 0; `None` is outside. Without a `state` it is not
    known whether there is one.
    """

    first: int | None
    second: int | None
    state: State | None


def disagreements(first: Behaviour, second: Behaviour) -> tuple[Disagreement, ...]:
    """Every pair of different locations that the two behaviours give to one state, with such a state.

    Phases are compared by their place in the order, as a reward sees them. States in which a divisor is zero
    are left out.
    """
    names = tuple(dict.fromkeys((*first.signal_names, *second.signal_names)))
    outside = max(len(first.phases), len(second.phases))
    ours, theirs = _locations(first, outside), _locations(second, outside)

    def seen(state: State) -> tuple[int, int]:
        return _location(first, state, outside), _location(second, state, outside)

    def ask(claim: Predicate, confirm: Callable[[int, int], bool]) -> Answer:
        terms = Terms.of(names)
        return find_state([to_z3(claim, terms)], terms, lambda state: confirm(*seen(state)))

    found = []
    for i, here in enumerate(ours):
        differs = ask(All(here, Not(theirs[i])), lambda one, other, i=i: one == i != other)
        if differs.state is None and differs.decided:
            continue
        for j, there in enumerate(theirs):
            answer = ask(All(here, there), lambda *pair, wanted=(i, j): pair == wanted)
            if i != j and (answer.state is not None or not answer.decided):
                first_place, second_place = (None if place == outside else place for place in (i, j))
                found.append(Disagreement(first_place, second_place, answer.state))
    return tuple(found)


def staying_differs(one: Predicate, other: Predicate) -> Answer:
    """A state where the deadbands of one predicate keep whoever was in it and those of the other do not."""
    decided = True
    for inside, outside in ((widened(one), widened(other)), (widened(other), widened(one))):
        terms = Terms.of(dict.fromkeys((*signals_of(one), *signals_of(other))))
        claim = All(inside, Not(outside))
        answer = find_state([to_z3(claim, terms)], terms, lambda state, claim=claim: holds(claim, state))
        if answer.state is not None:
            return answer
        decided &= answer.decided
    return Answer(None, decided)


def always_equal(one: Expression, other: Expression) -> bool:
    """Whether two expressions are known to have the same value in every state."""
    terms = Terms()
    unequal = Any(Comparison(one, "<", other), Comparison(one, ">", other))
    answer = find_state([to_z3(unequal, terms)], terms, lambda _: True)
    return answer.state is None and answer.decided


def _locations(behaviour: Behaviour, outside: int) -> list[Predicate]:
    """For each phase that it is the first one that holds; at the index `outside`, that none does."""
    predicates = [phase.predicate for phase in behaviour.phases]
    firsts = [All(predicate, *map(Not, predicates[:index])) for index, predicate in enumerate(predicates)]
    return [*firsts, *[Any()] * (outside - len(firsts)), Not(Any(*predicates))]


def _location(behaviour: Behaviour, state: State, outside: int) -> int:
    name = behaviour.phase_at(state)
    return outside if name is None else behaviour.phase_names.index(name)
