"""A plant's equations as text that KeYmaera X, SpaceEx and Python read alike.

A name is letters, then an index if need be, for KeYmaera X knows no others. Every formula is made of numbers,
names, + − * /, parentheses, sin and cos.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal

Definitions = Mapping[str, str]
"""Formulas by name, each after those that it uses."""


@dataclass(frozen=True)
class Side:
    """A part of the state space between events, bounded by the guard: a location of the plant's own."""

    name: str
    where: str
    """A conjunction of comparisons, closed."""
    meaning: str
    """In words."""


@dataclass(frozen=True)
class SideChange:
    """From one side to another, without an event."""

    source: str
    target: str
    boundary: str
    """Where that happens: a conjunction of comparisons, equality written `==`."""


@dataclass(frozen=True)
class EventText:
    """The event at which the state jumps, as text."""

    side: str
    """The side on which it happens."""
    next_side: str
    """The side right after it."""
    zero: str
    """An expression that is zero at the event."""
    falling: str
    """A comparison: it falls there."""
    definitions: Definitions
    """Formulas that the reset map uses."""
    reset: tuple[Definitions, ...]
    """The state after the event by name, in groups assigned one after the other; none uses what an earlier
    one has changed."""
    displacement: str
    """By how much the stance foot moves [m]."""
    guard: str
    """The plant's own guard, which falls through zero."""
    admissible: str
    """A comparison: a falling zero counts."""
    meaning: str
    """What its guard does, a sentence."""
    remark: str
    """What a reader of the model must know of it, a sentence or two."""


@dataclass(frozen=True)
class Equations:
    """A plant's flow, event and constants as text."""

    about: str
    """The plant and its units, a sentence."""
    constants: Mapping[str, float]
    """Values by name, SI units."""
    start: Mapping[str, float]
    """The state's names, in order, and the values in which it starts."""
    inputs: Mapping[str, str]
    """Names of the controls, in order, and where each acts."""
    input_words: str
    """What the controls are together: `torques`."""
    derived: Definitions
    """What follows from the constants alone."""
    shared: Definitions
    """What the flow and the reset map have in common."""
    flow: Definitions
    rates: Mapping[str, str]
    """The name of each coordinate's derivative in time."""
    event: EventText
    sides: tuple[Side, ...]
    """The first one is that of the start."""
    side_variable: str
    """The name of a variable that holds the number of the side."""
    side_words: str
    """What changing sides is, in words."""
    side_changes: tuple[SideChange, ...]
    height: str
    """What is positive while the plant is up."""
    height_words: str
    """What it is the height of, a sentence."""
    base: tuple[str, str]
    """What moves: `hip`, and its position relative to the stance foot [m]."""

    @property
    def state_names(self) -> tuple[str, ...]:
        """The coordinates, in order."""
        return tuple(self.start)

    @property
    def variables(self) -> tuple[str, ...]:
        """What changes while the plant flows, but time."""
        return (*self.start, *self.inputs)

    @property
    def definitions(self) -> dict[str, str]:
        """All formulas of the flow and of the event."""
        return {**self.derived, **self.shared, **self.flow, **self.event.definitions}

    @property
    def reset(self) -> dict[str, str]:
        """The state after the event by name, in the state's order."""
        after = {name: formula for group in self.event.reset for name, formula in group.items()}
        return {name: after[name] for name in self.start}

    def depends_on(self, text: str, definitions: Definitions) -> tuple[str, ...]:
        """The `variables` that a text uses, also through its definitions, in their order."""
        names = set(NAME.findall(inlined(text, definitions)))
        return tuple(name for name in self.variables if name in names)


NAME = re.compile(r"[A-Za-z]\w*")
"""A name in a formula."""


def decimal(value: float) -> str:
    """A float as the shortest decimal that is read back as the same float, without an exponent."""
    return format(Decimal(repr(float(value))), "f").removesuffix(".0")


def inlined(text: str, definitions: Definitions) -> str:
    """The text with every defined name in it replaced by its formula, recursively."""

    def expanded(match: re.Match[str]) -> str:
        name = match[0]
        return f"({inlined(definitions[name], definitions)})" if name in definitions else name

    return NAME.sub(expanded, text)
