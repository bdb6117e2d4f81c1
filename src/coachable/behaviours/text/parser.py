"""From text to a behaviour; docs/language.md describes the language."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from lark import Token

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.names import flaw_of_word
from coachable.behaviours.text.diagnostics import Mistakes, Place
from coachable.behaviours.text.draft import Draft, drop_unused
from coachable.behaviours.text.lines import Row, rows_of
from coachable.behaviours.text.mirror import Mirror
from coachable.behaviours.text.resolve import resolved
from coachable.behaviours.text.sources import beside, read_text
from coachable.behaviours.text.syntax import STRING, Statement, parts_of, statement_of, string_of
from coachable.foundation.errors import BehaviourError

MAX_INCLUDED = 16
"""How many files a text may include, those that they include counted, too."""

_OF_A_FRAGMENT = ("signals", "constants", "vocabulary", "include")


@dataclass(frozen=True)
class Reading:
    """A behaviour, and in which line of its text each of its things is said."""

    behaviour: Behaviour
    lines: Mapping[tuple[str, str], int]
    """By kind (`signal`, `constant`, `phrase`, `phase`, `edge`, `cycle`) and name. What an included file says
    is said where it is included, and a mirror image where its original is."""


def parse(text: str, directory: Path | str | None = None) -> Behaviour:
    """The behaviour that a text describes.

    **Arguments:** `directory`, where files that the text includes lie; without one it can include none.

    **Raises:** `BehaviourTextError` with every mistake in the text: line, column, a caret, what was expected
    and, where a name is nearly right, the nearest one.
    """
    return read(text, "", directory).behaviour


def read(text: str, name: str, directory: Path | str | None = None) -> Reading:
    """`parse` for a text that is called `name` in messages, with the lines where things are said."""
    mistakes = Mistakes()
    rows = rows_of(text, name, mistakes)
    statements = _statements(rows, mistakes)
    begin, end = rows[0].source, rows[-1]
    head = _only_one("behaviour", statements, mistakes)
    outside = _only_one("outside", statements, mistakes)
    if head is None:
        mistakes.add(Place(begin, 1, 1), "this text has no name", 'begin it with: behaviour "NAME"')
    if not any(row.section == "phases" for row in rows):
        mistakes.add(
            Place(begin, end.number, 1), "there are no phases", "add a section that is called phases"
        )
    included = _with_includes(statements, directory, mistakes)
    draft = resolved([statement for statement, _ in included], _mirror(statements, mistakes), mistakes)
    description = _description(rows, mistakes)
    called = "" if head is None else _quoted(head, mistakes)
    people_say = None if outside is None else _quoted(outside, mistakes)
    if mistakes:
        mistakes.stop()
    drop_unused(draft, statements)
    try:
        behaviour = Behaviour(
            name=called,
            description=description,
            signals=tuple(signal for signal, _ in draft.signals.values()),
            phases=tuple(phase for phase, _ in draft.phases.values()),
            edges=tuple(draft.edges),
            cycles=tuple(chain for chain, _ in draft.cycles),
            constants=tuple(constant for constant, _ in draft.constants.values()),
            vocabulary=tuple(phrase for phrase, _ in draft.phrases.values()),
            outside=people_say,
        )
    except BehaviourError as error:
        mistakes.add(Place(begin, 1, 1), str(error))
        mistakes.stop()
    lines = {id(statement): line for statement, line in included}
    return Reading(behaviour, MappingProxyType(_lines(draft, lambda statement: lines[id(statement)])))


def check_fragment(text: str, name: str, directory: Path | str | None = None) -> None:
    """Read a text without phases, which is there to be included.

    **Raises:** `BehaviourTextError` as `parse` does.
    """
    mistakes = Mistakes()
    statements = _statements(rows_of(text, name, mistakes), mistakes)
    _refuse_more_than_a_fragment(statements, mistakes)
    included = _with_includes(statements, directory, mistakes)
    resolved([statement for statement, _ in included], None, mistakes)
    if mistakes:
        mistakes.stop()


def is_fragment(text: str) -> bool:
    """Whether a text has neither a name nor phases, so that it can only be there to be included."""
    rows = rows_of(text, "", Mistakes())
    return bool(rows) and not any(row.section in ("behaviour", "phases", "cycle", "edges") for row in rows)


def _statements(rows: Sequence[Row], mistakes: Mistakes) -> list[Statement]:
    found = (statement_of(row, mistakes) for row in rows if row.kind in ("header", "item"))
    return [statement for statement in found if statement is not None]


def _with_includes(
    statements: Sequence[Statement], directory: Path | str | None, mistakes: Mistakes
) -> list[tuple[Statement, int]]:
    """The statements, those of included files in the place of `include`, and the line of each in the text."""
    seen: set[str] = set()

    def expanded(statements: Sequence[Statement], path: tuple[str, ...]) -> list[Statement]:
        result = []
        for statement in statements:
            result += [statement] if statement.section != "include" else included(statement, path)
        return result

    def included(statement: Statement, path: tuple[str, ...]) -> list[Statement]:
        name = _quoted(statement, mistakes)
        if statement.tree is None:
            return []
        try:
            if directory is None:
                raise BehaviourError("this text is in no folder, so there is nothing beside it to include")
            file = beside(Path(directory), name)
            if name in path:
                raise BehaviourError(f"{name!r} includes itself: {' → '.join([*path, name])}")
            if name in seen:
                return []
            if len(seen) == MAX_INCLUDED:
                raise BehaviourError(f"no more than {MAX_INCLUDED} files are included")
            seen.add(name)
            text = read_text(file)
        except BehaviourError as error:
            mistakes.add(statement.place(), str(error))
            return []
        inner = _statements(rows_of(text, str(file), mistakes), mistakes)
        _refuse_more_than_a_fragment(inner, mistakes)
        return expanded(inner, (*path, name))

    lines = []
    for statement in statements:
        inside = expanded([statement], (Path(statement.row.source.name or ".").name,))
        lines += [(inner, statement.row.number) for inner in inside]
    return lines


def _refuse_more_than_a_fragment(statements: Sequence[Statement], mistakes: Mistakes) -> None:
    for statement in statements:
        if statement.section not in _OF_A_FRAGMENT:
            mistakes.add(
                statement.place(),
                f"{statement.section} has no place in a file that is included",
                f"such a file has {', '.join(_OF_A_FRAGMENT)} only",
            )


def _mirror(statements: Sequence[Statement], mistakes: Mistakes) -> Mirror | None:
    pairs: dict[str, str] = {}
    for statement in statements:
        if statement.section == "mirror" and statement.tree is not None:
            for pair in parts_of(statement.tree):
                left, right = parts_of(pair)
                for word in (left, right):
                    if "_" in word or flaw_of_word(str(word)):
                        message = (
                            flaw_of_word(str(word)) or f"{word}: a mirror swaps words without an underscore"
                        )
                        mistakes.add(statement.place(word), message)
                    if word in (*pairs, *pairs.values()) or left == right:
                        mistakes.add(statement.place(word), f"{word} is swapped twice")
                pairs[str(left)] = str(right)
    return Mirror.of(pairs.items()) if pairs else None


def _only_one(section: str, statements: Sequence[Statement], mistakes: Mistakes) -> Statement | None:
    first, *more = [s for s in statements if s.section == section] or [None]
    for statement in more:
        if statement is not None and first is not None:
            mistakes.add(statement.place(), f"{section} is given twice; first in line {first.row.number}")
    return first


def _quoted(statement: Statement, mistakes: Mistakes) -> str:
    if statement.tree is None:
        return ""
    token = parts_of(statement.tree)[0]
    assert isinstance(token, Token)
    try:
        return string_of(token)
    except BehaviourError as error:
        mistakes.add(statement.place(token), str(error))
        return ""


def _description(rows: Sequence[Row], mistakes: Mistakes) -> str:
    said = [row for row in rows if row.section == "behaviour" and row.kind in ("item", "blank")]
    lines = [" ".join(row.text.split()) for row in said]
    text = "\n".join(lines).strip("\n")
    if not STRING.fullmatch(text):
        return text
    row = next(row for row in said if row.kind == "item")
    try:
        return string_of(Token("STRING", row.text.strip()))
    except BehaviourError as error:
        mistakes.add(row.place(), str(error))
        return ""


def _lines(draft: Draft, line_of: Callable[[Statement], int]) -> dict[tuple[str, str], int]:
    lines: dict[tuple[str, str], int] = {}
    for kind, declared in (
        ("signal", draft.signals),
        ("constant", draft.constants),
        ("phrase", draft.phrases),
        ("phase", draft.phases),
    ):
        lines |= {(kind, name): line_of(statement) for name, (_, statement) in declared.items()}
    for edge, statement in draft.edges.items():
        lines.setdefault(("edge", str(edge)), line_of(statement))
    cycles = enumerate(draft.cycles)
    return lines | {("cycle", str(index)): line_of(statement) for index, (_, statement) in cycles}
