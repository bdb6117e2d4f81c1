"""From how many starts does the walker reach its gait? Sampled, with exact binomial intervals."""

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
from scipy.stats import binomtest

from coachable.envs.walking_task import Clock
from coachable.experiments.layout import num_cores
from coachable.plants.compass import START
from coachable.plants.event_search import PAPER_CHATTER
from coachable.plants.integrate import advance
from coachable.plants.outcome import Outcome
from coachable.verification.gait.section import Loop, section_point

SECONDS = 5.0
"""How long a walker has to reach its gait."""

NEAR = (0.015, 0.05, 0.05)
"""It has reached it if its last touchdown is so near to one of the gait's, in β [rad], θ̇1, θ̇2 [rad/s]."""

AROUND_START = (0.03, 0.03, 0.04, 0.2)
"""Half the widths of the box around x₀ [rad, rad/s]: 10 % of 0.3 rad and of x₀'s velocities."""

ON_SECTION = ((0.1, 0.5), (-2.0, -0.5), (-1.5, 1.5))
"""The box on the section: β [rad], θ̇1, θ̇2 [rad/s]."""

CHUNK = 500
"""Starts in one call of the compiled program."""

SetName = Literal["start", "section"]
SET_NAMES: tuple[SetName, ...] = ("start", "section")

_AT_ONCE = 16
"""Few walkers side by side: each touchdown of one of them makes all of them wait."""
_SEED = 0

Label = Literal["reached", "fell", "undecided"]
LABELS: tuple[Label, ...] = ("reached", "fell", "undecided")
"""What became of a start, by its number."""


@dataclass(frozen=True)
class Proportion:
    """So many of so many, and the 95 % interval of Clopper and Pearson (1934) for the share."""

    count: int
    total: int

    @property
    def share(self) -> float:
        """count / total."""
        return self.count / self.total

    @property
    def interval(self) -> tuple[float, float]:
        """It covers the true share with probability 95 % at least."""
        interval = binomtest(self.count, self.total).proportion_ci(0.95, method="exact")
        return float(interval.low), float(interval.high)


@dataclass(frozen=True)
class Basin:
    """What became of starts drawn evenly from a box, within `SECONDS`."""

    starts: SetName
    reached: Proportion
    """Those whose last touchdown was `NEAR` one of the gait's."""
    fell: Proportion
    undecided: Proportion
    """Those that were up, but not at the gait: on their way to it, or to another one."""


def draw_starts(name: SetName, count: int) -> Float[np.ndarray, "starts 4"]:
    """Independent even draws from one of the two boxes; always the same ones."""
    generator = np.random.default_rng([_SEED, SET_NAMES.index(name)])
    if name == "start":
        width = np.array(AROUND_START)
        return np.array(START) + generator.uniform(-width, width, (count, 4))
    low, high = np.array(ON_SECTION).T
    beta, dtheta_1, dtheta_2 = generator.uniform(low, high, (count, 3)).T
    return np.stack([beta, -beta, dtheta_1, dtheta_2], axis=-1)


def label_starts(
    loop: Loop,
    clock: Clock,
    gait: Float[np.ndarray, "points 3"],
    starts: Float[np.ndarray, "starts 4"],
    each: Callable[[], None] = lambda: None,
) -> Int[np.ndarray, " starts"]:
    """What becomes of each start, as an index into `LABELS`.

    Arguments: gait, points of the section, any of which will do; each, called after every `CHUNK` starts.
    Computed in float32, as in training, whatever JAX's default is.
    """
    padding = -len(starts) % CHUNK
    padded = np.concatenate([starts, np.tile(starts[-1:], (padding, 1))]).astype(np.float32)

    def label(chunk: Float[np.ndarray, "starts 4"]) -> Int[np.ndarray, " starts"]:
        with jax.enable_x64(False):
            y, fell, touched = jax.device_get(_try(loop, clock, jnp.asarray(chunk)))
        near = (np.abs(y[:, None] - gait) <= NEAR).all(axis=-1).any(axis=-1) & touched
        each()
        return np.where(fell, 1, np.where(near, 0, 2))

    first, *others = padded.reshape(-1, CHUNK, 4)
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
    loop: Loop, clock: Clock, starts: Float[Array, "starts 4"]
) -> tuple[Float[Array, "starts 3"], Bool[Array, " starts"], Bool[Array, " starts"]]:
    """Where each start's last touchdown was on the section, whether it fell, and if there was a touchdown."""
    restarts = clock == "touchdown"
    more = 1.1 if restarts else 1.0

    def walk(x0):
        zero, no, count = jnp.zeros((), x0.dtype), jnp.zeros((), bool), jnp.zeros((), jnp.int32)

        def step(now, _):
            x, y, time, in_a_row, fell, touched = now
            over = fell | (time >= SECONDS)
            # Behind its end a walk is begun anew, unseen.
            begin = jnp.where(over, x0, x)
            moved = advance(
                loop.plant,
                begin,
                zero,
                loop.control(begin),
                loop.control_dt,
                stop_at_touchdown=restarts,
                touchdowns_before=in_a_row if restarts else 0,
                chatter=PAPER_CHATTER if restarts else loop.chatter,
            )
            came_down = (moved.touchdowns > 0) & ~over
            cut = (moved.touchdowns > 0) & restarts
            after = (
                moved.x,
                jnp.where(came_down, section_point(moved.segment_x), y),
                jnp.where(over, time, time + moved.elapsed),
                jnp.where(cut, in_a_row + moved.touchdowns, 0),
                fell | (~over & (moved.outcome != Outcome.WALKING)),
                touched | came_down,
            )
            return after, None

        begin = (x0, jnp.zeros(3, x0.dtype), zero, count, no, no)
        (_, y, _, _, fell, touched), _ = lax.scan(step, begin, length=round(more * SECONDS / loop.control_dt))
        return y, fell, touched

    return lax.map(walk, starts, batch_size=_AT_ONCE)
