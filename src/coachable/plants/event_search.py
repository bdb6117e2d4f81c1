"""Integrate through touchdowns and falls: smooth segments, each ended where a guard falls through zero."""

from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.plants.hybrid_system import HybridSystem
from coachable.plants.outcome import Outcome
from coachable.plants.runge_kutta import rk4

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
    time: Float[Array, ""]
    """When the walker is at `x`."""
    outcome: Int[Array, ""]
    stopped: Bool[Array, ""]
    """Whether nothing more happens in this control step."""
    on_guard: Bool[Array, ""]
    """Whether x is on the guard, right after an impact, whatever rounding says."""
    touchdowns: Int[Array, ""]
    first_touchdown: Float[Array, ""]
    last_touchdown: Float[Array, ""]
    segment_x: Float[Array, " state"]
    """State right after the last touchdown, or where the step began."""
    segment_foot_x: Float[Array, ""]


def at_the_start(x: Float[Array, " state"], foot_x: Float[Array, ""]) -> Progress:
    """Return the progress of a control step that is about to begin at x."""
    zero, count, no = jnp.zeros((), x.dtype), jnp.zeros((), jnp.int32), jnp.zeros((), bool)
    return Progress(
        x=x,
        foot_x=foot_x,
        time=zero,
        outcome=count,
        stopped=no,
        on_guard=no,
        touchdowns=count,
        first_touchdown=zero,
        last_touchdown=zero + jnp.nan,
        segment_x=x,
        segment_foot_x=foot_x,
    )


class Trial(eqx.Module):
    """A Runge–Kutta step from where the walker is to the end of the substep, as if nothing happened there."""

    x: Float[Array, " state"]
    comes_down: Bool[Array, ""]
    falls: Bool[Array, ""]
    finite: Bool[Array, ""]


def integrate_substep(
    plant: HybridSystem,
    start: Progress,
    control: Float[Array, " control"],
    substep_end: Float[Array, ""],
    h: Float[Array, ""],
    stop_at_touchdown: bool,
    touchdowns_before: Int[Array, ""] | int,
    chatter: ChatterRule,
) -> Progress:
    """Return where one substep of length h ends; see `advance` for the other arguments.

    Most substeps are one smooth trial. Where that crosses an event, a pass of the loop goes to the event and
    tries the rest. The event's time τ is where a parabola, through the guard's value and slope at the start
    and its value at the trial's end, falls through zero, polished by Newton steps τ ← τ − g / ġ on the
    Runge–Kutta solution itself. Under vmap a pass is for the whole batch.
    """

    def slopes(x: Array) -> tuple[Array, tuple[Array, Array], tuple[Array, Array]]:
        """The state's time derivative, and (value, time derivative) of the guard and of the fall margin."""
        velocity = plant.flow(x, control)
        return (
            velocity,
            jax.jvp(plant.guard, (x,), (velocity,)),
            jax.jvp(plant.fall_margin, (x,), (velocity,)),
        )

    def attempt(now: Progress, h: Array) -> Trial:
        x_end = rk4(plant.flow, now.x, control, h)
        _, (guard, guard_slope), _ = slopes(now.x)
        # A guard that is zero, as after an impact, can only fall through zero again if it rises first.
        armed = jnp.where(now.on_guard, (guard_slope > 0) & plant.can_bounce, guard > 0)
        armed &= plant.can_touch_down(x_end) | plant.can_touch_down(now.x)
        trial = Trial(
            x=x_end,
            comes_down=armed & (plant.guard(x_end) <= 0),
            falls=plant.fall_margin(x_end) <= 0,
            finite=jnp.all(jnp.isfinite(x_end)),
        )
        # The barriers make XLA compute what stands here once, not again, with its sines, in each of its uses.
        return lax.optimization_barrier(trial)

    def crosses(carry: tuple[Progress, Trial]) -> Bool[Array, ""]:
        now, trial = carry
        return ~now.stopped & trial.finite & (trial.comes_down | trial.falls)

    def newton_step(x: Array, tau: Array, h: Array, falls: Array) -> tuple[Array, Array, Array]:
        """The event's time once more polished, and the state and its derivative at the time before."""
        x_near = lax.optimization_barrier(rk4(plant.flow, x, control, tau))
        velocity, at_touchdown, at_fall = slopes(x_near)
        value, slope = (jnp.where(falls, *pair) for pair in zip(at_fall, at_touchdown, strict=True))
        polished = jnp.clip(tau - value / jnp.where(slope < 0, slope, -jnp.inf), 0, h)
        return lax.optimization_barrier(polished), x_near, velocity

    def go_to_event(carry: tuple[Progress, Trial]) -> tuple[Progress, Trial]:
        now, trial = carry
        h = jnp.maximum(substep_end - now.time, 0)
        _, (guard, guard_slope), (margin, margin_slope) = slopes(now.x)
        guard = jnp.where(now.on_guard, 0, guard)
        touchdown_at = _falling_root(guard, h * guard_slope, plant.guard(trial.x))
        fall_at = _falling_root(jnp.maximum(margin, 0), h * margin_slope, plant.fall_margin(trial.x))
        falls = trial.falls & (~trial.comes_down | (fall_at < touchdown_at))
        tau = lax.optimization_barrier(h * jnp.clip(jnp.where(falls, fall_at, touchdown_at), 0, 1))
        # The guess is off by some 1e-5 of a step and each Newton step squares that: float64 takes one more.
        if jnp.finfo(tau.dtype).bits > 32:
            tau, _, _ = newton_step(now.x, tau, h, falls)
        polished, x_near, velocity = newton_step(now.x, tau, h, falls)
        # To first order, for the square of this last correction is below rounding.
        x_event = lax.optimization_barrier(x_near + (polished - tau) * velocity)
        tau = polished

        touched = ~falls & plant.can_touch_down(x_event)
        happens = falls | touched
        time = now.time + tau
        x = jnp.where(touched, plant.impact(x_event), x_event)
        foot_x = now.foot_x + jnp.where(touched, plant.step_length(x_event), 0)
        first_touchdown = jnp.where(touched & (now.touchdowns == 0), time, now.first_touchdown)
        chattered = touched & (now.touchdowns + 1 >= MAX_TOUCHDOWNS)
        if chatter.max_touchdowns is not None:
            chattered |= touched & (touchdowns_before + now.touchdowns >= chatter.max_touchdowns)
        if chatter.min_gap is not None:
            chattered |= touched & (now.touchdowns > 0) & (time - first_touchdown <= chatter.min_gap)
        outcome = jnp.where(chattered, Outcome.CHATTERED, Outcome.WALKING)
        outcome = jnp.where(falls, Outcome.FELL, outcome).astype(jnp.int32)
        there = Progress(
            x=jnp.where(happens, x, now.x),
            foot_x=foot_x,
            time=jnp.where(happens, time, now.time),
            outcome=outcome,
            stopped=(outcome != Outcome.WALKING) | (touched & stop_at_touchdown),
            on_guard=touched & (jnp.abs(plant.guard(x)) <= jnp.finfo(x.dtype).eps ** 0.5),
            touchdowns=now.touchdowns + touched,
            first_touchdown=first_touchdown,
            last_touchdown=jnp.where(touched, time, now.last_touchdown),
            segment_x=jnp.where(touched, x, now.segment_x),
            segment_foot_x=jnp.where(touched, foot_x, now.segment_foot_x),
        )
        rest = attempt(there, jnp.maximum(substep_end - there.time, 0))
        return there, Trial(
            x=jnp.where(happens, rest.x, trial.x),
            comes_down=rest.comes_down & happens,
            falls=rest.falls & happens,
            finite=rest.finite | ~happens,
        )

    now, trial = lax.while_loop(crosses, go_to_event, (start, attempt(start, h)))
    reaches_end = ~now.stopped
    outcome = jnp.where(reaches_end & ~trial.finite, Outcome.NOT_FINITE, now.outcome).astype(jnp.int32)
    return replace(
        now,
        x=jnp.where(reaches_end & trial.finite, trial.x, now.x),
        time=jnp.where(reaches_end, substep_end, now.time),
        outcome=outcome,
        stopped=now.stopped | ~trial.finite,
        on_guard=jnp.zeros_like(now.on_guard),
    )


def _falling_root(
    start: Float[Array, ""], slope: Float[Array, ""], end: Float[Array, ""]
) -> Float[Array, ""]:
    """Return where the parabola with p(0) = start ≥ 0, p'(0) = slope, p(1) = end falls through zero, or ∞."""
    curvature = end - start - slope
    root = jnp.sqrt(slope**2 - 4 * curvature * start)
    # Two equal forms of one root, each without cancellation on its own side.
    at = jnp.where(slope > 0, (slope + root) / (-2 * curvature), 2 * start / (root - slope))
    return jnp.where(at >= 0, at, jnp.inf)
