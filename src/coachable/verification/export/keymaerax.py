"""The model as a KeYmaera X archive: a program of differential dynamic logic, and that it never falls.

Syntax: KeYmaera X's own parsers, `DLArchiveParser.scala` and `DLParser.scala`; not all of its versions read
comments inside a formula, so there are none. The logic: Platzer, *Logical Foundations of Cyber-Physical
Systems*, 2018.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from coachable.automata.hybrid import TOUCHDOWN
from coachable.behaviours.predicates import Any, Not
from coachable.plants.equations import NAME, Side, decimal
from coachable.verification.export.model import CONTROL_DT, Model, formula_text


def keymaerax(model: Model) -> str:
    """The archive's text."""
    archive, equations = _Archive(model), model.equations
    return "\n".join(
        [
            *(f"/* {_comment(remark)} */" for remark in model.remarks),
            f'ArchiveEntry "{_string(model.name)}"',
            f'  Description "{_string(model.behaviour.description or model.behaviour.name)}".',
            "",
            "Definitions",
            *(f"  {line}" for line in archive.definitions()),
            "End.",
            "",
            "ProgramVariables",
            *(f"  {line}" for line in archive.variables()),
            "End.",
            "",
            f"/* Whatever the loop does, as often as it likes, the {equations.base[0]} stays above "
            "the ground. Its branches:",
            f"   a sample; the edges without an event; {equations.side_words}; a touchdown; time. */",
            "Problem",
            *(f"  {line}" for line in archive.problem()),
            "End.",
            "",
            "End.",
            "",
        ]
    )


class _Archive:
    """The parts of one archive, line by line."""

    def __init__(self, model: Model):
        self.model = model
        self.equations = model.equations
        self.controls = model.controls
        self.formulas = {**self.equations.definitions, **(self.controls or {})}
        self.state = ", ".join(self.equations.state_names)
        self.sides = {side.name: number for number, side in enumerate(self.equations.sides)}

    def definitions(self) -> Iterator[str]:
        functions = {"sin", "cos"}
        predicates = list(self.predicates())
        functions |= {
            name for name in ("abs", "min", "max") if any(f"{name}(" in text for text in predicates)
        }
        yield f"import kyx.math.{{{','.join(sorted(functions))}}};"
        for name, value in self.equations.constants.items():
            yield f"Real {name} = {decimal(value)};"
        if self.model.controller is not None:
            yield f"Real period = {decimal(CONTROL_DT)}; /* how long a torque is held */"
        if self.model.bounds is not None:
            for name, pair in zip(("lowest", "highest"), self.model.bounds, strict=True):
                yield from (f"Real {name}_{joint} = {value};" for joint, value in enumerate(pair, start=1))
        for name, formula in self.formulas.items():
            arguments = self.equations.depends_on(formula, self.formulas)
            typed = f"({', '.join(f'Real {argument}' for argument in arguments)})" if arguments else ""
            yield f"Real {name}{typed} = {self.calls(formula)};"
        yield from predicates

    def predicates(self) -> Iterator[str]:
        for location in self.model.locations:
            phases = [phase.predicate for phase in self.model.behaviour.phases]
            typed = _typed(self.equations.state_names)
            predicate = location.invariant if location.invariant is not None else Not(Any(*phases))
            title = _comment(location.title)
            yield f"Bool {location.name}({typed}) <-> {formula_text(predicate)}; /* {title} */"
        for side in self.equations.sides:
            yield f"Bool {side.name}({_typed(self.side_variables(side))}) <-> {side.where};"

    def variables(self) -> Iterator[str]:
        yield from (f"Real {name};" for name in self.equations.variables)
        yield "Real foot; /* where the stance foot stands */"
        if self.model.controller is not None:
            yield "Real t; /* since the last sample */"
        names = ", ".join(f"{index} {location.name}" for index, location in enumerate(self.model.locations))
        yield f"Real location; /* {names} */"
        sides = "; ".join(f"{number}: {side.meaning}" for number, side in enumerate(self.equations.sides))
        yield f"Real {self.equations.side_variable}; /* {sides} */"
        most = max(map(len, self.equations.event.reset))
        yield f"{' '.join(f'Real new_{k};' for k in range(1, most + 1))} /* for the jump at touchdown */"

    def problem(self) -> Iterator[str]:
        yield from self.start()
        branches = [list(self.sample()), *self.switches(), list(self.touchdown()), list(self.flow())]
        yield "->"
        yield "[{"
        for number, branch in enumerate(branches):
            yield f"  {'++ ' if number else '   '}{{ {branch[0]}"
            yield from (f"       {line}" for line in branch[1:])
            yield "     }"
        yield f"}}*] {self.equations.height} > 0"

    def start(self) -> Iterator[str]:
        if self.model.controller is None:
            places = (f"location = {k} & {self.here(k)}" for k in range(len(self.model.locations)))
            yield f"({' | '.join(f'({place})' for place in places)})"
            yield f"& {self.on_a_side()} & {self.equations.height} > 0 & foot = 0"
            return
        yield " & ".join(f"{name} = {decimal(value)}" for name, value in self.equations.start.items())
        side = self.equations.side_variable
        yield f"& foot = 0 & t = period & location = {self.model.start} & {side} = 0"

    def sample(self) -> Iterator[str]:
        inputs = list(enumerate(self.equations.inputs, start=1))
        free = " ".join(f"{name} := *;" for _, name in inputs)
        if self.model.controller is None:
            yield free
        elif self.controls is not None:
            held = " ".join(f"{name} := {self.calls(f'torque_{index}')};" for index, name in inputs)
            yield f"?t = period; {held} t := 0;"
        else:
            yield f"?t = period; {free}"
            within = (f"lowest_{index} <= {name} & {name} <= highest_{index}" for index, name in inputs)
            yield f"?{' & '.join(within)}; t := 0;"

    def switches(self) -> Iterator[list[str]]:
        """One branch for each edge without an event, and for each way of the plant from side to side."""
        for source, target in self.model.edges(None):
            yield [f"?location = {source} & {self.here(target)}; location := {target};"]
        variable = self.equations.side_variable
        for change in self.equations.side_changes:
            source, target = self.sides[change.source], self.sides[change.target]
            yield [f"?{variable} = {source} & {self.side(target)}; {variable} := {target};"]

    def touchdown(self) -> Iterator[str]:
        event, side = self.equations.event, self.equations.side_variable
        yield f"?{side} = {self.sides[event.side]} & {event.zero} = 0 & {event.falling};"
        edges = [f"?location = {s}; location := {t};" for s, t in self.model.edges(TOUCHDOWN)]
        yield f"{{ {' ++ '.join(edges or ['?false;'])} }}"
        yield f"foot := foot + {self.calls(event.displacement)};"
        for group in event.reset:
            yield " ".join(
                f"new_{k} := {self.calls(after)};" for k, after in enumerate(group.values(), start=1)
            )
            yield " ".join(f"{name} := new_{k};" for k, name in enumerate(group, start=1))
        restarts = self.model.controller is not None and self.model.clock == "touchdown"
        yield f"{side} := {self.sides[event.next_side]};" + (" t := period;" if restarts else "")

    def flow(self) -> Iterator[str]:
        clock = self.model.controller is not None
        rates = ", ".join(f"{name}' = {self.calls(rate)}" for name, rate in self.equations.rates.items())
        yield f"{{ {rates}{', t' + chr(39) + ' = 1' if clock else ''}"
        for index in range(len(self.model.locations)):
            yield f"  & (location = {index} -> {self.here(index)})"
        for index in range(len(self.sides)):
            yield f"  & ({self.equations.side_variable} = {index} -> {self.side(index)})"
        yield ("  & t <= period }" if clock else "}")

    def here(self, location: int) -> str:
        return f"{self.model.locations[location].name}({self.state})"

    def side(self, index: int) -> str:
        side = self.equations.sides[index]
        return f"{side.name}({', '.join(self.side_variables(side))})"

    def side_variables(self, side: Side) -> tuple[str, ...]:
        return self.equations.depends_on(side.where, {})

    def on_a_side(self) -> str:
        variable = self.equations.side_variable
        places = (f"({variable} = {k} & {self.side(k)})" for k in range(len(self.sides)))
        return f"({' | '.join(places)})"

    def calls(self, text: str) -> str:
        """The text with every defined name in it as a call with the variables that it depends on."""

        def call(match: re.Match[str]) -> str:
            name = match[0]
            arguments = (
                self.equations.depends_on(self.formulas[name], self.formulas) if name in self.formulas else ()
            )
            return f"{name}({', '.join(arguments)})" if arguments else name

        return NAME.sub(call, text)


def _typed(names: Iterable[str]) -> str:
    return ", ".join(f"Real {name}" for name in names)


def _string(text: str) -> str:
    return " ".join(text.split()).replace("\\", "/").replace('"', "'")


def _comment(text: str) -> str:
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")
