"""Integrate through touchdowns and falls: smooth segments, each ended where a guard falls through zero."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.plants.outcome import Outcome
from coachable.plants.plant import HybridSystem
from coachable.plants.runge_kutta import rk4

NUM_POLISHINGS = 2
"""Newton steps for an event's time. The parabola that they start from is off by some 1e-5 of a step."""

MAX_TOUCHDOWNS = 64
"""So many touchdowns in one control step are chatter under any rule: they may pile up without end."""


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
    on_guard: Bool[Array, ""]
    """Whether x is on the guard, right after an impact, whatever rounding says."""
    touchdowns: Int[Array, ""]
    first_touchdown: Float[Array, ""]
    last_touchdown: Float[Array, ""]
    segment_x: Float[Array, " state"]
    """State right after the last touchdown."""
    segment_foot_x: Float[Array, ""]


def standing_at(x: Float[Array, " state"], foot_x: Float[Array, ""], done: Bool[Array, ""]) -> Progress:
    """Return the progress of a control step that has just begun at x, or is all done there."""
    zero, count, no = jnp.zeros((), x.dtype), jnp.zeros((), jnp.int32), jnp.zeros((), bool)
    return Progress(
        x=x,
        foot_x=foot_x,
        done=done,
        outcome=count,
        time=zero,
        substep=count,
        on_guard=no,
        touchdowns=count,
        first_touchdown=zero,
        last_touchdown=zero + jnp.nan,
        segment_x=x,
        segment_foot_x=foot_x,
    )


def integrate_through_events(
    plant: HybridSystem,
    start: Progress,
    control: Float[Array, " control"],
    duration: float,
    num_substeps: int,
    stop_at_touchdown: bool,
    touchdowns_before: Int[Array, ""] | int,
    chatter: ChatterRule,
) -> Progress:
    """Return where one control step ends; see `advance` for the arguments.

    Every pass of the loop is one smooth segment: a Runge–Kutta trial to the end of the substep and, if that
    crosses an event, one that ends there. The event's time τ is where a parabola, through the guard's value
    and slope at the start and its value at the trial's end, falls through zero, polished by Newton steps
    τ ← τ − g / ġ on the Runge–Kutta solution itself. At a touchdown the impact is applied, and the rest of
    the substep is the next pass.
    """

    def slopes(x: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """(value, time derivative) of the guard and of the fall margin."""
        velocity = plant.flow(x, control)
        return jax.jvp(plant.guard, (x,), (velocity,)), jax.jvp(plant.fall_margin, (x,), (velocity,))

    def segment(now: Progress) -> Progress:
        substep_end = (now.substep + 1).astype(now.x.dtype) * (duration / num_substeps)
        h = jnp.maximum(substep_end - now.time, 0)
        x_end = rk4(plant.flow, now.x, control, h)
        finite = jnp.all(jnp.isfinite(x_end))

        (guard, guard_slope), (margin, margin_slope) = slopes(now.x)
        guard_end, margin_end = plant.guard(x_end), plant.fall_margin(x_end)
        # A guard that is zero, as after an impact, can only fall through zero again if it rises first.
        guard = jnp.where(now.on_guard, 0, guard)
        armed = (guard > 0) | (now.on_guard & (guard_slope > 0) & plant.can_bounce)
        armed &= plant.can_touch_down(x_end) | plant.can_touch_down(now.x)
        comes_down, falls = armed & (guard_end <= 0), margin_end <= 0
        touchdown_at = _falling_root(guard, h * guard_slope, guard_end)
        fall_at = _falling_root(jnp.maximum(margin, 0), h * margin_slope, margin_end)
        falls &= ~comes_down | (fall_at < touchdown_at)
        event = (comes_down | falls) & finite
        tau = h * jnp.where(event, jnp.clip(jnp.where(falls, fall_at, touchdown_at), 0, 1), 1)
        # The barriers make XLA compute what stands here once, not again, with its sines, in each of its uses.
        x_end, tau, event, falls = lax.optimization_barrier((x_end, tau, event, falls))
        for _ in range(NUM_POLISHINGS):
            at_touchdown, at_fall = slopes(rk4(plant.flow, now.x, control, tau))
            value, slope = (jnp.where(falls, *pair) for pair in zip(at_fall, at_touchdown, strict=True))
            polished = jnp.clip(tau - value / jnp.where(slope < 0, slope, -jnp.inf), 0, h)
            tau = lax.optimization_barrier(jnp.where(event, polished, tau))
        x_event = lax.optimization_barrier(rk4(plant.flow, now.x, control, tau))

        fell = event & falls
        touched = event & ~falls & plant.can_touch_down(x_event)
        ended_early = fell | touched
        time = jnp.where(ended_early, now.time + tau, substep_end)
        x = jnp.where(ended_early, jnp.where(touched, plant.impact(x_event), x_event), x_end)
        foot_x = now.foot_x + jnp.where(touched, plant.step_length(x_event), 0)
        on_guard = touched & (jnp.abs(plant.guard(x)) <= jnp.finfo(x.dtype).eps ** 0.5)

        first_touchdown = jnp.where(touched & (now.touchdowns == 0), time, now.first_touchdown)
        chattered = touched & (now.touchdowns + 1 >= MAX_TOUCHDOWNS)
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
            touchdowns=now.touchdowns + touched,
            first_touchdown=first_touchdown,
            last_touchdown=jnp.where(touched, time, now.last_touchdown),
            segment_x=jnp.where(touched, x, now.segment_x),
            segment_foot_x=jnp.where(touched, foot_x, now.segment_foot_x),
        )

    return lax.while_loop(lambda now: ~now.done, segment, start)


def _falling_root(
    start: Float[Array, ""], slope: Float[Array, ""], end: Float[Array, ""]
) -> Float[Array, ""]:
    """Return where the parabola with p(0) = start ≥ 0, p'(0) = slope, p(1) = end falls through zero, or ∞."""
    curvature = end - start - slope
    root = jnp.sqrt(slope**2 - 4 * curvature * start)
    # Two equal forms of one root, each without cancellation on its own side.
    at = jnp.where(slope > 0, (slope + root) / (-2 * curvature), 2 * start / (root - slope))
    return jnp.where(at >= 0, at, jnp.inf)
