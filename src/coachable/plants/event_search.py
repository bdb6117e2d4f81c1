"""Integrate through events and falls: smooth segments, each ended where a guard falls through zero.

`next_event` is the one event logic: simulation and execution of a hybrid automaton both go from event to
event with it.

- *Admissible*: a guard that falls through zero where the event is not admissible has passed: it must rise
  above zero before it can fall through it again, even if the event becomes admissible meanwhile.
- *Grazing*: a guard that touches zero and rises again happens if it is found at or below zero.
- *Re-entrant*: a guard that a reset left at zero happens again only if it rises first.
- *Simultaneous*: of events at the same moment the first in the plant's order happens; each of the others
  follows at once if its guard is still at zero and still falling after the reset.
- *Zeno*: events that pile up are chatter in a simulation, and end an execution.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.plants.outcome import Outcome
from coachable.plants.plant import Dynamics, Event
from coachable.plants.runge_kutta import rk4

Tree = TypeVar("Tree")

NUM_POLISHINGS = 2
"""Newton steps for an event's time. The parabola that they start from is off by some 1e-5 of a step."""

MAX_TOUCHDOWNS = 64
"""So many touchdowns, or other events, in one control step are chatter: they may pile up without end."""


@dataclass(frozen=True)
class ChatterRule:
    """How many touchdowns are too many: then the episode ends."""

    max_touchdowns: int | None = 2
    """One touchdown more than these is chatter; `None` for any number."""
    min_gap: float | None = None
    """A further touchdown is chatter if it comes at most this long after the step's first one [s]."""


PAPER_CHATTER = ChatterRule()
"""A third touchdown within one control step is chatter."""


class Progress(eqx.Module):
    """Where the integration of one control step stands. Times count from its start."""

    x: Float[Array, " state"]
    foot_x: Float[Array, ""]
    done: Bool[Array, ""]
    outcome: Int[Array, ""]
    time: Float[Array, ""]
    """When the walker is at `x`."""
    substep: Int[Array, ""]
    """How many substeps are complete."""
    on_guard: tuple[Bool[Array, ""], ...]
    """Of each event whether x is on its guard, right after a reset, whatever rounding does."""
    pending: tuple[Bool[Array, ""], ...]
    """Of each event whether it is due now, at the moment of the one before; empty for a single event."""
    others: Int[Array, ""] | None
    """Events so far that were no touchdowns; `None` where the plant has none of that kind."""
    touchdowns: Int[Array, ""]
    first_touchdown: Float[Array, ""]
    last_touchdown: Float[Array, ""]
    segment_x: Float[Array, " state"]
    """State right after the last touchdown."""
    segment_foot_x: Float[Array, ""]


def standing_at(
    plant: Dynamics, x: Float[Array, " state"], foot_x: Float[Array, ""], done: Bool[Array, ""]
) -> Progress:
    """Return the progress of a control step that has just begun at x, or is all done there."""
    zero, count, no = jnp.zeros((), x.dtype), jnp.zeros((), jnp.int32), jnp.zeros((), bool)
    return Progress(
        x=x,
        foot_x=foot_x,
        done=done,
        outcome=count,
        time=zero,
        substep=count,
        on_guard=(no,) * len(plant.events),
        pending=(no,) * len(plant.events) if len(plant.events) > 1 else (),
        others=None if all(event.restarts_clock for event in plant.events) else count,
        touchdowns=count,
        first_touchdown=zero,
        last_touchdown=zero + jnp.nan,
        segment_x=x,
        segment_foot_x=foot_x,
    )


class Segment(eqx.Module):
    """The flow from a state until an event, a fall, or the end of a time h."""

    x_end: Float[Array, " state"]
    """After h, as if nothing happened."""
    finite: Bool[Array, ""]
    """Whether it is finite."""
    tau: Float[Array, ""]
    """When a guard or the fall margin falls through zero [s]; h if none does."""
    x_event: Float[Array, " state"]
    """The state then, before any jump."""
    fell: Bool[Array, ""]
    """Whether the segment ends there with a fall."""
    jumped: Bool[Array, ""]
    """Whether the segment ends there with an event; if it neither fell nor jumped, it lasts for h."""
    which: Int[Array, ""] | int
    """The number of the event."""
    pending: tuple[Bool[Array, ""], ...]
    """Of each event whether it could have happened instead; empty for a single event."""


def next_event(
    plant: Dynamics,
    flow: Callable[[Array, Array], Array],
    x: Float[Array, " state"],
    control: Float[Array, " control"],
    h: Float[Array, ""],
    on_guard: tuple[Bool[Array, ""], ...],
    pending: tuple[Bool[Array, ""], ...],
) -> Segment:
    """Return the first event or fall within h.

    A Runge–Kutta trial over h shows which guards fall through zero. The time τ is where a parabola, through
    the guard's value and slope at the start and its value at the trial's end, falls through zero, polished by
    Newton steps τ ← τ − g / ġ on the Runge–Kutta solution itself. Of several events the earliest happens. A
    guard that crosses zero twice within h is not seen here.

    **Arguments:** `flow`: ẋ in terms of state and control; `on_guard`, `pending`: as in `Progress`.
    """
    events = plant.events

    def slopes(x: Array) -> list[tuple[Array, Array]]:
        """(value, time derivative) of each event's guard and, last, of the fall margin."""
        velocity = flow(x, control)
        functions = (*(event.guard for event in events), plant.fall_margin)
        return [jax.jvp(function, (x,), (velocity,)) for function in functions]

    x_end = rk4(flow, x, control, h)
    finite = jnp.all(jnp.isfinite(x_end))

    *guards, (margin, margin_slope) = slopes(x)
    guard_ends = [event.guard(x_end) for event in events]
    margin_end = plant.fall_margin(x_end)
    could_happen, happens, event_at = [], [], []
    for number, (event, (guard, slope), guard_end, on_it) in enumerate(
        zip(events, guards, guard_ends, on_guard, strict=True)
    ):
        # A guard that is zero, as after a reset, can only fall through zero again if it rises first.
        guard = jnp.where(on_it, 0, guard)
        armed = (guard > 0) | (on_it & (slope > 0) & event.can_repeat)
        if pending:
            armed |= pending[number] & (slope < 0)
        armed &= event.admissible(x_end) | event.admissible(x)
        could_happen.append(armed)
        happens.append(armed & (guard_end <= 0))
        event_at.append(_falling_root(guard, h * slope, guard_end))
    falls = margin_end <= 0
    jumps, jump_at, which = _earliest(happens, event_at)
    fall_at = _falling_root(jnp.maximum(margin, 0), h * margin_slope, margin_end)
    falls &= ~jumps | (fall_at < jump_at)
    ends = (jumps | falls) & finite
    tau = h * jnp.where(ends, jnp.clip(jnp.where(falls, fall_at, jump_at), 0, 1), 1)
    # The barriers make XLA compute what stands here once, not again, with its sines, in each of its uses.
    x_end, tau, ends, falls = lax.optimization_barrier((x_end, tau, ends, falls))
    for _ in range(NUM_POLISHINGS):
        *at_events, at_fall = slopes(rk4(flow, x, control, tau))
        at_event = _chosen(which, at_events, at_fall)
        value, slope = (jnp.where(falls, *pair) for pair in zip(at_fall, at_event, strict=True))
        polished = jnp.clip(tau - value / jnp.where(slope < 0, slope, -jnp.inf), 0, h)
        tau = lax.optimization_barrier(jnp.where(ends, polished, tau))
    x_event = lax.optimization_barrier(rk4(flow, x, control, tau))

    return Segment(
        x_end=x_end,
        finite=finite,
        tau=tau,
        x_event=x_event,
        fell=ends & falls,
        jumped=ends
        & ~falls
        & _chosen(which, [event.admissible(x_event) for event in events], jnp.array(False)),
        which=which,
        pending=tuple(armed & (which != number) for number, armed in enumerate(could_happen))
        if pending
        else (),
    )


def is_on_guard(event: Event, x: Float[Array, " state"]) -> Bool[Array, ""]:
    """Whether x is on the guard of an event, whatever rounding does."""
    return jnp.abs(event.guard(x)) <= jnp.finfo(x.dtype).eps ** 0.5


def integrate_through_events(
    plant: Dynamics,
    start: Progress,
    control: Float[Array, " control"],
    duration: Float[Array, ""] | float,
    num_substeps: int,
    stop_at_touchdown: bool,
    touchdowns_before: Int[Array, ""] | int,
    chatter: ChatterRule,
) -> Progress:
    """Return where one control step ends; see `advance` for the arguments.

    Every pass of the loop is one smooth segment, to the end of the substep or to an event: see `next_event`.
    Its reset map is applied, and the rest of the substep is the next pass.
    """

    events = plant.events

    def segment(now: Progress) -> Progress:
        substep_end = (now.substep + 1).astype(now.x.dtype) * (duration / num_substeps)
        h = jnp.maximum(substep_end - now.time, 0)
        found = next_event(plant, plant.flow, now.x, control, h, now.on_guard, now.pending)
        x_end, finite, tau, x_event = found.x_end, found.finite, found.tau, found.x_event
        fell, jumped, which = found.fell, found.jumped, found.which
        touched = jumped
        if now.others is not None:
            touched &= _chosen(which, [jnp.array(event.restarts_clock) for event in events], jnp.array(False))
        ended_early = fell | jumped
        time = jnp.where(ended_early, now.time + tau, substep_end)
        after = _chosen(which, [event.reset(x_event) for event in events], x_event)
        x = jnp.where(ended_early, jnp.where(jumped, after, x_event), x_end)
        moved = _chosen(which, [event.displacement(x_event) for event in events], jnp.zeros_like(now.foot_x))
        foot_x = now.foot_x + jnp.where(jumped, moved, 0)
        on_guard = tuple(jumped & is_on_guard(event, x) for event in events)
        pending = tuple(due & near for due, near in zip(found.pending, on_guard, strict=False))

        first_touchdown = jnp.where(touched & (now.touchdowns == 0), time, now.first_touchdown)
        chattered = touched & (now.touchdowns + 1 >= MAX_TOUCHDOWNS)
        others = now.others
        if others is not None:
            others = others + (jumped & ~touched)
            chattered |= others >= MAX_TOUCHDOWNS
        if chatter.max_touchdowns is not None:
            chattered |= touched & (touchdowns_before + now.touchdowns >= chatter.max_touchdowns)
        if chatter.min_gap is not None:
            chattered |= touched & (now.touchdowns > 0) & (time - first_touchdown <= chatter.min_gap)
        outcome = jnp.where(chattered, Outcome.CHATTERED, Outcome.WALKING)
        outcome = jnp.where(fell, Outcome.FELL, outcome)
        outcome = jnp.where(finite, outcome, Outcome.NOT_FINITE).astype(jnp.int32)
        substep = now.substep + ~ended_early
        done = (outcome != Outcome.WALKING) | (substep >= num_substeps) | (touched & stop_at_touchdown)
        return Progress(
            x=jnp.where(finite, x, now.x),
            foot_x=foot_x,
            done=done,
            outcome=outcome,
            time=time,
            substep=substep,
            on_guard=on_guard,
            pending=pending,
            others=others,
            touchdowns=now.touchdowns + touched,
            first_touchdown=first_touchdown,
            last_touchdown=jnp.where(touched, time, now.last_touchdown),
            segment_x=jnp.where(touched, x, now.segment_x),
            segment_foot_x=jnp.where(touched, foot_x, now.segment_foot_x),
        )

    return lax.while_loop(lambda now: ~now.done, segment, start)


def _earliest(happens: list[Array], at: list[Array]) -> tuple[Array, Array, Array | int]:
    """Whether any event happens, where the earliest does, and its number."""
    if not happens:
        return jnp.array(False), jnp.array(jnp.inf), 0
    any_happens, earliest, which = happens[0], at[0], 0
    for number in range(1, len(happens)):
        sooner = happens[number] & (~any_happens | (at[number] < earliest))
        earliest, which = jnp.where(sooner, at[number], earliest), jnp.where(sooner, number, which)
        any_happens |= happens[number]
    return any_happens, earliest, which if len(happens) == 1 else lax.optimization_barrier(which)


def _chosen(which: Array | int, values: Sequence[Tree], default: Tree) -> Tree:
    """The value of the event that happens; the default for a plant without events."""
    chosen = values[0] if values else default
    for number in range(1, len(values)):
        chosen = jax.tree.map(partial(jnp.where, which == number), values[number], chosen)
    return chosen


def _falling_root(
    start: Float[Array, ""], slope: Float[Array, ""], end: Float[Array, ""]
) -> Float[Array, ""]:
    """Return where the parabola with p(0) = start ≥ 0, p'(0) = slope, p(1) = end falls through zero, or ∞."""
    curvature = end - start - slope
    root = jnp.sqrt(slope**2 - 4 * curvature * start)
    # Two equal forms of one root, each without cancellation on its own side.
    at = jnp.where(slope > 0, (slope + root) / (-2 * curvature), 2 * start / (root - slope))
    return jnp.where(at >= 0, at, jnp.inf)
