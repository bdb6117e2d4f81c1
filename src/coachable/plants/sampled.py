"""The one sampled walk: a plant under a control that is sampled and held, step by step, until it ends.

`sampled_step` is one control step. `walk_recorded` and `walk_unrecorded` repeat any such step until it
reports the end; `sampled_walk` repeats `sampled_step` under a controller.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int, PyTree

from coachable.foundation.errors import ParameterError
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.integrate import Advance, advance
from coachable.plants.outcome import Outcome
from coachable.plants.plant import Dynamics

Clock = Literal["free", "touchdown"]
CLOCKS: tuple[Clock, ...] = ("free", "touchdown")
"""`free` samples every control_dt; with `touchdown` a touchdown restarts the sample clock."""

MORE_SAMPLES = 1.1
"""Where touchdowns restart the clock a walk may take so many times seconds / control_dt samples."""

_MOST_STEPS = 10**9

TIME_TOLERANCE = 1e-3
"""Time is up this share of a control step early: sums of short steps are not exact."""


@dataclass(frozen=True)
class Sampling:
    """When the control is sampled, and how the control steps are integrated."""

    clock: Clock = "free"
    control_dt: float = 0.01
    """How long a control is held, unless a touchdown restarts the clock [s]."""
    num_substeps: int | None = None
    """Runge–Kutta steps in a control step; see `default_substeps`."""
    chatter: ChatterRule = PAPER_CHATTER
    """Under the free clock; a clock that restarts has the paper's rule, counted across its short steps."""

    @property
    def restarts(self) -> bool:
        """Whether a touchdown restarts the clock."""
        return self.clock == "touchdown"

    def num_steps(self, seconds: float) -> int:
        """How many control steps to allow for so many seconds of a walk.

        **Raises:** `ParameterError` for more than a billion.
        """
        require_few_steps(seconds, self.control_dt)
        return round(seconds / self.control_dt * (MORE_SAMPLES if self.restarts else 1))


def require_few_steps(seconds: float, control_dt: float) -> None:
    """Refuse a walk that no computer ends.

    **Raises:** `ParameterError` for more than a billion control steps.
    """
    if not seconds / control_dt <= _MOST_STEPS:
        raise ParameterError(
            f"seconds is {seconds!r}, more than {_MOST_STEPS:,} control steps of {control_dt!r} s"
        )


class SampledState(eqx.Module):
    """Where a sampled walk stands between two control steps."""

    x: Float[Array, " state"]
    foot_x: Float[Array, ""]
    """Where the stance foot stands [m]."""
    num_steps: Int[Array, ""]
    """Control steps so far."""
    full_steps: Int[Array, ""]
    """Those of them that lasted control_dt."""
    time_in_others: Float[Array, ""]
    """How long the rest of them lasted [s]; apart from the full ones so that rounding does not pile up."""
    touchdowns_in_a_row: Int[Array, ""]
    """Touchdowns since the last full step, where they restart the clock."""

    @staticmethod
    def at(x: Float[Array, " state"]) -> SampledState:
        """The start of a walk at x, the stance foot at 0."""
        zero, count = jnp.zeros((), x.dtype), jnp.zeros((), jnp.int32)
        return SampledState(x, zero, count, count, zero, count)

    def time(self, sampling: Sampling) -> Float[Array, ""]:
        """Since the start of the walk [s]."""
        return self.full_steps.astype(self.x.dtype) * sampling.control_dt + self.time_in_others


class SampledStep(eqx.Module):
    """What one control step did. Fields that nobody uses cost nothing once compiled."""

    moved: Advance
    control: Float[Array, " control"]
    """What was held."""
    time_before: Float[Array, ""]
    """When it began [s]."""
    time: Float[Array, ""]
    """When it ended [s]."""
    touched: Bool[Array, ""]
    """Whether there was a touchdown in it."""
    fell: Bool[Array, ""]
    """Whether its outcome is another one than `Outcome.WALKING`."""

    @property
    def touchdown_time(self) -> Float[Array, ""]:
        """When the last touchdown was, from the walk's start [s]; `time_before` if there was none."""
        return self.time_before + jnp.where(self.touched, self.moved.touchdown_time, 0)

    def time_is_up(self, seconds: float, sampling: Sampling) -> Bool[Array, ""]:
        """Whether the walk has lasted so many seconds."""
        return self.time >= seconds - TIME_TOLERANCE * sampling.control_dt


def sampled_step(
    dynamics: Dynamics, sampling: Sampling, state: SampledState, control: Float[Array, " control"]
) -> tuple[SampledState, SampledStep]:
    """Hold a control for one control step, or until a touchdown where that restarts the clock."""
    restarts = sampling.restarts
    moved = advance(
        dynamics,
        state.x,
        state.foot_x,
        control,
        sampling.control_dt,
        num_substeps=sampling.num_substeps,
        stop_at_touchdown=restarts,
        touchdowns_before=state.touchdowns_in_a_row if restarts else 0,
        chatter=PAPER_CHATTER if restarts else sampling.chatter,
    )
    touched, fell = moved.touchdowns > 0, moved.outcome != Outcome.WALKING
    cut_short = touched & restarts | fell
    after = SampledState(
        x=moved.x,
        foot_x=moved.foot_x,
        num_steps=state.num_steps + 1,
        full_steps=state.full_steps + ~cut_short,
        time_in_others=state.time_in_others + jnp.where(cut_short, moved.elapsed, 0),
        touchdowns_in_a_row=jnp.where(cut_short, state.touchdowns_in_a_row + moved.touchdowns, 0),
    )
    return after, SampledStep(moved, control, state.time(sampling), after.time(sampling), touched, fell)


Step = Callable[[Any, Any], tuple[Any, Any, Array]]
"""(state, input) ↦ the state after a control step, what is recorded of it, whether the walk has ended."""


def walk_recorded(
    step: Step, start: PyTree, num_steps: int, inputs: PyTree = None
) -> tuple[PyTree, PyTree, Bool[Array, " steps"]]:
    """Repeat a step until it reports the end, num_steps times at most, and keep every record.

    **Arguments:** `inputs`, one a step along the leading axis of its leaves.

    **Returns:** the state at the end; the records, where those behind the end repeat the last one; and which
    steps were taken.
    """

    def scanned(carry: tuple, given: PyTree) -> tuple[tuple, tuple]:
        state, last, alive = carry
        # Behind its end a walk is taken again from its start, unseen: where the robot fell, every step would
        # search for events anew, and all that is vmapped beside it would wait.
        walking = _where(alive, state, start)
        after, record, ended = step(walking, given)
        state, record = _where(alive, (after, record), (state, last))
        return (state, record, alive & ~ended), (record, alive)

    first = jax.tree.map(lambda leaf: leaf[0], inputs)
    begin = (start, _nothing(step, start, first), jnp.array(True))
    (state, _, _), (records, alive) = lax.scan(scanned, begin, inputs, length=num_steps)
    return state, records, alive


def walk_unrecorded(step: Step, start: PyTree) -> tuple[PyTree, PyTree]:
    """Repeat a step until it reports the end; the step's input is `None`.

    **Returns:** the state at the end, and the last record.
    """

    def looped(carry: tuple) -> tuple:
        state, _, ended = carry
        # One that has ended waits at its start for those vmapped beside it, as in `walk_recorded`.
        return step(_where(ended, start, state), None)

    begin = (start, _nothing(step, start, None), jnp.array(False))
    state, record, _ = lax.while_loop(lambda carry: ~carry[2], looped, begin)
    return state, record


Control = Callable[[Array, PyTree, Any], tuple[Array, PyTree]]
"""(x, memory, input) ↦ the control to be held, and the memory."""

Observe = Callable[[SampledStep, PyTree], tuple[PyTree, PyTree, Array]]
"""(step, memory) ↦ the memory after it, what is recorded of it, whether the walk has ended."""


def sampled_walk(
    dynamics: Dynamics,
    sampling: Sampling,
    control: Control,
    x0: Float[Array, " state"],
    observe: Observe,
    num_steps: int | None,
    *,
    memory: PyTree = None,
    inputs: PyTree = None,
) -> tuple[PyTree, PyTree, Bool[Array, " steps"] | None]:
    """Walk from x0 under a control.

    Whatever a use needs beside the walk itself is in its memory: a torque that is applied late, a sum, the
    point of the last touchdown. Work is metered by dynamics with one more coordinate.

    **Arguments:**
        dynamics: what is integrated; sampling: how.
        control: the controller with what disturbs it; `undisturbed(controller)` has nothing that does.
        observe: what is remembered and recorded of a step, and whether it is the last.
        num_steps: how many steps at most, or `None` to go on until `observe` reports the end and to keep the
            last record only.
        memory: at the start; inputs: one a step, for `control`, such as random keys.

    **Returns:** the memory at the end, the records, and which steps were taken; see `walk_recorded`.
    """

    def step(now: tuple[SampledState, PyTree], given: Any) -> tuple[PyTree, PyTree, Array]:
        state, memory = now
        held, memory = control(state.x, memory, given)
        state, taken = sampled_step(dynamics, sampling, state, held)
        memory, record, ended = observe(taken, memory)
        return (state, memory), record, ended

    start = (SampledState.at(x0), memory)
    if num_steps is None:
        (_, memory), record = walk_unrecorded(step, start)
        return memory, record, None
    (_, memory), records, alive = walk_recorded(step, start, num_steps, inputs)
    return memory, records, alive


def undisturbed(controller: Callable[[Array], Array]) -> Control:
    """The control of a controller that sees the state and nothing else."""
    return lambda x, memory, given: (controller(x), memory)


def _where(which: Bool[Array, ""], one: PyTree, other: PyTree) -> PyTree:
    return jax.tree.map(partial(jnp.where, which), one, other)


def _nothing(step: Step, start: PyTree, given: PyTree) -> PyTree:
    """Zeros of the shape of a record."""
    _, record, _ = jax.eval_shape(step, start, given)
    return jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), record)
