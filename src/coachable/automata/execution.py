"""Execution of a hybrid automaton: it flows in a location until its invariant fails or an event occurs.

Events are those of a simulation: both find them with `next_event`.
"""

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

from coachable.automata.hybrid import Flow, HybridAutomaton
from coachable.behaviours.behaviour import Edge
from coachable.behaviours.predicates import All, Predicate, holds, phrases_of
from coachable.behaviours.rewriting import conjuncts
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.plants.event_search import Segment, is_on_guard, next_event
from coachable.plants.runge_kutta import rk4
from coachable.plants.sampled import require_few_steps

_SUBSTEP = 2.5e-3
"""The longest Runge–Kutta step [s]."""

_LEAST_SUBSTEPS = 4
"""Of a control step."""

_MAX_TRANSITIONS_IN_A_STEP = 100

_SAME_MOMENT = 1e-9
"""An event and an invariant that fails this share of a control step before it are simultaneous."""

_AT_REST = 1e-8
"""A guard that changes so slowly [1/s] does not, whatever rounding does."""

_ROUNDING = 1e-12
"""A guard that is found to be zero is so far from it at most."""


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

    Events are located as in a simulation, by `next_event`. So are two crossings of a guard within a substep
    of at most 2.5 ms: where a guard has a minimum inside the substep, it is looked at there. The first moment
    at which the invariant fails is bisected down to neighbouring floating-point numbers; an event precedes an
    invariant that fails at the same moment. An invariant that fails and holds again within a substep is not
    noticed. The last control step is shorter where `seconds` is no multiple of `control_dt`.

    **Arguments:**

    - `x0`: the plant's state at time 0; it may be in no location: see `termination`.
    - `controller`: a pure function of the state that JAX can trace.
    - `seconds`, `control_dt`: how long to execute, and how long to hold the control [s].

    **Returns:** the `Execution`. Nothing is raised where the automaton is stuck: see `sentence`.

    **Raises:** `ParameterError` for a negative time, a `control_dt` that is not positive, and for more than a
    billion control steps.
    """
    real_number(seconds, "seconds", ParameterError, least=0.0)
    real_number(control_dt, "control_dt", ParameterError, above=0.0)
    require_few_steps(seconds, control_dt)
    with jax.enable_x64(True):
        return _Executor(automaton, controller).run(jnp.asarray(x0, jnp.float64), seconds, control_dt)


class _End(Exception):
    """The end of an execution, in this state."""

    def __init__(self, termination: Termination, state: Array, details: str = ""):
        self.termination, self.state, self.details = termination, state, details


class _Look(NamedTuple):
    """Everything that an execution evaluates at a state."""

    x: Float[Array, " state"]
    admissible: tuple[Bool[Array, ""], ...]
    """Whether a zero of each event's guard counts here."""
    on_guard: tuple[Bool[Array, ""], ...]
    """Whether each event's guard is zero here, whatever rounding does."""
    guards: tuple[Float[Array, ""], ...]
    """Of each of the plant's events and, last, the fall margin."""
    slopes: tuple[Float[Array, ""], ...]
    """Their time derivatives."""


class _At(NamedTuple):
    """Where an execution stands."""

    x: Float[Array, " state"]
    location: str
    on_guard: tuple[Bool[Array, ""], ...]
    """Of each event whether x is on its guard, after a jump that left it there."""
    pending: tuple[Bool[Array, ""], ...]
    """Of each event whether it is due at once, if its guard still falls."""


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
        self.no = (jnp.array(False),) * len(plant.events)

        def look(activity: Flow, x: Array, control: Array) -> _Look:
            functions = (*(event.guard for event in plant.events), plant.fall_margin)
            rates = [jax.jvp(function, (x,), (activity(x, control),)) for function in functions]
            return _Look(
                x,
                tuple(event.admissible(x) for event in plant.events),
                tuple(is_on_guard(event, x) for event in plant.events),
                *zip(*rates, strict=True),
            )

        # The lambda hides what jit would hash: a controller may hold arrays.
        self.control = jax.jit(lambda x: controller(x))
        self.signals = jax.jit(lambda x: plant.signals(x, self.names))
        # One compiled step for each distinct activity: the locations of a plant share theirs.
        distinct = {id(activity): activity for activity in automaton.activities.values()}
        self.look_ahead = {
            key: jax.jit(lambda x, u, h, activity=activity: look(activity, rk4(activity, x, u, h), u))
            for key, activity in distinct.items()
        }
        self.next_event = {
            key: jax.jit(lambda *given, activity=activity: next_event(plant, activity, *given))
            for key, activity in distinct.items()
        }

    def run(self, x: Array, seconds: float, control_dt: float) -> Execution:
        """Execute until the time is up or an `_End` is raised."""
        termination, details = Termination.COMPLETED, ""
        try:
            at = self.start(x)
            self.rows.append((0.0, x, at.location))
            num_full = math.floor(seconds / control_dt * (1 + _SAME_MOMENT) + _SAME_MOMENT)
            for step in range(num_full):
                at = self.control_step(at, step * control_dt, control_dt)
            if (rest := seconds - num_full * control_dt) > _SAME_MOMENT * control_dt:
                at = self.control_step(at, num_full * control_dt, rest)
            x = at.x
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

    def start(self, x: Array) -> _At:
        """Where the execution begins."""
        possible = [location for location in self.automaton.locations if self.inside(location, x)]
        if not possible:
            raise _End(Termination.START_OUTSIDE, x, f"It is {self.listing(x)}.")
        if len(possible) > 1:
            raise _End(Termination.NONDETERMINISM, x, f"{self.listing(x)} is in {' and in '.join(possible)}.")
        events = self.automaton.plant.events
        on_guard = tuple(is_on_guard(event, x) for event in events)
        due = tuple(near & event.admissible(x) for near, event in zip(on_guard, events, strict=True))
        return _At(x, possible[0], on_guard, due)

    def control_step(self, at: _At, start: float, duration: float) -> _At:
        """Flow, with the control held, from one sample to the next, taking whatever edges come."""
        control = self.control(at.x)
        elapsed, num_transitions = 0.0, 0
        num_substeps = max(_LEAST_SUBSTEPS, math.ceil(duration / _SUBSTEP - _SAME_MOMENT))
        for substep in range(num_substeps):
            end = duration * (substep + 1) / num_substeps
            while elapsed < end:
                look_ahead = partial(self.look_ahead[self.activity(at.location)], at.x, control)
                h, found = self.segment(at, control, look_ahead, end - elapsed)
                if not found.finite:
                    raise _End(Termination.NOT_FINITE, at.x)
                ends = bool(found.jumped | found.fell)
                tau = float(found.tau) if ends else h
                x, leaves = (found.x_event if ends else found.x_end), False
                if not self.inside(at.location, x):
                    left_at = _first(partial(self.leaves, at.location, look_ahead), tau)
                    leaves = not ends or left_at < tau - _SAME_MOMENT * duration
                    if leaves and left_at < tau:
                        tau, x, ends = left_at, look_ahead(left_at).x, False
                if not (ends or leaves):
                    self.require_above_guards(at, look_ahead(0.0), look_ahead(tau))
                elapsed = end if tau == end - elapsed else elapsed + tau
                self.rows.append((start + elapsed, x, at.location))
                if ends and found.fell:
                    raise _End(Termination.FELL, x)
                if ends or leaves:
                    at = self.jump(at, x, found if ends else None, control)
                    num_transitions += 1
                else:
                    at = _At(x, at.location, self.no, self.no)
                if num_transitions > _MAX_TRANSITIONS_IN_A_STEP:
                    raise _End(
                        Termination.ZENO, at.x, f"There were {num_transitions} within {elapsed:.3g} s."
                    )
        return at

    def segment(
        self, at: _At, control: Array, look_ahead: Callable[[float], _Look], h: float
    ) -> tuple[float, Segment]:
        """The first event or fall within h, or within a part of h that ends where a guard is lowest."""
        search = self.next_event[self.activity(at.location)]
        found = search(at.x, control, h, at.on_guard, at.pending)
        if found.jumped | found.fell | ~found.finite:
            return h, found
        before, after = look_ahead(0.0), look_ahead(h)
        lowest = h
        for number, (falls, rises) in enumerate(zip(before.slopes, after.slopes, strict=True)):
            if falls < 0 < rises and before.guards[number] > 0:
                bottom = _first(lambda t, number=number: bool(look_ahead(t).slopes[number] >= 0), h)
                if bottom < lowest and look_ahead(bottom).guards[number] <= 0:
                    lowest = bottom
        return (h, found) if lowest == h else (lowest, search(at.x, control, lowest, at.on_guard, at.pending))

    def require_above_guards(self, at: _At, before: _Look, after: _Look) -> None:
        """Raise an `_End` where a jump left x at rest on a guard, or just above it, and it sinks below it.

        A guard that is zero and falls on right after its event is a surface to be passed, such as a switch.
        """
        for number, event in enumerate(self.automaton.plant.events):
            guard, slope = float(before.guards[number]), float(before.slopes[number])
            stays = abs(slope) <= _AT_REST or guard > _ROUNDING
            sinks = after.guards[number] < min(guard, 0.0)
            if event.can_repeat and at.on_guard[number] and after.admissible[number] and stays and sinks:
                raise _End(Termination.ZENO, at.x, f"After {event.name} it stays on its guard.")

    def jump(self, at: _At, x: Array, found: Segment | None, control: Array) -> _At:
        """Where the execution stands after an event or, where there is none, after leaving its location."""
        event = None if found is None else self.automaton.plant.events[int(found.which)]
        location = at.location
        if event is not None and not event.restarts_clock and event.name not in self.carried:
            x = event.reset(x)
            self.rows.append((self.rows[-1][0], x, location))
        else:
            x, location = self.take_edge(x, location, None if event is None else event.name)
        on_guard = self.look_ahead[self.activity(location)](x, control, 0.0).on_guard
        if found is None:
            on_guard = tuple(was & near for was, near in zip(at.on_guard, on_guard, strict=True))
        pending = at.pending if found is None else found.pending or self.no
        return _At(x, location, on_guard, tuple(map(jnp.logical_and, pending, on_guard)))

    def take_edge(self, x: Array, location: str, event: str | None) -> tuple[Array, str]:
        """The state and the location after the one edge that can be taken."""
        edges = [edge for edge in self.automaton.edges if (edge.source, edge.event) == (location, event)]
        after = {edge: self.automaton.resets[edge](x) for edge in edges}
        possible = [edge for edge in edges if self.inside(edge.target, after[edge])]
        occasion = f"On {event} in {location}" if event else f"Leaving {location}"
        if len(possible) > 1:
            ways = " and ".join(map(str, possible))
            raise _End(Termination.NONDETERMINISM, x, f"{occasion} at {self.listing(x)}: {ways}.")
        if not possible:
            end = after[edges[0]] if len(edges) == 1 else x
            needs = [f"{edge} needs {self.missing(edge.target, after[edge])}" for edge in edges]
            why = "; ".join(needs) or "there is no edge for that"
            raise _End(Termination.DEADLOCK, end, f"{occasion} the state is {self.listing(end)}: {why}.")
        (edge,) = possible
        time = self.rows[-1][0]
        self.transitions.append(Transition(time, edge))
        self.rows.append((time, after[edge], edge.target))
        return after[edge], edge.target

    def activity(self, location: str) -> int:
        """The key of a location's compiled functions."""
        return id(self.automaton.activities[location])

    def leaves(self, location: str, look_ahead: Callable[[float], _Look], h: float) -> bool:
        """Whether the flow has left the location after h."""
        return not self.inside(location, look_ahead(h).x)

    def inside(self, location: str, x: Array) -> bool:
        """Whether μ₂ of a location holds; where a signal is NaN, none does."""
        values = self.values(x)
        return not any(map(math.isnan, values.values())) and holds(
            self.automaton.invariants[location], values
        )

    def missing(self, location: str, x: Array) -> str:
        """What of a location's invariant does not hold."""
        predicate, values = self.automaton.invariants[location], self.values(x)
        parts: Sequence[Predicate] = predicate.parts if isinstance(predicate, All) else (predicate,)
        return " and ".join(_spelt_out(part) for part in parts if not holds(part, values))

    def values(self, x: Array) -> dict[str, float]:
        """The data variables by name."""
        return dict(zip(self.names, np.asarray(self.signals(x)).tolist(), strict=True))

    def listing(self, x: Array) -> str:
        """The data variables as text."""
        return "(" + ", ".join(f"{name} = {value:.4g}" for name, value in self.values(x).items()) + ")"


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
