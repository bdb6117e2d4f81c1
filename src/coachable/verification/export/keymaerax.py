"""The model as a KeYmaera X archive: a program of differential dynamic logic, and that it never falls.

Syntax: KeYmaera X's own parsers, `DLArchiveParser.scala` and `DLParser.scala`; not all of its versions read
comments inside a formula, so there are none. The logic: Platzer, *Logical Foundations of Cyber-Physical
Systems*, 2018.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from coachable.automata.hybrid import TOUCHDOWN
from coachable.behaviours.predicates import Any, Not
from coachable.plants.compass import START, STATE_NAMES
from coachable.verification.export.equations import (
    DERIVED,
    FLOW,
    IMPACT,
    RATES,
    SHARED,
    VARIABLES,
    constants_of,
    decimal,
    depends_on,
)
from coachable.verification.export.model import CONTROL_DT, Model, formula_text

_STATE = ", ".join(STATE_NAMES)
_TYPED_STATE = ", ".join(f"Real {name}" for name in STATE_NAMES)
_LEADS = (
    ("behind", "theta_2 <= theta_1", "0: the swing leg is behind the stance leg"),
    ("ahead", "theta_2 >= theta_1 & theta_1 + theta_2 >= 0", "1: it is ahead, its foot above the ground"),
    ("below", "theta_2 >= theta_1 & theta_1 + theta_2 <= 0", "2: it is ahead, its foot in the ground"),
)
"""The plant's own locations: which side of its guard it is on."""


def keymaerax(model: Model) -> str:
    """The archive's text."""
    return "\n".join(
        [
            *(f"/* {_comment(remark)} */" for remark in model.remarks),
            f'ArchiveEntry "{_string(model.name)}"',
            f'  Description "{_string(model.behaviour.description or model.behaviour.name)}".',
            "",
            "Definitions",
            *(f"  {line}" for line in _Archive(model).definitions()),
            "End.",
            "",
            "ProgramVariables",
            *(f"  {line}" for line in _Archive(model).variables()),
            "End.",
            "",
            "/* Whatever the loop does, as often as it likes, the hip stays above the ground. Its branches:",
            "   a sample; the edges without an event; the swing leg's changes of side; a touchdown; time. */",
            "Problem",
            *(f"  {line}" for line in _Archive(model).problem()),
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
        self.torques = model.torques
        self.formulas = {**DERIVED, **SHARED, **FLOW, **IMPACT, **(self.torques or {})}

    def definitions(self) -> Iterator[str]:
        functions = {"sin", "cos"}
        predicates = list(self.predicates())
        functions |= {
            name for name in ("abs", "min", "max") if any(f"{name}(" in text for text in predicates)
        }
        yield f"import kyx.math.{{{','.join(sorted(functions))}}};"
        for name, value in constants_of(self.model.parameters).items():
            yield f"Real {name} = {decimal(value)};"
        if self.model.controller is not None:
            yield f"Real period = {decimal(CONTROL_DT)}; /* how long a torque is held */"
        if self.model.bounds is not None:
            for name, pair in zip(("lowest", "highest"), self.model.bounds, strict=True):
                yield from (f"Real {name}_{joint} = {value};" for joint, value in enumerate(pair, start=1))
        for name, formula in self.formulas.items():
            arguments = depends_on(formula, self.formulas)
            typed = f"({', '.join(f'Real {argument}' for argument in arguments)})" if arguments else ""
            yield f"Real {name}{typed} = {self.calls(formula)};"
        yield from predicates

    def predicates(self) -> Iterator[str]:
        for location in self.model.locations:
            phases = [phase.predicate for phase in self.model.behaviour.phases]
            predicate = location.invariant if location.invariant is not None else Not(Any(*phases))
            title = _comment(location.title)
            yield f"Bool {location.name}({_TYPED_STATE}) <-> {formula_text(predicate)}; /* {title} */"
        for name, where, _ in _LEADS:
            yield f"Bool {name}(Real theta_1, Real theta_2) <-> {where};"

    def variables(self) -> Iterator[str]:
        yield from (f"Real {name};" for name in VARIABLES)
        yield "Real foot; /* where the stance foot stands */"
        if self.model.controller is not None:
            yield "Real t; /* since the last sample */"
        names = ", ".join(f"{index} {location.name}" for index, location in enumerate(self.model.locations))
        yield f"Real location; /* {names} */"
        yield f"Real leads; /* {'; '.join(words for _, _, words in _LEADS)} */"
        yield "Real new_1; Real new_2; /* for the jump at touchdown */"

    def problem(self) -> Iterator[str]:
        yield from self.start()
        branches = [list(self.sample()), *self.switches(), list(self.touchdown()), list(self.flow())]
        yield "->"
        yield "[{"
        for number, branch in enumerate(branches):
            yield f"  {'++ ' if number else '   '}{{ {branch[0]}"
            yield from (f"       {line}" for line in branch[1:])
            yield "     }"
        yield "}*] cos(theta_1) > 0"

    def start(self) -> Iterator[str]:
        if self.model.controller is None:
            places = (f"location = {k} & {self.here(k)}" for k in range(len(self.model.locations)))
            yield f"({' | '.join(f'({place})' for place in places)})"
            yield f"& {self.led()} & cos(theta_1) > 0 & foot = 0"
            return
        yield " & ".join(f"{name} = {decimal(value)}" for name, value in zip(STATE_NAMES, START, strict=True))
        yield f"& foot = 0 & t = period & location = {self.model.start} & leads = 0"

    def sample(self) -> Iterator[str]:
        if self.model.controller is None:
            yield "u_1 := *; u_2 := *;"
        elif self.torques is not None:
            calls = [self.calls(name) for name in ("torque_1", "torque_2")]
            yield f"?t = period; u_1 := {calls[0]}; u_2 := {calls[1]}; t := 0;"
        else:
            yield "?t = period; u_1 := *; u_2 := *;"
            yield "?lowest_1 <= u_1 & u_1 <= highest_1 & lowest_2 <= u_2 & u_2 <= highest_2; t := 0;"

    def switches(self) -> Iterator[list[str]]:
        """One branch for each edge without an event, and for each way of the plant from side to side."""
        for source, target in self.model.edges(None):
            yield [f"?location = {source} & {self.here(target)}; location := {target};"]
        for source, target in ((0, 1), (0, 2), (1, 0), (2, 0), (2, 1)):
            yield [f"?leads = {source} & {self.side(target)}; leads := {target};"]

    def touchdown(self) -> Iterator[str]:
        yield "?leads = 1 & theta_1 + theta_2 = 0 & dtheta_1 + dtheta_2 <= 0;"
        edges = [f"?location = {s}; location := {t};" for s, t in self.model.edges(TOUCHDOWN)]
        yield f"{{ {' ++ '.join(edges or ['?false;'])} }}"
        yield f"foot := foot + {self.calls('steplength')};"
        yield f"new_1 := {self.calls('after_1')}; new_2 := {self.calls('after_2')};"
        yield "dtheta_1 := new_1; dtheta_2 := new_2;"
        yield "new_1 := theta_2; new_2 := theta_1;"
        yield "theta_1 := new_1; theta_2 := new_2;"
        restarts = self.model.controller is not None and self.model.clock == "touchdown"
        yield "leads := 0;" + (" t := period;" if restarts else "")

    def flow(self) -> Iterator[str]:
        clock = self.model.controller is not None
        rates = ", ".join(f"{name}' = {self.calls(rate)}" for name, rate in RATES.items())
        yield f"{{ {rates}{', t' + chr(39) + ' = 1' if clock else ''}"
        for index in range(len(self.model.locations)):
            yield f"  & (location = {index} -> {self.here(index)})"
        for index in range(len(_LEADS)):
            yield f"  & (leads = {index} -> {self.side(index)})"
        yield ("  & t <= period }" if clock else "}")

    def here(self, location: int) -> str:
        return f"{self.model.locations[location].name}({_STATE})"

    def side(self, leads: int) -> str:
        return f"{_LEADS[leads][0]}(theta_1, theta_2)"

    def led(self) -> str:
        return f"({' | '.join(f'(leads = {k} & {self.side(k)})' for k in range(len(_LEADS)))})"

    def calls(self, text: str) -> str:
        """The text with every defined name in it as a call with the variables that it depends on."""

        def call(match: re.Match[str]) -> str:
            name = match[0]
            arguments = depends_on(self.formulas[name], self.formulas) if name in self.formulas else ()
            return f"{name}({', '.join(arguments)})" if arguments else name

        return re.sub(r"[A-Za-z]\w*", call, text)


def _string(text: str) -> str:
    return " ".join(text.split()).replace("\\", "/").replace('"', "'")


def _comment(text: str) -> str:
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")
