"""From text to a behaviour; docs/language.md describes the language."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from lark import Token

from coachable.behaviours.behaviour import Behaviour, Symmetry
from coachable.behaviours.names import flaw_of_word
from coachable.behaviours.text.diagnostics import Diagnostics, Place
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
    """A behaviour, and the line of each declaration in its text."""

    behaviour: Behaviour
    lines: Mapping[tuple[str, str], int]
    """By kind (`signal`, `constant`, `phrase`, `phase`, `edge`, `cycle`) and name. A declaration in an
    included file has the line of the `include`, and a mirror image that of its original."""


def parse(text: str, directory: Path | str | None = None) -> Behaviour:
    """The behaviour that a text describes.

    **Arguments:** `directory`: the folder of the files that the text includes; without it the text can
    include none.

    **Raises:** `BehaviourTextError` with every error in the text: line, column, a caret, what was expected
    and, where a name is nearly right, the nearest one.
    """
    return read(text, "", directory).behaviour


def read(text: str, name: str, directory: Path | str | None = None) -> Reading:
    """`parse` for a text that messages call `name`, with the lines of its declarations."""
    diagnostics = Diagnostics()
    rows = rows_of(text, name, diagnostics)
    statements = _statements(rows, diagnostics)
    begin, end = rows[0].source, rows[-1]
    head = _only_one("behaviour", statements, diagnostics)
    outside = _only_one("outside", statements, diagnostics)
    if head is None:
        diagnostics.add(Place(begin, 1, 1), "this text has no name", 'begin it with: behaviour "NAME"')
    if not any(row.section == "phases" for row in rows):
        diagnostics.add(Place(begin, end.number, 1), "there are no phases", "add a section called phases")
    included = _with_includes(statements, directory, diagnostics)
    mirror = _mirror(statements, diagnostics)
    draft = resolved([statement for statement, _ in included], mirror, diagnostics)
    description = _description(rows, diagnostics)
    title = "" if head is None else _quoted(head, diagnostics)
    outside_name = None if outside is None else _quoted(outside, diagnostics)
    if diagnostics:
        diagnostics.stop()
    drop_unused(draft, statements, mirror)
    try:
        behaviour = Behaviour(
            name=title,
            description=description,
            signals=tuple(signal for signal, _ in draft.signals.values()),
            phases=tuple(phase for phase, _ in draft.phases.values()),
            edges=tuple(draft.edges),
            cycles=tuple(chain for chain, _ in draft.cycles),
            constants=tuple(constant for constant, _ in draft.constants.values()),
            vocabulary=tuple(phrase for phrase, _ in draft.phrases.values()),
            outside=outside_name,
            symmetry=None if mirror is None else mirror.symmetry,
        )
    except BehaviourError as error:
        diagnostics.add(Place(begin, 1, 1), str(error))
        diagnostics.stop()
    lines = {id(statement): line for statement, line in included}
    return Reading(behaviour, MappingProxyType(_lines(draft, lambda statement: lines[id(statement)])))


def check_fragment(text: str, name: str, directory: Path | str | None = None) -> None:
    """Check a text without phases, for inclusion in others.

    **Raises:** `BehaviourTextError` as `parse` does.
    """
    diagnostics = Diagnostics()
    statements = _statements(rows_of(text, name, diagnostics), diagnostics)
    _refuse_more_than_a_fragment(statements, diagnostics)
    included = _with_includes(statements, directory, diagnostics)
    resolved([statement for statement, _ in included], None, diagnostics)
    if diagnostics:
        diagnostics.stop()


def is_fragment(text: str) -> bool:
    """Whether a text has neither a name nor phases, so that it can only be included in others."""
    rows = rows_of(text, "", Diagnostics())
    return bool(rows) and not any(row.section in ("behaviour", "phases", "cycle", "edges") for row in rows)


def _statements(rows: Sequence[Row], diagnostics: Diagnostics) -> list[Statement]:
    found = (statement_of(row, diagnostics) for row in rows if row.kind in ("header", "item"))
    return [statement for statement in found if statement is not None]


def _with_includes(
    statements: Sequence[Statement], directory: Path | str | None, diagnostics: Diagnostics
) -> list[tuple[Statement, int]]:
    """The statements, those of included files in the place of `include`, and the line of each in the text."""
    seen: set[str] = set()

    def expanded(statements: Sequence[Statement], path: tuple[str, ...]) -> list[Statement]:
        result = []
        for statement in statements:
            result += [statement] if statement.section != "include" else included(statement, path)
        return result

    def included(statement: Statement, path: tuple[str, ...]) -> list[Statement]:
        name = _quoted(statement, diagnostics)
        if statement.tree is None:
            return []
        try:
            if directory is None:
                raise BehaviourError("this text is in no folder, so it can include no files")
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
            diagnostics.add(statement.place(), str(error))
            return []
        inner = _statements(rows_of(text, str(file), diagnostics), diagnostics)
        _refuse_more_than_a_fragment(inner, diagnostics)
        return expanded(inner, (*path, name))

    lines = []
    for statement in statements:
        inside = expanded([statement], (Path(statement.row.source.name or ".").name,))
        lines += [(inner, statement.row.number) for inner in inside]
    return lines


def _refuse_more_than_a_fragment(statements: Sequence[Statement], diagnostics: Diagnostics) -> None:
    for statement in statements:
        if statement.section not in _OF_A_FRAGMENT:
            diagnostics.add(
                statement.place(),
                f"{statement.section} is not allowed in an included file",
                f"such a file has {', '.join(_OF_A_FRAGMENT)} only",
            )


def _mirror(statements: Sequence[Statement], diagnostics: Diagnostics) -> Mirror | None:
    pairs: dict[str, str] = {}
    flips: dict[str, tuple[str, Statement, Token]] = {}
    for statement in statements:
        if statement.section != "mirror" or statement.tree is None:
            continue
        for part in parts_of(statement.tree):
            left, right = (word for word in parts_of(part) if word.type == "WORD")
            if part.data == "flip":
                if left in flips:
                    diagnostics.add(statement.place(left), f"{left} is given twice")
                flips[str(left)] = str(right), statement, left
                continue
            for word in (left, right):
                if "_" in word or flaw_of_word(str(word)):
                    message = flaw_of_word(str(word)) or f"{word}: a mirror swaps words without an underscore"
                    diagnostics.add(statement.place(word), message)
                if word in (*pairs, *pairs.values()) or left == right:
                    diagnostics.add(statement.place(word), f"{word} is swapped twice")
            pairs[str(left)] = str(right)
    mirror = Mirror.of(Symmetry(tuple(pairs.items()), tuple(map(str, flips))))
    for name, (image, statement, word) in flips.items():
        if mirror.text(name) != image:
            diagnostics.add(
                statement.place(word),
                f"the mirror image of {name} is {mirror.text(name)}, with its sign changed or not",
                f"for example: {name} -> -{mirror.text(name)}",
            )
    return mirror if pairs or flips else None


def _only_one(section: str, statements: Sequence[Statement], diagnostics: Diagnostics) -> Statement | None:
    first, *more = [s for s in statements if s.section == section] or [None]
    for statement in more:
        if statement is not None and first is not None:
            diagnostics.add(statement.place(), f"{section} is given twice; first in line {first.row.number}")
    return first


def _quoted(statement: Statement, diagnostics: Diagnostics) -> str:
    if statement.tree is None:
        return ""
    token = parts_of(statement.tree)[0]
    assert isinstance(token, Token)
    try:
        return string_of(token)
    except BehaviourError as error:
        diagnostics.add(statement.place(token), str(error))
        return ""


def _description(rows: Sequence[Row], diagnostics: Diagnostics) -> str:
    below = [row for row in rows if row.section == "behaviour" and row.kind in ("item", "blank")]
    lines = [" ".join(row.text.split()) for row in below]
    text = "\n".join(lines).strip("\n")
    if not STRING.fullmatch(text):
        return text
    row = next(row for row in below if row.kind == "item")
    try:
        return string_of(Token("STRING", row.text.strip()))
    except BehaviourError as error:
        diagnostics.add(row.place(), str(error))
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
