"""From how many starts does the plant reach its gait? Sampled, with exact binomial intervals."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.experiments.layout import num_cores
from coachable.plants.plant import Plant
from coachable.plants.sampled import Clock, Sampling
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.gait.section import states_at
from coachable.verification.proportion import Proportion

SECONDS = 5.0
"""How long a plant has to reach its gait."""

CHUNK = 500
"""Starts in one call of the compiled program."""

SetName = Literal["start", "section"]
SET_NAMES: tuple[SetName, ...] = ("start", "section")

_AT_ONCE = 16
"""Few walks side by side: each touchdown of one of them makes all of them wait."""
_SEED = 0

Label = Literal["reached", "fell", "undecided"]
LABELS: tuple[Label, ...] = ("reached", "fell", "undecided")
"""What became of a start, by its number."""


@dataclass(frozen=True)
class Basin:
    """What became of starts drawn evenly from a box, within `SECONDS`."""

    starts: SetName
    reached: Proportion
    """Those whose last touchdown was within the plant's `section_near` of one of the gait's."""
    fell: Proportion
    undecided: Proportion
    """Those that were up, but not at the gait: on their way to it, or to another one."""


def set_names(plant: Plant) -> tuple[SetName, ...]:
    """The boxes that a plant gives, of those around its start and on its section."""
    given = {"start": plant.start_box, "section": plant.section_box}
    return tuple(name for name in SET_NAMES if given[name])


def draw_starts(plant: Plant, name: SetName, count: int) -> Float[np.ndarray, "starts state"]:
    """Independent even draws from one of the plant's two boxes; always the same ones."""
    generator = np.random.default_rng([_SEED, SET_NAMES.index(name)])
    if name == "start":
        width = np.array(plant.start_box)
        return np.array(plant.start) + generator.uniform(-width, width, (count, len(width)))
    low, high = np.array(plant.section_box).T
    return states_at(plant, generator.uniform(low, high, (count, len(low))))


def label_starts(
    loop: ClosedLoop,
    clock: Clock,
    gait: Float[np.ndarray, "points section"],
    starts: Float[np.ndarray, "starts state"],
    each: Callable[[], None] = lambda: None,
) -> Int[np.ndarray, " starts"]:
    """What becomes of each start, as an index into `LABELS`.

    Arguments: gait, points of the section, any of which will do; each, called after every `CHUNK` starts.
    Computed in float32, as in training, whatever JAX's default is.
    """
    padding = -len(starts) % CHUNK
    padded = np.concatenate([starts, np.tile(starts[-1:], (padding, 1))]).astype(np.float32)

    def label(chunk: Float[np.ndarray, "starts state"]) -> Int[np.ndarray, " starts"]:
        with jax.enable_x64(False):
            y, fell, touched = jax.device_get(_try(loop, clock, jnp.asarray(chunk)))
        near = (np.abs(y[:, None] - gait) <= loop.plant.section_near).all(axis=-1).any(axis=-1) & touched
        each()
        return np.where(fell, 1, np.where(near, 0, 2))

    first, *others = padded.reshape(-1, CHUNK, padded.shape[1])
    labels = [label(first)]  # alone, so that the program is compiled once
    if others:
        with ThreadPoolExecutor(num_cores()) as pool:
            labels += pool.map(label, others)
    return np.concatenate(labels)[: len(starts)]


def basin(name: SetName, labels: Int[np.ndarray, " starts"]) -> Basin:
    """The labels of starts from a box in numbers."""
    counts = np.bincount(labels, minlength=len(LABELS)).tolist()
    return Basin(name, *(Proportion(count, len(labels)) for count in counts))


@eqx.filter_jit
def _try(
    loop: ClosedLoop, clock: Clock, starts: Float[Array, "starts state"]
) -> tuple[Float[Array, "starts section"], Bool[Array, " starts"], Bool[Array, " starts"]]:
    """Where each start's last touchdown was on the section, whether it fell, and if there was a touchdown."""
    plant, sampling = loop.plant, Sampling(clock, loop.control_dt, chatter=loop.chatter)

    def walk(x0):
        def observe(step, _recall, memory):
            y, _, touched = memory
            y = jnp.where(step.touched, plant.to_section(step.moved.segment_x), y)
            over = step.fell | step.time_is_up(SECONDS, sampling)
            return (y, step.fell, touched | step.touched), None, over

        no = jnp.zeros((), bool)
        memory = (jnp.zeros(len(plant.section_names), x0.dtype), no, no)
        return loop.walk(sampling, x0, observe, sampling.num_steps(SECONDS), memory=memory)[0]

    return lax.map(walk, starts, batch_size=_AT_ONCE)
