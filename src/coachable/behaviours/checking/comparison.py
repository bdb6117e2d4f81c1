"""States that two behaviours put into different phases."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.solver import Question, refuted
from coachable.behaviours.expressions import Expression
from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate, signals_of
from coachable.behaviours.rewriting import expanded, normal_form, widened

State = Mapping[str, float]


@dataclass(frozen=True)
class Answer:
    """The answer to a search: `state` if one was found, else whether it is `decided` that there is none."""

    state: State | None
    decided: bool


@dataclass(frozen=True)
class Disagreement:
    """A state in one location of the first behaviour and in another of the second.

    Locations are counted in the order of the phases, from 0; `None` is outside. Without a `state` it is not
    known whether there is one.
    """

    first: int | None
    second: int | None
    state: State | None


def disagreements(first: Behaviour, second: Behaviour) -> tuple[Disagreement, ...]:
    """Every pair of different locations that the two behaviours give to one state, with such a state.

    Phases are compared by their place in the order, as a reward sees them.
    """
    names = tuple(dict.fromkeys((*first.signal_names, *second.signal_names)))
    outside = max(len(first.phases), len(second.phases))
    ours, theirs = _locations(first, outside), _locations(second, outside)

    found = []
    for i, here in enumerate(ours):
        differs = find_state(names, All(here, Not(theirs[i])))
        if differs.state is None and differs.decided:
            continue
        for j, there in enumerate(theirs):
            if i == j:
                continue
            answer = find_state(names, All(here, there))
            if answer.state is not None or not answer.decided:
                first_place, second_place = (None if place == outside else place for place in (i, j))
                found.append(Disagreement(first_place, second_place, answer.state))
    return tuple(found)


def staying_differs(one: Predicate, other: Predicate) -> Answer:
    """A state where the deadbands of one predicate keep the phase and those of the other do not."""
    names = tuple(dict.fromkeys((*signals_of(one), *signals_of(other))))
    decided = True
    for inside, outside in ((widened(one), widened(other)), (widened(other), widened(one))):
        answer = find_state(names, All(inside, Not(outside)))
        if answer.state is not None:
            return answer
        decided &= answer.decided
    return Answer(None, decided)


def same_meaning(one: Predicate, other: Predicate) -> bool:
    """Whether two predicates are known to hold in the same states, deadbands included."""
    if normal_form(one) == normal_form(other):
        return True
    names = tuple(dict.fromkeys((*signals_of(one), *signals_of(other))))
    return all(
        refuted(names, inside, Not(outside)) is True
        for meaning in (expanded, widened)
        for inside, outside in itertools.permutations((meaning(one), meaning(other)))
    )


def always_equal(one: Expression, other: Expression) -> bool:
    """Whether two expressions are known to have the same value in every state."""
    unequal = Any(Comparison(one, "<", other), Comparison(one, ">", other))
    return refuted(signals_of(unequal), unequal) is True


def find_state(names: tuple[str, ...], claim: Predicate) -> Answer:
    """A state in which a predicate over the named signals holds."""
    question = Question(names)
    question.require(claim, question.state())
    witness = question.witness()
    return Answer(witness or None, decided=witness is not None)


def _locations(behaviour: Behaviour, outside: int) -> list[Predicate]:
    """For each phase: it is the first that holds; at the index `outside`: none holds."""
    predicates = [phase.predicate for phase in behaviour.phases]
    firsts = [All(predicate, *map(Not, predicates[:index])) for index, predicate in enumerate(predicates)]
    return [*firsts, *[Any()] * (outside - len(firsts)), Not(Any(*predicates))]
