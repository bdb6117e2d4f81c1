"""Unused names, and phases that are not part of the order."""

from __future__ import annotations

from collections.abc import Iterator

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.findings import Finding, Proven, Result, Subject
from coachable.behaviours.expressions import Constant, Variable
from coachable.behaviours.predicates import Phrase
from coachable.behaviours.tree import Node, walk


def unused(behaviour: Behaviour) -> Iterator[Result]:
    """Phrases, constants and signals that no phase and no reset needs."""
    trees: list[Node] = [phase.predicate for phase in behaviour.phases]
    trees += [jump.expression for edge in behaviour.edges for jump in edge.reset]
    phrases = {phrase.words for tree in trees for phrase in walk(tree, Phrase)}
    constants = {constant.name for tree in trees for constant in walk(tree, Constant)}
    signals = {variable.signal for tree in trees for variable in walk(tree, Variable)}
    for phrase in behaviour.vocabulary:
        if phrase.words not in phrases:
            yield Finding(
                "unused-phrase",
                "note",
                (Subject("phrase", phrase.words),),
                f'No phase uses the phrase "{phrase.words}".',
                "Use it or remove it.",
            )
    for constant in behaviour.constants:
        if constant.name not in constants:
            yield Finding(
                "unused-constant",
                "note",
                (Subject("constant", constant.name),),
                f"No phase depends on the constant {constant.name}.",
                "Use it or remove it.",
            )
    for signal in behaviour.signals:
        if signal.name not in signals:
            yield Finding(
                "unused-signal",
                "note",
                (Subject("signal", signal.name),),
                f"No phase depends on the signal {signal.name}, but every use of the behaviour requires it.",
                "Use it or remove it.",
            )


def unconnected(behaviour: Behaviour) -> Iterator[Result]:
    """Phases that no edge enters, that none leaves, or that have neither."""
    entered = {edge.target for edge in behaviour.edges if edge.source != edge.target}
    left = {edge.source for edge in behaviour.edges if edge.source != edge.target}
    alone = len(behaviour.phases) == 1
    for phase in behaviour.phases if not alone else ():
        name, subjects = phase.name, (Subject("phase", phase.name),)
        if name not in entered | left:
            yield Finding(
                "unconnected-phase",
                "warning",
                subjects,
                f"No edge enters {name} and none leaves it, so it is no part of the order.",
                f"Put {name} into the cycle, or give it an edge.",
            )
        elif name not in entered:
            yield Finding(
                "unentered-phase",
                "note",
                subjects,
                f"No edge enters {name}: a movement can only begin in it.",
                f"Nothing, if the movement begins with {name}; else add an edge to it.",
            )
        elif name not in left:
            yield Finding(
                "dead-end-phase",
                "note",
                subjects,
                f"No edge leaves {name}: a movement that enters it must stay.",
                f"Nothing, if the movement ends with {name}; else add an edge from it.",
            )


def size(behaviour: Behaviour) -> Proven:
    """How many phases there are."""
    number = len(behaviour.phases)
    return Proven(f"{number} phase" + ("s" if number != 1 else ""))
