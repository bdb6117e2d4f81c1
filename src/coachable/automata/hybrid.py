"""A behaviour and a plant together: the hybrid automaton of section II of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from jaxtyping import Array, Float

from coachable.behaviours.behaviour import Behaviour, Edge
from coachable.behaviours.predicates import Predicate, Signal
from coachable.foundation.errors import BehaviourError
from coachable.foundation.suggestion import suggestion
from coachable.plants.plant import Plant

State = Float[Array, " state"]
Flow = Callable[[State, Float[Array, " control"]], State]
Reset = Callable[[State], State]

TOUCHDOWN = "touchdown"
"""The name of the event at which a foot comes down."""


@dataclass(frozen=True)
class HybridAutomaton:
    """ℋ = (V_D, Q, E, μ₁, μ₂, μ₃), Harnack et al., CDC 2023, section II, after Alur and Henzinger.

    An edge without an event is taken when the invariant of its source fails and that of its target holds. An
    edge with an event is taken when that event occurs, if the invariant of its target then holds. So is
    (O4, O1) of ideal walking at touchdown. By the paper's definition, which has no events, it never could
    be taken, for the invariant of O4 stays true there.
    """

    data_variables: tuple[Signal, ...]
    """V_D, the variables of the invariants."""
    locations: tuple[str, ...]
    """Q, one a phase."""
    edges: tuple[Edge, ...]
    """E ⊆ Q × Q, where an edge may carry an event."""
    activities: Mapping[str, Flow]
    """μ₁(q): ẋ = μ₁(q)(x, u)."""
    invariants: Mapping[str, Predicate]
    """μ₂(q): a predicate over the data variables."""
    resets: Mapping[Edge, Reset]
    """μ₃(e): from the state before the edge to the one after; the identity on edges without an event."""
    plant: Plant
    """The source of the flow, of the data variables' values, and of events."""

    @staticmethod
    def of(behaviour: Behaviour, plant: Plant) -> HybridAutomaton:
        """The automaton of a behaviour on a plant: in every phase the plant flows, at an event it jumps.

        The plant defines the jump; an edge's own `reset` is not used.

        **Raises:** `BehaviourError` if an edge carries an event that the plant does not have, or a reset
        without an event, so that the plant never jumps.
        """
        jumps: dict[str | None, Reset] = {None: _identity}
        jumps |= {event.name: event.reset for event in plant.events}
        for edge in behaviour.edges:
            if edge.event not in jumps:
                known = suggestion(str(edge.event), [event.name for event in plant.events])
                raise BehaviourError(f"edge {edge}: the plant has no event called {edge.event!r}; {known}")
            if edge.event is None and edge.reset:
                raise BehaviourError(
                    f"edge {edge}: it resets {', '.join(change.signal for change in edge.reset)}, but has no "
                    f"event at which the plant could jump; write {edge} on {TOUCHDOWN}"
                )
        return HybridAutomaton(
            data_variables=behaviour.signals,
            locations=behaviour.phase_names,
            edges=behaviour.edges,
            activities=MappingProxyType(dict.fromkeys(behaviour.phase_names, plant.flow)),
            invariants=MappingProxyType({phase.name: phase.predicate for phase in behaviour.phases}),
            resets=MappingProxyType({edge: jumps[edge.event] for edge in behaviour.edges}),
            plant=plant,
        )


def _identity(x: State) -> State:
    return x
