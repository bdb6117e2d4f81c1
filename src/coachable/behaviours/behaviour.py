"""A behaviour: phases, each a predicate over signals, and the order in which they follow one another."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass

from coachable.behaviours.json_form import Node, located, predicate_to_data
from coachable.behaviours.predicates import Predicate, Signal, holds, signals_of
from coachable.behaviours.suggestion import suggestion
from coachable.errors import BehaviourError


@dataclass(frozen=True)
class Phase:
    """A part of the movement: where `predicate` holds. `name` is short (`O1`), `title` is for people."""

    name: str
    title: str
    predicate: Predicate


@dataclass(frozen=True)
class Edge:
    """Phase `target` may follow phase `source`.

    An `event` names something that happens to the plant at that moment, such as `"touchdown"`. It matters
    where the behaviour is executed as a hybrid automaton; a reward derived from the behaviour sees
    phases, never events.
    """

    source: str
    target: str
    event: str | None = None

    def __str__(self) -> str:
        return f"{self.source} → {self.target}" + ("" if self.event is None else f" on {self.event}")


@dataclass(frozen=True)
class Behaviour:
    """What a movement should look like: K phases over named signals, and the edges between them.

    The order of `phases` is part of the meaning: where several hold at once, the first one counts. A
    state in which none holds is *outside* the behaviour.

    **Raises:** `BehaviourError`, naming the culprit, if there is no phase, if a name is empty or given
    twice, if a predicate reads an undeclared signal, or if an edge is given twice or joins an unknown
    phase.
    """

    name: str
    description: str
    signals: tuple[Signal, ...]
    phases: tuple[Phase, ...]
    edges: tuple[Edge, ...]

    def __post_init__(self):
        for field in ("signals", "phases", "edges"):
            object.__setattr__(self, field, tuple(getattr(self, field)))
        with located(f"behaviour {self.name!r}"):
            if not self.phases:
                raise BehaviourError("it has no phases; give at least one")
            for kind, names in (
                ("signal", self.signal_names),
                ("phase", self.phase_names),
                ("edge", self.edges),
            ):
                _refuse_duplicates(kind, names)
            for phase in self.phases:
                if not phase.name.strip():
                    raise BehaviourError("a phase has an empty name")
                for signal in signals_of(phase.predicate):
                    _require_known(f"phase {phase.name}: unknown signal", signal, self.signal_names)
            for edge in self.edges:
                for end in (edge.source, edge.target):
                    _require_known(f"edge {edge}: unknown phase", end, self.phase_names)

    @property
    def signal_names(self) -> tuple[str, ...]:
        """The signals' names, in their order."""
        return tuple(signal.name for signal in self.signals)

    @property
    def phase_names(self) -> tuple[str, ...]:
        """The phases' names, in their order."""
        return tuple(phase.name for phase in self.phases)

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

    def to_json(self) -> str:
        """The behaviour as JSON text; `from_json` reads it back as an equal value."""
        data = {
            "name": self.name,
            "description": self.description,
            "signals": [asdict(signal) for signal in self.signals],
            "phases": [
                {"name": phase.name, "title": phase.title, "predicate": predicate_to_data(phase.predicate)}
                for phase in self.phases
            ],
            "edges": [
                {"source": edge.source, "target": edge.target}
                | ({} if edge.event is None else {"event": edge.event})
                for edge in self.edges
            ],
        }
        return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    @staticmethod
    def from_json(text: str) -> Behaviour:
        """The behaviour that `to_json` wrote, or a person.

        **Raises:** `BehaviourError` saying where: line and column if the text is not JSON, else the place
        in the document, such as `phases[2].predicate.all[0]`.
        """
        try:
            fields = Node.parse(text).fields({"name", "description", "signals", "phases", "edges"})
            return Behaviour(
                name=fields["name"].text(),
                description=fields["description"].text(),
                signals=tuple(map(_read_signal, fields["signals"].items())),
                phases=tuple(map(_read_phase, fields["phases"].items())),
                edges=tuple(map(_read_edge, fields["edges"].items())),
            )
        except RecursionError:
            raise BehaviourError("the document is nested too deeply") from None


def _read_signal(node: Node) -> Signal:
    fields = node.fields({"name"}, {"unit", "description"})
    with located(node.place):
        return Signal(**{name: field.text() for name, field in fields.items()})


def _read_phase(node: Node) -> Phase:
    fields = node.fields({"name", "title", "predicate"})
    return Phase(fields["name"].text(), fields["title"].text(), fields["predicate"].predicate())


def _read_edge(node: Node) -> Edge:
    fields = node.fields({"source", "target"}, {"event"})
    return Edge(**{name: field.text() for name, field in fields.items()})


def _refuse_duplicates(kind: str, values: Iterable[object]) -> None:
    for value, count in Counter(values).items():
        if count > 1:
            raise BehaviourError(f"{kind} {value} is given {count} times")


def _require_known(complaint: str, name: str, known: Iterable[str]) -> None:
    if name not in (known := list(known)):
        raise BehaviourError(f"{complaint} {name!r}; {suggestion(name, known)}")
