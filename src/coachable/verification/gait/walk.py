"""A long walk in a closed loop, under either clock, with what is needed to see the gait it settles to."""

from dataclasses import dataclass
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.envs.walking_task import Clock
from coachable.plants.event_search import PAPER_CHATTER
from coachable.plants.integrate import advance
from coachable.plants.outcome import Outcome
from coachable.verification.gait.closed_loop import ClosedLoop

SETTLING_SECONDS = 100.0
"""How long a plant may take to settle."""

MORE_SAMPLES = 1.1
"""A clock that restarts at touchdown takes more samples than time over period; so many times more at most."""


class Sample(eqx.Module):
    """What one control step of a walk did and where it ended; a walk is many of them, stacked."""

    time: Float[Array, ""]
    """At its end [s]."""
    x: Float[Array, " state"]
    """State at its end."""
    control: Float[Array, " control"]
    """Held in it."""
    foot_x: Float[Array, ""]
    """Where the stance foot stands at its end [m]."""
    work: Float[Array, ""]
    """The actuators' work until its end, braking counted as driving [J]."""
    touched: Bool[Array, ""]
    """Whether there was a touchdown in it."""
    touchdown_time: Float[Array, ""]
    """When the last of them was, from the walk's start [s]."""
    y: Float[Array, " section"]
    """The point of the section right after that."""
    alive: Bool[Array, ""]
    """Whether the step was taken: the plant had not fallen and the time was not over."""
    outcome: Int[Array, ""]
    """An `Outcome`."""


class _Now(eqx.Module):
    x: Float[Array, " metered"]
    foot_x: Float[Array, ""]
    full_steps: Int[Array, ""]
    in_others: Float[Array, ""]
    """Time in the steps that were cut short, apart from the full ones so that rounding does not pile up."""
    in_a_row: Int[Array, ""]
    """Touchdowns since the last full step."""
    alive: Bool[Array, ""]


def sample_walk(loop: ClosedLoop, x0: Float[Array, " state"], clock: Clock, seconds: float) -> Sample:
    """Walk from x0 until the plant falls or the time is over, with the touchdown rules of the task."""
    restarts = clock == "touchdown"
    metered = loop.metered
    dtype, count = x0.dtype, jnp.zeros((), jnp.int32)
    zero = jnp.zeros((), dtype)
    start = _Now(jnp.append(x0, zero), zero, count, zero, count, jnp.array(True))

    def step(now: _Now, _):
        # Behind its end a walk is begun anew, unseen: where the plant fell, every step would search for
        # events in vain, and all that is vmapped beside it would wait.
        begin = jax.tree.map(partial(jnp.where, now.alive), now, start)
        control = loop.metered_control(begin.x)
        moved = advance(
            metered,
            begin.x,
            begin.foot_x,
            control,
            loop.control_dt,
            num_substeps=loop.num_substeps,
            stop_at_touchdown=restarts,
            touchdowns_before=begin.in_a_row if restarts else 0,
            chatter=PAPER_CHATTER if restarts else loop.chatter,
        )
        touched, ended = moved.touchdowns > 0, moved.outcome != Outcome.WALKING
        cut = (touched & restarts) | ended
        full_steps = begin.full_steps + ~cut
        in_others = begin.in_others + jnp.where(cut, moved.elapsed, 0)
        time_before = begin.full_steps.astype(dtype) * loop.control_dt + begin.in_others
        time = full_steps.astype(dtype) * loop.control_dt + in_others
        time_is_up = time >= seconds - 1e-3 * loop.control_dt  # sums of short steps are not exact
        after = _Now(
            x=moved.x,
            foot_x=moved.foot_x,
            full_steps=full_steps,
            in_others=in_others,
            in_a_row=jnp.where(cut, begin.in_a_row + moved.touchdowns, 0),
            alive=now.alive & ~ended & ~time_is_up,
        )
        return after, Sample(
            time=time,
            x=moved.x[:-1],
            control=control,
            foot_x=moved.foot_x,
            work=moved.x[-1],
            touched=touched,
            touchdown_time=time_before + jnp.where(touched, moved.touchdown_time, 0),
            y=loop.plant.to_section(moved.segment_x[:-1]),
            alive=now.alive,
            outcome=moved.outcome,
        )

    num_steps = round(seconds / loop.control_dt * (MORE_SAMPLES if restarts else 1))
    return lax.scan(step, start, length=num_steps)[1]


@dataclass(frozen=True, eq=False)
class SampledWalk:
    """A walk as NumPy arrays, one row a sample, the start included; touchdowns apart."""

    time: np.ndarray
    """[s]"""
    x: np.ndarray
    """States."""
    control: np.ndarray
    """Controls from each row but the last to the next."""
    touchdown_time: np.ndarray
    """When a foot touched down [s]."""
    touchdown_foot: np.ndarray
    """Where the new stance foot then stood [m]."""
    touchdown_work: np.ndarray
    """The actuators' work when the sample of the touchdown ended [J]."""
    section: np.ndarray
    """Points of the section, one a touchdown."""
    outcome: Outcome
    """How it ended."""

    @property
    def seconds(self) -> float:
        """How long the plant was up."""
        return float(self.time[-1])

    @property
    def up(self) -> bool:
        """Whether the plant was up at the end."""
        return self.outcome is Outcome.WALKING

    @staticmethod
    def of(samples: Sample, x0: np.ndarray) -> "SampledWalk":
        """The steps that were taken, of one walk."""
        taken = jax.tree.map(lambda leaf: np.asarray(leaf)[np.asarray(samples.alive)], samples)
        touched = taken.touched & (taken.outcome == Outcome.WALKING)
        return SampledWalk(
            time=np.concatenate([[0.0], taken.time]),
            x=np.concatenate([np.asarray(x0)[None], taken.x]),
            control=taken.control,
            touchdown_time=taken.touchdown_time[touched],
            touchdown_foot=taken.foot_x[touched],
            touchdown_work=taken.work[touched],
            section=taken.y[touched],
            outcome=Outcome(int(taken.outcome[-1])),
        )


def settle(
    loops: ClosedLoop,
    starts: Float[np.ndarray, "walkers state"],
    clock: Clock,
    seconds: float = SETTLING_SECONDS,
) -> list[SampledWalk]:
    """Long walks of stacked loops, each from its start, side by side."""
    samples = jax.device_get(_sample_walks(loops, jnp.asarray(starts, jnp.float64), clock, seconds))
    return [
        SampledWalk.of(jax.tree.map(lambda leaf, i=i: leaf[i], samples), start)
        for i, start in enumerate(starts)
    ]


@eqx.filter_jit
def _sample_walks(
    loops: ClosedLoop, starts: Float[Array, "walkers state"], clock: Clock, seconds: float
) -> Sample:
    return eqx.filter_vmap(lambda loop, x0: sample_walk(loop, x0, clock, seconds))(loops, starts)
