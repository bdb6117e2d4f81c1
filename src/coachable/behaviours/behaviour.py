"""A behaviour: phases, each a predicate over signals, and their order."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from coachable.behaviours.expressions import Constant, Expression, Variable
from coachable.behaviours.predicates import (
    Phrase,
    Predicate,
    Signal,
    constants_of,
    holds,
    phrases_of,
    signals_of,
)
from coachable.behaviours.rewriting import unwrapped
from coachable.behaviours.tree import walk
from coachable.foundation.errors import BehaviourError
from coachable.foundation.suggestion import suggestion


@dataclass(frozen=True)
class Dwell:
    """The duration of a phase: at least `at_least` and at most `at_most` [s].

    **Raises:** `BehaviourError` for a time that is negative or not a number, or an infinite `at_least`.
    """

    at_least: int | float = 0.0
    at_most: int | float = math.inf

    def __post_init__(self):
        for field in ("at_least", "at_most"):
            value = float(getattr(self, field))
            if not value >= 0:
                raise BehaviourError(f"a dwell time of {value!r} s; it must not be negative")
            object.__setattr__(self, field, value)
        if math.isinf(self.at_least):
            raise BehaviourError("a phase that must last for ever could never be left")

    def too_short(self, time: Any, tolerance: Any) -> Any:
        """Whether a phase is left too soon after a time [s], or after each in an array."""
        return time < self.at_least - tolerance

    def too_long(self, time: Any, tolerance: Any) -> Any:
        """Whether a phase that still lasts after a time [s] should have been left."""
        return time > self.at_most + tolerance


@dataclass(frozen=True)
class Phase:
    """A part of the movement: the states in which `predicate` holds.

    The `name` is short (`O1`), the `title` descriptive.

    A `dwell` limits how long it may last. That takes memory: a state is in the phase whatever the time.
    """

    name: str
    title: str
    predicate: Predicate
    dwell: Dwell | None = None


@dataclass(frozen=True)
class Assignment:
    """`signal := expression`: what a signal is right after a jump, in terms of the signals before it."""

    signal: str
    expression: Expression

    def __str__(self) -> str:
        return f"{self.signal} := {self.expression}"


@dataclass(frozen=True)
class Edge:
    """Phase `target` may follow phase `source`.

    An `event` is a discrete event of the plant at that moment, such as `"touchdown"`; a `reset` gives the
    jumps of signals then, and signals that it does not name keep their values. They matter where the
    behaviour is checked and where it is executed as a hybrid automaton; a reward derived from the behaviour
    depends on phases, never on events.
    """

    source: str
    target: str
    event: str | None = None
    reset: tuple[Assignment, ...] = ()

    def __str__(self) -> str:
        return f"{self.source} → {self.target}" + ("" if self.event is None else f" on {self.event}")


@dataclass(frozen=True)
class Symmetry:
    """What `mirror left <-> right, sway -> -sway` says: the movement of one side is that of the other.

    `swaps` are pairs of words that change places in names, with capitals, too; an underscore or a hyphen ends
    a word, as in `left_knee`. `flips` are signals whose image has the other sign, as a sway to the left has.
    """

    swaps: tuple[tuple[str, str], ...] = ()
    flips: tuple[str, ...] = ()

    def __post_init__(self):
        object.__setattr__(self, "swaps", tuple((left, right) for left, right in self.swaps))
        object.__setattr__(self, "flips", tuple(self.flips))

    def image(self, text: str) -> str:
        """The text with whole words swapped."""
        if not self.words:
            return text
        either = "|".join(map(re.escape, self.words))
        return re.sub(rf"(?<![^\W_])(?:{either})(?![^\W_])", lambda match: self.words[match.group()], text)

    @cached_property
    def words(self) -> Mapping[str, str]:
        """Every word that is swapped, to its image."""
        words: dict[str, str] = {}
        for left, right in self.swaps:
            for change in (str, str.capitalize, str.upper):
                words |= {change(left): change(right), change(right): change(left)}
        return words


@dataclass(frozen=True)
class Behaviour:
    """What a movement should look like: K phases over named signals, and the edges between them.

    The order of `phases` is part of the meaning: where several hold at once, the first one counts. A
    state in which none holds is *outside* the behaviour; `outside` is a name for that, if it is intended.

    `cycles` are closed walks along the edges: taking all edges of one in order completes a cycle.
    `constants` and `vocabulary` are the names used in the predicates, and unused ones; missing ones are
    added. An `All` or `Any` of a single part is replaced by the part, which has the same text.

    `symmetry` says what is whose mirror image, if the text does; phases of both sides are among the phases.

    **Raises:** `BehaviourError`, naming the culprit, if there is no phase, if a name is empty or given
    twice, if a phrase or a constant has two meanings, if a predicate reads an undeclared signal, if an edge
    is given twice or joins an unknown phase, or if a cycle takes what is not an edge or does not close.
    """

    name: str
    description: str
    signals: tuple[Signal, ...]
    phases: tuple[Phase, ...]
    edges: tuple[Edge, ...]
    cycles: tuple[tuple[Edge, ...], ...] = ()
    constants: tuple[Constant, ...] = ()
    vocabulary: tuple[Phrase, ...] = ()
    outside: str | None = None
    symmetry: Symmetry | None = None

    def __post_init__(self):
        for field in ("signals", "phases", "edges", "constants", "vocabulary"):
            object.__setattr__(self, field, tuple(getattr(self, field)))
        object.__setattr__(self, "cycles", tuple(map(tuple, self.cycles)))
        self._complete()
        with located(f"behaviour {self.name!r}"):
            if not self.phases:
                raise BehaviourError("it has no phases; give at least one")
            for kind, names in (
                ("name", [*self.signal_names, *(constant.name for constant in self.constants)]),
                ("phrase", [phrase.words for phrase in self.vocabulary]),
                ("phase", self.phase_names),
                ("edge", self.edges),
            ):
                _refuse_duplicates(kind, names)
            for signal in self.signals:
                if signal.derivative_of is not None:
                    complaint = f"signal {signal.name}: it is the derivative of an unknown signal"
                    _require_known(complaint, signal.derivative_of, self.signal_names)
            for phrase in self.vocabulary:
                for signal in signals_of(phrase.predicate):
                    _require_known(f"phrase {phrase.words!r}: unknown signal", signal, self.signal_names)
            for phase in self.phases:
                if not phase.name.strip():
                    raise BehaviourError("a phase has an empty name")
                for signal in signals_of(phase.predicate):
                    _require_known(f"phase {phase.name}: unknown signal", signal, self.signal_names)
            for edge in self.edges:
                for end in (edge.source, edge.target):
                    _require_known(f"edge {edge}: unknown phase", end, self.phase_names)
                for assignment in edge.reset:
                    read = [variable.signal for variable in walk(assignment.expression, Variable)]
                    for signal in (assignment.signal, *read):
                        _require_known(f"edge {edge}: unknown signal", signal, self.signal_names)
            for cycle in self.cycles:
                self._require_closed(cycle)

    def _complete(self) -> None:
        """Bring predicates into the form that their text has, and collect their phrases and constants."""
        phases = tuple(replace(phase, predicate=unwrapped(phase.predicate)) for phase in self.phases)
        given = (replace(phrase, predicate=unwrapped(phrase.predicate)) for phrase in self.vocabulary)
        used = (phrase for phase in phases for phrase in phrases_of(phase.predicate))
        vocabulary = dict.fromkeys(given)
        vocabulary |= dict.fromkeys(inner for phrase in (*vocabulary, *used) for inner in phrases_of(phrase))
        constants = dict.fromkeys(self.constants)
        for phrase in vocabulary:
            constants |= dict.fromkeys(constants_of(phrase.predicate))
        for phase in phases:
            constants |= dict.fromkeys(constants_of(phase.predicate))
        for edge in self.edges:
            for assignment in edge.reset:
                constants |= dict.fromkeys(walk(assignment.expression, Constant))
        object.__setattr__(self, "phases", phases)
        object.__setattr__(self, "vocabulary", tuple(vocabulary))
        object.__setattr__(self, "constants", tuple(constants))

    def _require_closed(self, cycle: tuple[Edge, ...]) -> None:
        if not cycle:
            raise BehaviourError("a cycle has no edges")
        for edge, following in zip(cycle, (*cycle[1:], *cycle[:1]), strict=True):
            if edge not in self.edges:
                raise BehaviourError(f"a cycle takes {edge}, which is not an edge")
            if edge.target != following.source:
                raise BehaviourError(f"a cycle continues from {edge} with {following}, so it does not close")

    @property
    def signal_names(self) -> tuple[str, ...]:
        """The signals' names, in their order."""
        return tuple(signal.name for signal in self.signals)

    @property
    def phase_names(self) -> tuple[str, ...]:
        """The phases' names, in their order."""
        return tuple(phase.name for phase in self.phases)

    @property
    def phase_images(self) -> tuple[int, ...]:
        """For each phase the index of its mirror image, which is its own where there is no other."""
        names = self.phase_names
        if self.symmetry is None:
            return tuple(range(len(names)))
        images = map(self.symmetry.image, names)
        return tuple(
            names.index(image if image in names else name) for name, image in zip(names, images, strict=True)
        )

    @property
    def mirrored_phases(self) -> tuple[bool, ...]:
        """Whether each phase is the image of one before it: the half that a text leaves to its mirror."""
        return tuple(image < index for index, image in enumerate(self.phase_images))

    def signal_image(self, name: str) -> tuple[str, int]:
        """The signal that is a signal's mirror image, and its sign: −1 for one that points to a side."""
        if self.symmetry is None:
            return name, 1
        primitive = {signal.name: signal.derivative_of for signal in self.signals}
        image, traced, flips = self.symmetry.image(name), name, False
        for _ in self.signals:
            flips = (
                flips or traced in self.symmetry.flips or self.symmetry.image(traced) in self.symmetry.flips
            )
            traced = primitive.get(traced) or traced
        return image, -1 if flips else 1

    def phase_at(self, values: Mapping[str, float]) -> str | None:
        """The name of the first phase that holds at the given signal values, or `None` outside all of them.

        A state in which any signal is NaN is outside.

        **Raises:** `BehaviourError` if a signal has no value.
        """
        for name in self.signal_names:
            if name not in values:
                raise BehaviourError(f"signal {name} has no value; {suggestion(name, values)}")
        if any(math.isnan(values[name]) for name in self.signal_names):
            return None
        return next((phase.name for phase in self.phases if holds(phase.predicate, values)), None)


def _refuse_duplicates(kind: str, values: Iterable[object]) -> None:
    for value, count in Counter(values).items():
        if count > 1:
            raise BehaviourError(f"{kind} {value} is given {count} times")


def _require_known(complaint: str, name: str, known: Iterable[str]) -> None:
    if name not in (known := list(known)):
        raise BehaviourError(f"{complaint} {name!r}; {suggestion(name, known)}")


@contextmanager
def located(place: str) -> Iterator[None]:
    """Put a place before the message of any `BehaviourError` raised inside."""
    try:
        yield
    except BehaviourError as error:
        raise BehaviourError(f"{place}: {error}") from None
