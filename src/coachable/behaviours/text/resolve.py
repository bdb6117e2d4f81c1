"""From statements to what they declare: every name looked up, every mistake noted in its place."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from lark import Token, Tree

from coachable.behaviours.behaviour import Assignment, Dwell, Edge, Phase
from coachable.behaviours.expressions import Constant
from coachable.behaviours.names import flaw_of_letters, flaw_of_name, flaw_of_word
from coachable.behaviours.predicates import Predicate, Signal
from coachable.behaviours.text.diagnostics import Mistakes
from coachable.behaviours.text.draft import Draft, add_images, close_chains
from coachable.behaviours.text.mirror import Mirror
from coachable.behaviours.text.semantics import MAX_SIZE, Meaning, number_of, place_of, words_of
from coachable.behaviours.text.syntax import Statement, parts_of, rough_name, string_of
from coachable.foundation.errors import BehaviourError
from coachable.foundation.suggestion import suggestion

MAX_TOTAL = 20 * MAX_SIZE
"""Of how many parts all phases together may be, phrases spelt out."""


def resolved(statements: Sequence[Statement], mirror: Mirror | None, mistakes: Mistakes) -> Draft:
    """What the statements of a text, and of those that it includes, declare; mirror images are added."""
    draft = Draft()
    broken = {rough_name(statement.row) for statement in statements if statement.tree is None}
    readable = [statement for statement in statements if statement.tree is not None]

    def among(*sections: str) -> list[Statement]:
        return [statement for statement in readable if statement.section in sections]

    taken: dict[str, Statement] = {}
    for statement in among("signals", "constants"):
        if statement.section == "signals":
            _declare(statement, draft.signals, taken, broken, mistakes, _signal)
        else:
            _declare(statement, draft.constants, taken, broken, mistakes, _constant)
    _check_derivatives(draft, broken, mistakes)
    if mirror is not None:
        _check_images(draft, mirror, broken, mistakes)
    phrases: dict[str, Statement] = {}
    for statement in among("vocabulary"):
        _declare_phrase(statement, phrases, broken, mistakes)
    meaning = Meaning(
        mistakes,
        {name: signal for name, (signal, _) in draft.signals.items()},
        {name: constant for name, (constant, _) in draft.constants.items()},
        phrases,
        mirror,
        frozenset(broken),
    )
    for words, statement in phrases.items():
        if (phrase := meaning.phrase(words)) is not None:
            draft.phrases[words] = phrase, statement
    for statement in among("phases"):
        name = _name(statement, parts_of(statement.tree)[0], mistakes)
        if name in draft.phases:
            _refuse_twice(statement, f"phase {name}", draft.phases[name][1], mistakes)
        elif (phase := _phase(statement, name, meaning, mistakes)) is not None:
            draft.phases[name] = phase, statement
        else:
            broken.add(name)
    if mirror is not None and not mistakes:
        add_images(draft, mirror, meaning, mistakes)
    _refuse_too_much(draft, meaning, mistakes)
    broken |= {mirror.text(name) for name in broken} if mirror else set()
    for statement in among("cycle", "edges"):
        _read_chain(statement, draft, meaning, broken, mistakes)
    close_chains(draft, mirror, mistakes)
    return draft


def _check_images(draft: Draft, mirror: Mirror, broken: set[str], mistakes: Mistakes) -> None:
    for name, (_, statement) in draft.signals.items():
        if (image := mirror.text(name)) not in {*draft.signals, *broken}:
            mistakes.add(statement.place(), f"signal {name} has no mirror image", f"declare {image}, too")
            broken.add(image)


def _check_derivatives(draft: Draft, broken: set[str], mistakes: Mistakes) -> None:
    for signal, statement in draft.signals.values():
        if signal.derivative_of is not None and signal.derivative_of not in {*draft.signals, *broken}:
            derivative = next(part for part in parts_of(statement.tree) if isinstance(part, Tree))
            mistakes.add(
                place_of(statement, derivative),
                f"{signal.derivative_of} is not a signal",
                suggestion(signal.derivative_of, draft.signals),
            )


def _declare(
    statement: Statement,
    declared: dict,
    taken: dict[str, Statement],
    broken: set[str],
    mistakes: Mistakes,
    read: Callable,
) -> None:
    """Add a signal or a constant; they share their names."""
    name = str(parts_of(statement.tree)[0])
    if flaw := flaw_of_name(name):
        mistakes.add(statement.place(), f"{name}: {flaw}")
    elif name in taken:
        _refuse_twice(statement, name, taken[name], mistakes)
    else:
        try:
            declared[name] = read(statement.tree), statement
            taken[name] = statement
            return
        except BehaviourError as error:
            mistakes.add(statement.place(), str(error))
    broken.add(name)


def _signal(tree: Tree) -> Signal:
    name, *rest = parts_of(tree)
    derivative = next((str(parts_of(part)[0]) for part in rest if isinstance(part, Tree)), None)
    said = {part.type: part for part in rest if isinstance(part, Token)}
    unit = " ".join(said["UNIT"][1:-1].split()) if "UNIT" in said else ""
    return Signal(str(name), unit, _description(said), derivative)


def _constant(tree: Tree) -> Constant:
    name, *rest = parts_of(tree)
    said = {part.type: part for part in rest if isinstance(part, Token)}
    return Constant(str(name), number_of(rest), _description(said))


def _description(said: Mapping[str, Token]) -> str:
    token = said.get("TEXT") or said.get("STRING")
    return "" if token is None else string_of(token)


def _declare_phrase(
    statement: Statement, phrases: dict[str, Statement], broken: set[str], mistakes: Mistakes
) -> None:
    tree = parts_of(statement.tree)[0]
    assert isinstance(tree, Tree)
    words = words_of(tree)
    for word in parts_of(tree):
        if flaw := flaw_of_word(str(word)):
            mistakes.add(place_of(statement, word), flaw)
            broken.add(words)
            return
    if words in phrases:
        _refuse_twice(statement, repr(words), phrases[words], mistakes)
    else:
        phrases[words] = statement


def _phase(statement: Statement, name: str, meaning: Meaning, mistakes: Mistakes) -> Phase | None:
    _, *rest, logic = parts_of(statement.tree)
    title, dwell = "", None
    for part in rest:
        if isinstance(part, Token):
            title = _string(statement, part, mistakes)
        else:
            times = [float(str(number)) for number in parts_of(part) if number.type == "NUMBER"]
            try:
                dwell = Dwell(
                    at_least=0.0 if part.data == "at_most" else times[0],
                    **({} if part.data == "at_least" else {"at_most": times[-1]}),
                )
            except BehaviourError as error:
                mistakes.add(place_of(statement, part), str(error))
    predicate = meaning.predicate(statement, logic)
    if predicate is None:
        return None
    if not name.strip():
        mistakes.add(statement.place(), "a phase has an empty name")
        return None
    return Phase(name, title, predicate, dwell)


def _read_chain(
    statement: Statement, draft: Draft, meaning: Meaning, broken: set[str], mistakes: Mistakes
) -> None:
    """Add the edges of a line in `cycle` or `edges`."""
    first, *steps = parts_of(statement.tree)
    if statement.section == "edges" and len(steps) > 1:
        assert isinstance(steps[1], Tree)
        mistakes.add(
            place_of(statement, steps[1]),
            "one edge a line stands in edges",
            "a chain that closes stands in cycle",
        )
        return
    names = [_known_phase(statement, first, draft, broken, mistakes)]
    edges: list[Edge] = []
    for step in steps:
        assert isinstance(step, Tree)
        target, *rest = parts_of(step)
        names.append(_known_phase(statement, target, draft, broken, mistakes))
        event, reset = None, ()
        for part in rest:
            if isinstance(part, Tree) and part.data == "event":
                event = _name(statement, parts_of(part)[0], mistakes)
            elif isinstance(part, Tree):
                reset = _reset(statement, part, draft, meaning, broken, mistakes)
        if names[-1] is not None and names[-2] is not None and reset is not None:
            edges.append(Edge(names[-2], names[-1], event, reset))
    if len(edges) < len(steps):
        return
    earlier = (other for chain, other in draft.chains if chain == tuple(edges) and other.section == "edges")
    if statement.section == "edges" and (first_time := next(earlier, None)) is not None:
        _refuse_twice(statement, f"edge {edges[0]}", first_time, mistakes)
    else:
        draft.chains.append((tuple(edges), statement))


def _known_phase(
    statement: Statement, token: object, draft: Draft, broken: set[str], mistakes: Mistakes
) -> str | None:
    name = _name(statement, token, mistakes)
    if name in draft.phases:
        return name
    if name not in broken:
        assert isinstance(token, Token)
        mistakes.add(
            statement.place(token), f"no phase is called {name!r}", suggestion(name, [*draft.phases, *broken])
        )
    return None


def _reset(
    statement: Statement,
    tree: Tree,
    draft: Draft,
    meaning: Meaning,
    broken: set[str],
    mistakes: Mistakes,
) -> tuple[Assignment, ...] | None:
    assignments: dict[str, Assignment | None] = {}
    for part in parts_of(tree):
        name, value = parts_of(part)
        if name not in draft.signals and name not in broken:
            mistakes.add(statement.place(name), f"{name} is not a signal", suggestion(name, draft.signals))
        if str(name) in assignments:
            mistakes.add(statement.place(name), f"{name} gets two values")
        expression = meaning.expression(statement, value)
        assignments[str(name)] = None
        if expression is not None and name in draft.signals:
            assignments[str(name)] = Assignment(str(name), expression)
    complete = tuple(assignment for assignment in assignments.values() if assignment is not None)
    return complete if len(complete) == len(parts_of(tree)) else None


def _name(statement: Statement, token: object, mistakes: Mistakes) -> str:
    assert isinstance(token, Token)
    if token.type == "STRING":
        return _string(statement, token, mistakes)
    if flaw := flaw_of_letters(str(token)):
        mistakes.add(statement.place(token), flaw, "in quotes any letters can stand together")
    return str(token)


def _string(statement: Statement, token: Token, mistakes: Mistakes) -> str:
    try:
        return string_of(token)
    except BehaviourError as error:
        mistakes.add(statement.place(token), str(error))
        return ""


def _refuse_twice(statement: Statement, what: str, earlier: Statement, mistakes: Mistakes) -> None:
    other = earlier.row.source is not statement.row.source
    where = f"{earlier.row.source.name}, line" if other else "line"
    mistakes.add(statement.place(), f"{what} is given twice; first in {where} {earlier.row.number}")


def _refuse_too_much(draft: Draft, meaning: Meaning, mistakes: Mistakes) -> None:
    predicates: list[Predicate] = [
        value.predicate for value, _ in (*draft.phases.values(), *draft.phrases.values())
    ]
    total = sum(meaning.measure(predicate)[0] for predicate in predicates)
    if total > MAX_TOTAL:
        last = list((draft.phases or draft.phrases).values())[-1][1]
        mistakes.add(
            last.place(),
            f"the phases and phrases are {total} parts in all; no more than {MAX_TOTAL} are read",
        )
        mistakes.stop()
