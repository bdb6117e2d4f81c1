"""From a behaviour to its text, which `parse` turns into an equal behaviour."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

from coachable.behaviours.behaviour import Behaviour, Dwell, Edge, Phase, Symmetry
from coachable.behaviours.expressions import Constant
from coachable.behaviours.names import WORD, flaw_of_letters
from coachable.behaviours.predicates import All, Any, Predicate, Signal
from coachable.behaviours.text.diagnostics import Diagnostics
from coachable.behaviours.text.formatter import laid_out
from coachable.behaviours.text.lines import rows_of
from coachable.behaviours.text.syntax import quoted


def to_text(behaviour: Behaviour) -> str:
    """The behaviour as text, laid out as `coachable format` does; `parse` of it is an equal behaviour."""
    rows = rows_of("\n".join(_lines(behaviour)) + "\n", "", Diagnostics(), bounded=False)
    return laid_out(rows)


def _lines(behaviour: Behaviour) -> Iterator[str]:
    yield f"behaviour {quoted(behaviour.name)}"
    yield from _described(behaviour.description)
    yield from _section("signals", map(_signal, behaviour.signals))
    if behaviour.symmetry is not None:
        yield _mirror(behaviour.symmetry)
    yield from _section("constants", map(_constant, behaviour.constants))
    yield from _section("vocabulary", (f"{p.words} means {p.predicate}" for p in behaviour.vocabulary))
    yield from _section("phases", map(_phase, behaviour.phases))
    first = _edges_before_cycles(behaviour)
    walked = {edge for cycle in behaviour.cycles for edge in cycle}
    yield from _section("edges", (f"{_name(edge.source)} {_step(edge)}" for edge in first))
    yield from _section("cycle", map(_chain, behaviour.cycles))
    others = [edge for edge in behaviour.edges if edge not in walked and edge not in first]
    yield from _section("edges", (f"{_name(edge.source)} {_step(edge)}" for edge in others))
    if behaviour.outside is not None:
        yield f"outside {quoted(behaviour.outside)}"


def _edges_before_cycles(behaviour: Behaviour) -> tuple[Edge, ...]:
    """The edges to print before the cycles, so that all are printed in their order: mostly none."""
    walked = [edge for cycle in behaviour.cycles for edge in cycle]
    for count in range(len(behaviour.edges)):
        first = behaviour.edges[:count]
        if tuple(dict.fromkeys((*first, *walked, *behaviour.edges))) == behaviour.edges:
            return first
    return behaviour.edges


def _section(name: str, items: Iterable[str]) -> Iterator[str]:
    items = list(items)
    if items:
        yield name
        yield from (f"  {item}" for item in items)


def _described(text: str) -> Iterator[str]:
    lines = text.split("\n")
    plain = all(not line or _is_plain(line, r'[^\s"]') for line in lines) and lines[0] and lines[-1]
    if text:
        yield from (f"  {line}" for line in lines) if plain else [f"  {quoted(text)}"]


def _signal(signal: Signal) -> str:
    return " ".join(
        filter(
            None,
            (
                signal.name,
                f"= d/dt {signal.derivative_of}" if signal.derivative_of is not None else "",
                f"[{signal.unit}]" if signal.unit else "",
                _text(signal.description),
            ),
        )
    )


def _mirror(symmetry: Symmetry) -> str:
    swaps = [f"{left} <-> {right}" for left, right in symmetry.swaps]
    return f"mirror {', '.join([*swaps, *(f'{name} -> -{symmetry.image(name)}' for name in symmetry.flips)])}"


def _constant(constant: Constant) -> str:
    return f"{constant.name} = {constant.number} {_text(constant.description)}".rstrip()


def _phase(phase: Phase) -> str:
    title = f" {quoted(phase.title)}" if phase.title else ""
    dwell = f" {_dwell(phase.dwell)}" if phase.dwell is not None else ""
    return f"{_name(phase.name)}{title}{dwell}: {_comma_separated(phase.predicate)}"


def _comma_separated(predicate: Predicate) -> str:
    if isinstance(predicate, All) and predicate.parts:
        return ", ".join(f"({p})" if isinstance(p, All | Any) else str(p) for p in predicate.parts)
    return str(predicate)


def _dwell(dwell: Dwell) -> str:
    least, most = (repr(time).removesuffix(".0") for time in (dwell.at_least, dwell.at_most))
    if math.isinf(dwell.at_most):
        return f"for at least {least} s"
    return f"for {least} s to {most} s" if dwell.at_least else f"for at most {most} s"


def _chain(cycle: tuple[Edge, ...]) -> str:
    return " ".join([_name(cycle[0].source), *map(_step, cycle)])


def _step(edge: Edge) -> str:
    event = f" on {_name(edge.event)}" if edge.event is not None else ""
    reset = f" with {', '.join(map(str, edge.reset))}" if edge.reset else ""
    return f"-> {_name(edge.target)}{event}{reset}"


def _name(name: str) -> str:
    return name if WORD.fullmatch(name) and not flaw_of_letters(name) else quoted(name)


def _text(text: str) -> str:
    return text if not text or _is_plain(text) else quoted(text)


def _is_plain(line: str, first: str = r"[\w(]") -> bool:
    """Whether a line of description needs no quotes; `first` is a pattern of its first character."""
    plain = re.fullmatch(f"{first}.*", line) and line.isprintable() and "#" not in line
    return bool(plain) and line == " ".join(line.split())
