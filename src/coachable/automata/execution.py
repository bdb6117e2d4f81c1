"""Execution of a hybrid automaton: it flows in a location until its invariant fails or an event occurs."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from coachable.automata.hybrid import HybridAutomaton
from coachable.behaviours.behaviour import Edge
from coachable.behaviours.predicates import All, Predicate, holds, phrases_of
from coachable.behaviours.rewriting import conjuncts
from coachable.plants.plant import Event
from coachable.plants.runge_kutta import rk4

_NUM_SUBSTEPS = 4
"""Runge–Kutta steps in a control step; an invariant that fails and holds again within one is not noticed."""

_MAX_TRANSITIONS_IN_A_STEP = 100


class Termination(enum.Enum):
    """How an execution ended."""

    COMPLETED = "The execution ran for its full time."
    START_OUTSIDE = "x0 is in no location."
    DEADLOCK = "Deadlock: the location must be left, and no edge can be taken."
    NONDETERMINISM = "Nondeterminism: there is more than one continuation."
    ZENO = "Zeno: transitions accumulate without end."
    FELL = "The plant fell."
    NOT_FINITE = "The state is no longer finite."

    @property
    def sentence(self) -> str:
        """The termination in words."""
        return self.value


@dataclass(frozen=True)
class Transition:
    """An edge that was taken, and when [s]."""

    time: float
    edge: Edge


@dataclass(frozen=True)
class Execution:
    """A run of a hybrid automaton. A transition has two rows of the same time: before it and after it."""

    times: Float[np.ndarray, " rows"]
    """[s]"""
    states: Float[np.ndarray, "rows state"]
    """The plant's states."""
    locations: tuple[str, ...]
    """The location of each row."""
    transitions: tuple[Transition, ...]
    """The edges that were taken, in time."""
    termination: Termination
    sentence: str
    """When and how the execution ended, and why, in words."""
    final_time: float
    """When it ended [s]."""
    final_state: Float[np.ndarray, " state"]
    """The state it ended in; in a deadlock at an event, the one right after the jump that no edge allows."""


def execute(
    automaton: HybridAutomaton,
    x0: Sequence[float] | Float[np.ndarray, " state"],
    controller: Callable[[Float[Array, " state"]], Float[Array, " control"]],
    seconds: float,
    control_dt: float = 0.01,
) -> Execution:
    """Execute the automaton from a state, in float64, with the control held over each control step.

    The first moment at which the invariant fails or an event occurs is bisected down to neighbouring
    floating-point numbers, so a boundary that is crossed between two of them counts as crossed. An event
    precedes an invariant that fails at the same moment.

    **Arguments:**

    - `x0`: the plant's state at time 0; it may be in no location: see `termination`.
    - `controller`: a pure function of the state that JAX can trace.
    - `seconds`, `control_dt`: how long to execute, and how long to hold the control [s].

    **Returns:** the `Execution`. Nothing is raised where the automaton is stuck: see `sentence`.
    """
    with jax.enable_x64(True):
        return _Executor(automaton, controller).run(jnp.asarray(x0, jnp.float64), seconds, control_dt)


class _End(Exception):
    """The end of an execution, in this state."""

    def __init__(self, termination: Termination, state: Array, details: str = ""):
        self.termination, self.state, self.details = termination, state, details


class _Look(NamedTuple):
    """Everything that an execution evaluates at a state."""

    x: Float[Array, " state"]
    signals: Float[Array, " signals"]
    guards: tuple[Float[Array, ""], ...]
    """Of each of the plant's events."""
    admissible: tuple[Bool[Array, ""], ...]
    """Whether a zero of each event's guard counts here."""
    fall_margin: Float[Array, ""]


class _Executor:
    """One execution in progress, and its record so far."""

    def __init__(self, automaton: HybridAutomaton, controller: Callable[[Array], Array]):
        self.automaton = automaton
        self.names = tuple(signal.name for signal in automaton.data_variables)
        self.rows: list[tuple[float, Array, str]] = []
        self.transitions: list[Transition] = []
        # At an event that no edge carries, unless it is a touchdown, the plant jumps within its location.
        self.carried = {edge.event for edge in automaton.edges}
        plant = automaton.plant

        def look(x: Array) -> _Look:
            signals = plant.signals(x, self.names)
            guards = tuple(event.guard(x) for event in plant.events)
            admissible = tuple(event.admissible(x) for event in plant.events)
            return _Look(x, signals, guards, admissible, plant.fall_margin(x))

        self.look = jax.jit(look)
        # The lambda hides what jit would hash: a controller may hold arrays.
        self.control = jax.jit(lambda x: controller(x))
        # One compiled step for each distinct activity: the locations of a plant share theirs.
        distinct = {id(activity): activity for activity in automaton.activities.values()}
        self.look_ahead = {
            key: jax.jit(lambda x, u, h, activity=activity: look(rk4(activity, x, u, h)))
            for key, activity in distinct.items()
        }

    def run(self, x: Array, seconds: float, control_dt: float) -> Execution:
        """Execute until the time is up or an `_End` is raised."""
        termination, details = Termination.COMPLETED, ""
        try:
            location = self.start(x)
            self.rows.append((0.0, x, location))
            for step in range(round(seconds / control_dt)):
                x, location = self.control_step(x, location, step * control_dt, control_dt)
        except _End as end:
            x, termination, details = end.state, end.termination, end.details
        times, states, locations = zip(*self.rows, strict=True) if self.rows else ((), (), ())
        time = times[-1] if times else 0.0
        return Execution(
            times=np.array(times, np.float64),
            states=np.array(states, np.float64).reshape(-1, x.size),
            locations=locations,
            transitions=tuple(self.transitions),
            termination=termination,
            sentence=f"t = {time:.4f} s: {termination.sentence} {details}".rstrip(),
            final_time=time,
            final_state=np.asarray(x),
        )

    def start(self, x: Array) -> str:
        """The location of the first state."""
        here = self.look(x)
        possible = [location for location in self.automaton.locations if self.inside(location, here)]
        if not possible:
            raise _End(Termination.START_OUTSIDE, x, f"It is {self.listing(here)}.")
        if len(possible) > 1:
            raise _End(
                Termination.NONDETERMINISM, x, f"{self.listing(here)} is in {' and in '.join(possible)}."
            )
        return possible[0]

    def control_step(self, x: Array, location: str, start: float, duration: float) -> tuple[Array, str]:
        """Flow, with the control held, from one sample to the next, taking whatever edges come."""
        control = self.control(x)
        elapsed, num_transitions = 0.0, 0
        for substep in range(_NUM_SUBSTEPS):
            end = duration * (substep + 1) / _NUM_SUBSTEPS
            while elapsed < end:
                before, armed = x, [bool(guard > 0) for guard in self.look(x).guards]
                look_ahead = partial(
                    self.look_ahead[id(self.automaton.activities[location])], before, control
                )
                h = _first(partial(self.happens, look_ahead, armed, location), end - elapsed)
                ahead = look_ahead(h)
                x, elapsed = ahead.x, end if h == end - elapsed else elapsed + h
                if not jnp.all(jnp.isfinite(x)):
                    raise _End(Termination.NOT_FINITE, before)
                self.rows.append((start + elapsed, x, location))
                event = self.event_at(ahead, armed)
                if self.falls(ahead) and event is None:
                    raise _End(Termination.FELL, x)
                if event is not None and not event.restarts_clock and event.name not in self.carried:
                    x = event.reset(x)
                    self.rows.append((start + elapsed, x, location))
                    num_transitions += 1
                elif event is not None or not self.inside(location, ahead):
                    x, location = self.take_edge(x, location, None if event is None else event.name)
                    num_transitions += 1
                if num_transitions > _MAX_TRANSITIONS_IN_A_STEP:
                    raise _End(Termination.ZENO, x, f"There were {num_transitions} within {elapsed:.3g} s.")
        return x, location

    def take_edge(self, x: Array, location: str, event: str | None) -> tuple[Array, str]:
        """The state and the location after the one edge that can be taken."""
        edges = [edge for edge in self.automaton.edges if (edge.source, edge.event) == (location, event)]
        after = {edge: self.look(self.automaton.resets[edge](x)) for edge in edges}
        possible = [edge for edge in edges if self.inside(edge.target, after[edge])]
        occasion = f"On {event} in {location}" if event else f"Leaving {location}"
        if len(possible) > 1:
            ways = " and ".join(map(str, possible))
            raise _End(Termination.NONDETERMINISM, x, f"{occasion} at {self.listing(self.look(x))}: {ways}.")
        if not possible:
            end = after[edges[0]] if len(edges) == 1 else self.look(x)
            needs = [f"{edge} needs {self.missing(edge.target, after[edge])}" for edge in edges]
            why = "; ".join(needs) or "there is no edge for that"
            raise _End(Termination.DEADLOCK, end.x, f"{occasion} the state is {self.listing(end)}: {why}.")
        (edge,) = possible
        time = self.rows[-1][0]
        self.transitions.append(Transition(time, edge))
        self.rows.append((time, after[edge].x, edge.target))
        return after[edge].x, edge.target

    def happens(
        self, look_ahead: Callable[[float], _Look], armed: Sequence[bool], location: str, h: float
    ) -> bool:
        """Whether within h an event happens, the plant falls, or it leaves the location."""
        ahead = look_ahead(h)
        happened = self.event_at(ahead, armed) is not None or self.falls(ahead)
        return happened or not self.inside(location, ahead)

    def event_at(self, ahead: _Look, armed: Sequence[bool]) -> Event | None:
        """The plant's first event whose guard has fallen through zero at an admissible state."""
        happened = zip(self.automaton.plant.events, armed, ahead.guards, ahead.admissible, strict=True)
        return next(
            (event for event, rose, guard, counts in happened if rose and guard <= 0 and counts), None
        )

    def falls(self, ahead: _Look) -> bool:
        """Whether the plant has fallen."""
        return bool(ahead.fall_margin <= 0)

    def inside(self, location: str, here: _Look) -> bool:
        """Whether μ₂ of a location holds; where a signal is NaN, none does."""
        values = self.values(here)
        return not any(map(math.isnan, values.values())) and holds(
            self.automaton.invariants[location], values
        )

    def missing(self, location: str, here: _Look) -> str:
        """What of a location's invariant does not hold."""
        predicate, values = self.automaton.invariants[location], self.values(here)
        parts: Sequence[Predicate] = predicate.parts if isinstance(predicate, All) else (predicate,)
        return " and ".join(_spelt_out(part) for part in parts if not holds(part, values))

    def values(self, here: _Look) -> dict[str, float]:
        """The data variables by name."""
        return dict(zip(self.names, np.asarray(here.signals).tolist(), strict=True))

    def listing(self, here: _Look) -> str:
        """The data variables as text."""
        return "(" + ", ".join(f"{name} = {value:.4g}" for name, value in self.values(here).items()) + ")"


def _first(happens: Callable[[float], bool], end: float) -> float:
    """The first moment in (0, end] at which something that had not happened at 0 has, or else the end."""
    if not happens(end):
        return end
    before, after = 0.0, end
    while before < (middle := (before + after) / 2) < after:
        before, after = (before, middle) if happens(middle) else (middle, after)
    return after


def _spelt_out(part: Predicate) -> str:
    """A predicate as it is written, and its comparisons where it is written in phrases."""
    numbers = " and ".join(map(str, conjuncts(part)))
    return f"{part} ({numbers})" if phrases_of(part) else str(part)
