"""The declarations of a text so far, and those that its mirror adds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from coachable.behaviours.behaviour import Edge, Phase
from coachable.behaviours.expressions import Constant
from coachable.behaviours.predicates import Phrase, Signal, constants_of, phrases_of, signals_of
from coachable.behaviours.text.diagnostics import Diagnostics
from coachable.behaviours.text.mirror import Mirror
from coachable.behaviours.text.semantics import Scope
from coachable.behaviours.text.syntax import Statement

Chain = tuple[Edge, ...]
"""The edges along a line of `cycle`; they need not end where they begin."""


@dataclass
class Draft:
    """The declarations of a text, each with its statement; an image has the statement of its original."""

    signals: dict[str, tuple[Signal, Statement]] = field(default_factory=dict)
    constants: dict[str, tuple[Constant, Statement]] = field(default_factory=dict)
    phrases: dict[str, tuple[Phrase, Statement]] = field(default_factory=dict)
    phases: dict[str, tuple[Phase, Statement]] = field(default_factory=dict)
    edges: dict[Edge, Statement] = field(default_factory=dict)
    chains: list[tuple[Chain, Statement]] = field(default_factory=list)
    """The lines of `cycle` and `edges`, before edges and cycles are made of them."""
    cycles: list[tuple[Chain, Statement]] = field(default_factory=list)

    @property
    def constant_of(self) -> dict[str, Constant]:
        """The constants by name."""
        return {name: constant for name, (constant, _) in self.constants.items()}


def drop_unused(draft: Draft, own: Sequence[Statement], mirror: Mirror | None) -> None:
    """Drop signals, constants and phrases that only included files declare and that nothing uses.

    A user of the behaviour then need not provide signals that occur in unused vocabulary only.

    **Arguments:** `own`, the statements of the text itself; `mirror`, in which what is used has its image.
    """
    stays = {id(statement) for statement in own}
    predicates = [phase.predicate for phase, _ in draft.phases.values()]
    predicates += [phrase.predicate for phrase, statement in draft.phrases.values() if id(statement) in stays]
    signals = {name for predicate in predicates for name in signals_of(predicate)}
    for signal, statement in draft.signals.values():
        if signal.derivative_of and (signal.name in signals or id(statement) in stays):
            signals.add(signal.derivative_of)
    signals |= {mirror.text(name) for name in signals} if mirror else set()
    constants = {constant.name for predicate in predicates for constant in constants_of(predicate)}
    phrases = {phrase.words for predicate in predicates for phrase in phrases_of(predicate)}
    _keep(draft.signals, signals, stays)
    _keep(draft.constants, constants, stays)
    _keep(draft.phrases, phrases, stays)


def _keep(declared: dict[str, tuple[Any, Statement]], used: set[str], stays: set[int]) -> None:
    for name, (_, statement) in list(declared.items()):
        if name not in used and id(statement) not in stays:
            del declared[name]


def add_images(draft: Draft, mirror: Mirror, scope: Scope, diagnostics: Diagnostics) -> None:
    """Add the mirror images of constants, phrases and phases, except where the text has its own.

    What keeps its name in the mirror must be its own image, in meaning and not in form.
    """
    # The solver is imported where there is a mirror, and asked where forms differ.
    from coachable.behaviours.checking.comparison import same_meaning

    for name, (constant, statement) in list(draft.constants.items()):
        draft.constants.setdefault(mirror.text(name), (mirror.constant(constant), statement))
    for words, (phrase, statement) in list(draft.phrases.items()):
        image = mirror.text(words)
        if image != words:
            if (mirrored := scope.phrase(image)) is not None:
                draft.phrases.setdefault(image, (mirrored, statement))
        elif not same_meaning(scope.mirrored(phrase.predicate), phrase.predicate):
            _refuse_lopsided(f"phrase {words!r}", mirror, statement, diagnostics)
    for name, (phase, statement) in list(draft.phases.items()):
        image, predicate = mirror.text(name), scope.mirrored(phase.predicate)
        if image != name:
            mirrored = Phase(image, mirror.text(phase.title), predicate, phase.dwell)
            draft.phases.setdefault(image, (mirrored, statement))
        elif not same_meaning(predicate, phase.predicate):
            _refuse_lopsided(f"phase {name}", mirror, statement, diagnostics)


def close_chains(draft: Draft, mirror: Mirror | None, diagnostics: Diagnostics) -> None:
    """Make edges and cycles of the chains; a cycle that ends in its mirrored beginning continues mirrored."""
    images: list[tuple[Chain, Statement]] = []
    for chain, statement in draft.chains:
        image = tuple(mirror.edge(edge, draft.constant_of) for edge in chain) if mirror else ()
        if statement.section == "cycle":
            first, last = chain[0].source, chain[-1].target
            if mirror is not None and last != first and last == mirror.text(first):
                chain, image = (*chain, *image), ()
            elif last != first:
                ends = (
                    first
                    if mirror is None or mirror.text(first) == first
                    else f"{first} or {mirror.text(first)}"
                )
                message = f"the cycle begins in {first} and ends in {last}"
                diagnostics.add(statement.place(), message, f"it must end in {ends}")
                continue
            draft.cycles.append((chain, statement))
        if image:
            images.append((image, statement))
        for edge in chain:
            draft.edges.setdefault(edge, statement)
    for image, statement in images:
        for edge in image:
            draft.edges.setdefault(edge, statement)
        if statement.section == "cycle" and not any(_same_walk(image, cycle) for cycle, _ in draft.cycles):
            draft.cycles.append((image, statement))


def _same_walk(one: Chain, other: Chain) -> bool:
    return len(one) == len(other) and any(one == (*other[i:], *other[:i]) for i in range(len(other)))


def _refuse_lopsided(what: str, mirror: Mirror, statement: Statement, diagnostics: Diagnostics) -> None:
    words = " nor ".join(list(mirror.symmetry.words)[:2])
    diagnostics.add(
        statement.place(),
        f"{what} differs from its mirror image, but its name contains neither {words}",
        f"name its side, as in {next(iter(mirror.symmetry.words))}",
    )
