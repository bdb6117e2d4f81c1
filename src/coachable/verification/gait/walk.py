"""A long walk in a closed loop, under either clock, with what is needed to see the gait it settles to."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from coachable.plants.outcome import Outcome
from coachable.plants.sampled import Clock, Sampling
from coachable.verification.gait.closed_loop import ClosedLoop

SETTLING_SECONDS = 100.0
"""How long a plant may take to settle."""


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
    memory: Float[Array, " memory"]
    """What the controller remembers at its end, as numbers; none of a state feedback."""
    outcome: Int[Array, ""]
    """An `Outcome`."""


def sample_walk(
    loop: ClosedLoop,
    x0: Float[Array, " state"],
    memory: Float[Array, " memory"],
    clock: Clock,
    seconds: float,
) -> tuple[Sample, Bool[Array, " steps"]]:
    """Walk from x0 until the plant falls or the time is over: the samples, and which of them were taken."""
    sampling = Sampling(clock, loop.control_dt, loop.num_substeps, loop.chatter)

    def observe(step, recall, nothing):
        moved = step.moved
        sample = Sample(
            time=step.time,
            x=moved.x[:-1],
            control=step.control,
            foot_x=moved.foot_x,
            work=moved.x[-1],
            touched=step.touched,
            touchdown_time=step.touchdown_time,
            y=loop.plant.to_section(moved.segment_x[:-1]),
            memory=loop.numbers(recall, x0),
            outcome=moved.outcome,
        )
        return nothing, sample, step.fell | step.time_is_up(seconds, sampling)

    start, recall = jnp.append(x0, jnp.zeros((), x0.dtype)), loop.recalled(memory)
    num_steps = sampling.num_steps(seconds)
    _, samples, alive = loop.walk(sampling, start, observe, num_steps, recall=recall, dynamics=loop.metered)
    assert alive is not None, "samples are recorded"
    return samples, alive


@dataclass(frozen=True, eq=False)
class SampledWalk:
    """A walk as NumPy arrays, one row a sample, the start included; touchdowns apart."""

    time: np.ndarray
    """[s]"""
    x: np.ndarray
    """States."""
    control: np.ndarray
    """Controls from each row but the last to the next."""
    memory: np.ndarray
    """What the controller remembers in each row, as numbers; no columns of a state feedback."""
    touchdown_time: np.ndarray
    """When a foot touched down [s]."""
    touchdown_foot: np.ndarray
    """Where the new stance foot then stood [m]."""
    touchdown_work: np.ndarray
    """The actuators' work when the sample of the touchdown ended [J]."""
    section: np.ndarray
    """Points of the section, one a touchdown."""
    section_memory: np.ndarray
    """What the controller remembers there; with the touchdown clock, at the touchdown itself."""
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
    def of(samples: Sample, alive: np.ndarray, x0: np.ndarray, memory0: np.ndarray) -> "SampledWalk":
        """The steps that were taken, of one walk."""
        taken = jax.tree.map(lambda leaf: np.asarray(leaf)[np.asarray(alive)], samples)
        touched = taken.touched & (taken.outcome == Outcome.WALKING)
        return SampledWalk(
            time=np.concatenate([[0.0], taken.time]),
            x=np.concatenate([np.asarray(x0)[None], taken.x]),
            control=taken.control,
            memory=np.concatenate([np.asarray(memory0)[None], taken.memory]),
            touchdown_time=taken.touchdown_time[touched],
            touchdown_foot=taken.foot_x[touched],
            touchdown_work=taken.work[touched],
            section=taken.y[touched],
            section_memory=taken.memory[touched],
            outcome=Outcome(int(taken.outcome[-1])),
        )


def settle(
    loops: ClosedLoop,
    starts: Float[np.ndarray, "walkers state"],
    clock: Clock,
    seconds: float = SETTLING_SECONDS,
    memories: Float[np.ndarray, "walkers memory"] | None = None,
) -> list[SampledWalk]:
    """Long walks of stacked loops, each from its start, side by side.

    Arguments: memories, what the controllers remember there, by default nothing of the time before.
    """
    x0 = jnp.asarray(starts, jnp.float64)
    memory0 = _begun(loops, x0) if memories is None else jnp.asarray(memories, jnp.float64)
    samples, alive = jax.device_get(_sample_walks(loops, x0, memory0, clock, seconds))
    return [
        SampledWalk.of(
            jax.tree.map(lambda leaf, i=i: leaf[i], samples), alive[i], start, np.asarray(memory0[i])
        )
        for i, start in enumerate(starts)
    ]


@eqx.filter_jit
def _begun(loops: ClosedLoop, starts: Float[Array, "walkers state"]) -> Float[Array, "walkers memory"]:
    return eqx.filter_vmap(lambda loop, x0: loop.numbers(loop.begun(x0), x0))(loops, starts)


@eqx.filter_jit
def _sample_walks(
    loops: ClosedLoop,
    starts: Float[Array, "walkers state"],
    memories: Float[Array, "walkers memory"],
    clock: Clock,
    seconds: float,
) -> tuple[Sample, Bool[Array, "walkers steps"]]:
    def walk(loop, x0, memory):
        return sample_walk(loop, x0, memory, clock, seconds)

    return eqx.filter_vmap(walk)(loops, starts, memories)
