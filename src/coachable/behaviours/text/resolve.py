"""From statements to declarations: every name is looked up, every error recorded in its place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from lark import Token, Tree

from coachable.behaviours.behaviour import Assignment, Dwell, Edge, Phase
from coachable.behaviours.expressions import Constant
from coachable.behaviours.names import flaw_of_letters, flaw_of_name, flaw_of_word
from coachable.behaviours.predicates import Predicate, Signal
from coachable.behaviours.text.diagnostics import Diagnostics
from coachable.behaviours.text.draft import Draft, add_images, close_chains
from coachable.behaviours.text.mirror import Mirror
from coachable.behaviours.text.semantics import MAX_SIZE, Scope, number_of, place_of, words_of
from coachable.behaviours.text.syntax import Statement, parts_of, rough_name, string_of
from coachable.foundation.errors import BehaviourError
from coachable.foundation.suggestion import suggestion

MAX_TOTAL = 20 * MAX_SIZE
"""The most parts that all phases together may have, phrases expanded."""


def resolved(statements: Sequence[Statement], mirror: Mirror | None, diagnostics: Diagnostics) -> Draft:
    """The declarations of a text and of those that it includes, with their mirror images."""
    draft = Draft()
    broken = {rough_name(statement.row) for statement in statements if statement.tree is None}
    readable = [statement for statement in statements if statement.tree is not None]

    def among(*sections: str) -> list[Statement]:
        return [statement for statement in readable if statement.section in sections]

    taken: dict[str, Statement] = {}
    for statement in among("signals", "constants"):
        if statement.section == "signals":
            _declare(statement, draft.signals, taken, broken, diagnostics, _signal)
        else:
            _declare(statement, draft.constants, taken, broken, diagnostics, _constant)
    _check_derivatives(draft, broken, diagnostics)
    if mirror is not None:
        signals = [signal for signal, _ in draft.signals.values()]
        derivatives = {one.name: one.derivative_of for one in signals if one.derivative_of is not None}
        mirror = mirror.with_derivatives(derivatives)
        _check_images(draft, mirror, broken, diagnostics)
        _check_flips(mirror, among("mirror"), draft, broken, diagnostics)
    phrases: dict[str, Statement] = {}
    for statement in among("vocabulary"):
        _declare_phrase(statement, phrases, broken, diagnostics)
    scope = Scope(
        diagnostics,
        {name: signal for name, (signal, _) in draft.signals.items()},
        {name: constant for name, (constant, _) in draft.constants.items()},
        phrases,
        mirror,
        frozenset(broken),
    )
    for words, statement in phrases.items():
        if (phrase := scope.phrase(words)) is not None:
            draft.phrases[words] = phrase, statement
    for statement in among("phases"):
        name = _name(statement, parts_of(statement.tree)[0], diagnostics)
        if name in draft.phases:
            _refuse_twice(statement, f"phase {name}", draft.phases[name][1], diagnostics)
        elif (phase := _phase(statement, name, scope, diagnostics)) is not None:
            draft.phases[name] = phase, statement
        else:
            broken.add(name)
    if mirror is not None and not diagnostics:
        add_images(draft, mirror, scope, diagnostics)
    _refuse_too_much(draft, scope, diagnostics)
    broken |= {mirror.text(name) for name in broken} if mirror else set()
    for statement in among("cycle", "edges"):
        _read_chain(statement, draft, scope, broken, diagnostics)
    close_chains(draft, mirror, diagnostics)
    return draft


def _check_images(draft: Draft, mirror: Mirror, broken: set[str], diagnostics: Diagnostics) -> None:
    for name, (_, statement) in draft.signals.items():
        if (image := mirror.text(name)) not in {*draft.signals, *broken}:
            diagnostics.add(
                statement.place(), f"signal {name} has no mirror image", f"declare {image} as well"
            )
            broken.add(image)


def _check_flips(
    mirror: Mirror,
    statements: Iterable[Statement],
    draft: Draft,
    broken: set[str],
    diagnostics: Diagnostics,
) -> None:
    for statement in statements:
        for flip in parts_of(statement.tree):
            name = parts_of(flip)[0]
            if flip.data == "flip" and name not in {*draft.signals, *broken}:
                diagnostics.add(
                    statement.place(name), f"{name} is not a signal", suggestion(name, draft.signals)
                )


def _check_derivatives(draft: Draft, broken: set[str], diagnostics: Diagnostics) -> None:
    for signal, statement in draft.signals.values():
        if signal.derivative_of is not None and signal.derivative_of not in {*draft.signals, *broken}:
            derivative = next(part for part in parts_of(statement.tree) if isinstance(part, Tree))
            diagnostics.add(
                place_of(statement, derivative),
                f"{signal.derivative_of} is not a signal",
                suggestion(signal.derivative_of, draft.signals),
            )


def _declare(
    statement: Statement,
    declared: dict,
    taken: dict[str, Statement],
    broken: set[str],
    diagnostics: Diagnostics,
    read: Callable,
) -> None:
    """Add a signal or a constant; they share their names."""
    name = str(parts_of(statement.tree)[0])
    if flaw := flaw_of_name(name):
        diagnostics.add(statement.place(), f"{name}: {flaw}")
    elif name in taken:
        _refuse_twice(statement, name, taken[name], diagnostics)
    else:
        try:
            declared[name] = read(statement.tree), statement
            taken[name] = statement
            return
        except BehaviourError as error:
            diagnostics.add(statement.place(), str(error))
    broken.add(name)


def _signal(tree: Tree) -> Signal:
    name, *rest = parts_of(tree)
    derivative = next((str(parts_of(part)[0]) for part in rest if isinstance(part, Tree)), None)
    tokens = {part.type: part for part in rest if isinstance(part, Token)}
    unit = " ".join(tokens["UNIT"][1:-1].split()) if "UNIT" in tokens else ""
    return Signal(str(name), unit, _description(tokens), derivative)


def _constant(tree: Tree) -> Constant:
    name, *rest = parts_of(tree)
    tokens = {part.type: part for part in rest if isinstance(part, Token)}
    return Constant(str(name), number_of(rest), _description(tokens))


def _description(tokens: Mapping[str, Token]) -> str:
    token = tokens.get("TEXT") or tokens.get("STRING")
    return "" if token is None else string_of(token)


def _declare_phrase(
    statement: Statement, phrases: dict[str, Statement], broken: set[str], diagnostics: Diagnostics
) -> None:
    tree = parts_of(statement.tree)[0]
    assert isinstance(tree, Tree)
    words = words_of(tree)
    for word in parts_of(tree):
        if flaw := flaw_of_word(str(word)):
            diagnostics.add(place_of(statement, word), flaw)
            broken.add(words)
            return
    if words in phrases:
        _refuse_twice(statement, repr(words), phrases[words], diagnostics)
    else:
        phrases[words] = statement


def _phase(statement: Statement, name: str, scope: Scope, diagnostics: Diagnostics) -> Phase | None:
    _, *rest, logic = parts_of(statement.tree)
    title, dwell = "", None
    for part in rest:
        if isinstance(part, Token):
            title = _string(statement, part, diagnostics)
        else:
            times = [float(str(number)) for number in parts_of(part) if number.type == "NUMBER"]
            try:
                dwell = Dwell(
                    at_least=0.0 if part.data == "at_most" else times[0],
                    **({} if part.data == "at_least" else {"at_most": times[-1]}),
                )
            except BehaviourError as error:
                diagnostics.add(place_of(statement, part), str(error))
    predicate = scope.predicate(statement, logic)
    if predicate is None:
        return None
    if not name.strip():
        diagnostics.add(statement.place(), "a phase has an empty name")
        return None
    return Phase(name, title, predicate, dwell)


def _read_chain(
    statement: Statement, draft: Draft, scope: Scope, broken: set[str], diagnostics: Diagnostics
) -> None:
    """Add the edges of a line in `cycle` or `edges`."""
    first, *steps = parts_of(statement.tree)
    if statement.section == "edges" and len(steps) > 1:
        assert isinstance(steps[1], Tree)
        diagnostics.add(
            place_of(statement, steps[1]),
            "edges has one edge a line",
            "write a chain that closes in cycle",
        )
        return
    names = [_known_phase(statement, first, draft, broken, diagnostics)]
    edges: list[Edge] = []
    for step in steps:
        assert isinstance(step, Tree)
        target, *rest = parts_of(step)
        names.append(_known_phase(statement, target, draft, broken, diagnostics))
        event, reset = None, ()
        for part in rest:
            if isinstance(part, Tree) and part.data == "event":
                event = _name(statement, parts_of(part)[0], diagnostics)
            elif isinstance(part, Tree):
                reset = _reset(statement, part, draft, scope, broken, diagnostics)
        if names[-1] is not None and names[-2] is not None and reset is not None:
            edges.append(Edge(names[-2], names[-1], event, reset))
    if len(edges) < len(steps):
        return
    earlier = (other for chain, other in draft.chains if chain == tuple(edges) and other.section == "edges")
    if statement.section == "edges" and (first_time := next(earlier, None)) is not None:
        _refuse_twice(statement, f"edge {edges[0]}", first_time, diagnostics)
    else:
        draft.chains.append((tuple(edges), statement))


def _known_phase(
    statement: Statement, token: object, draft: Draft, broken: set[str], diagnostics: Diagnostics
) -> str | None:
    name = _name(statement, token, diagnostics)
    if name in draft.phases:
        return name
    if name not in broken:
        assert isinstance(token, Token)
        diagnostics.add(
            statement.place(token), f"no phase is called {name!r}", suggestion(name, [*draft.phases, *broken])
        )
    return None


def _reset(
    statement: Statement,
    tree: Tree,
    draft: Draft,
    scope: Scope,
    broken: set[str],
    diagnostics: Diagnostics,
) -> tuple[Assignment, ...] | None:
    assignments: dict[str, Assignment | None] = {}
    for part in parts_of(tree):
        name, value = parts_of(part)
        if name not in draft.signals and name not in broken:
            diagnostics.add(statement.place(name), f"{name} is not a signal", suggestion(name, draft.signals))
        if str(name) in assignments:
            diagnostics.add(statement.place(name), f"{name} gets two values")
        expression = scope.expression(statement, value)
        assignments[str(name)] = None
        if expression is not None and name in draft.signals:
            assignments[str(name)] = Assignment(str(name), expression)
    complete = tuple(assignment for assignment in assignments.values() if assignment is not None)
    return complete if len(complete) == len(parts_of(tree)) else None


def _name(statement: Statement, token: object, diagnostics: Diagnostics) -> str:
    assert isinstance(token, Token)
    if token.type == "STRING":
        return _string(statement, token, diagnostics)
    if flaw := flaw_of_letters(str(token)):
        diagnostics.add(statement.place(token), flaw, "in quotes any letters can be combined")
    return str(token)


def _string(statement: Statement, token: Token, diagnostics: Diagnostics) -> str:
    try:
        return string_of(token)
    except BehaviourError as error:
        diagnostics.add(statement.place(token), str(error))
        return ""


def _refuse_twice(statement: Statement, what: str, earlier: Statement, diagnostics: Diagnostics) -> None:
    other = earlier.row.source is not statement.row.source
    where = f"{earlier.row.source.name}, line" if other else "line"
    diagnostics.add(statement.place(), f"{what} is given twice; first in {where} {earlier.row.number}")


def _refuse_too_much(draft: Draft, scope: Scope, diagnostics: Diagnostics) -> None:
    predicates: list[Predicate] = [
        value.predicate for value, _ in (*draft.phases.values(), *draft.phrases.values())
    ]
    total = sum(scope.measure(predicate)[0] for predicate in predicates)
    if total > MAX_TOTAL:
        last = list((draft.phases or draft.phrases).values())[-1][1]
        diagnostics.add(
            last.place(),
            f"the phases and phrases have {total} parts in all; no more than {MAX_TOTAL} are read",
        )
        diagnostics.stop()
