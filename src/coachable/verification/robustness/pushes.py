"""How much a gait withstands: kicks, other constants of its plant, noisy and late controls."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from coachable.plants.plant import Plant
from coachable.plants.sampled import Clock
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.labels import control_unit
from coachable.verification.proportion import Proportion
from coachable.verification.robustness.disturbance import Disturbance, seconds_up, undisturbed

SECONDS = 10.0
"""What is still up after so long has survived."""

LEAST_NOISE, GREATEST_NOISE = 0.01, 1.0
"""Standard deviations of the controls' noise between which the limit is looked for."""
NOISE_LEVELS = 16
"""Amounts of noise that are tried, none at all among them."""
NOISE_SEEDS = 24
ENOUGH = 0.95
"""Share of the noise seeds that have to be up."""

_LEVELS = 24
_REFINEMENTS = 3
_AT_ONCE = 16


@dataclass(frozen=True)
class Tolerance:
    """The greatest amount up to which the plant was up after `SECONDS`, in one direction."""

    what: str
    amount: float
    """Largest that it survived with all smaller ones that were tried."""
    tried: float
    """The largest that was tried; where `amount` is as large, the limit lies beyond."""
    unit: str


@dataclass(frozen=True)
class Survival:
    """How many of a number of episodes, each with another push of one size, were up after `SECONDS`."""

    what: str
    amount: float
    unit: str
    up: Proportion


@dataclass(frozen=True)
class Pushes:
    """What a gait withstands, each disturbance alone.

    Of a plant under its own clock, begun right after a touchdown; in a Gymnasium environment as in
    `episode_pushes.py`.
    """

    tolerances: tuple[Tolerance, ...]
    delay_survived: bool
    """Whether it is up after `SECONDS` with every control one sample late; of episodes, `ENOUGH` of them."""
    survival: tuple[Survival, ...] = ()
    """In a Gymnasium environment: of the episodes behind the tolerances, those that were survived."""


def pushes(loop: ClosedLoop, clock: Clock, gait_point: Float[np.ndarray, " section"]) -> Pushes:
    """Search for the limits: a ladder of amounts, then ladders within the rung where it first fell.

    Smaller amounts than the first that fells it were survived as far as they were tried; larger ones may be
    survived, too. Computed in float32.
    """
    with jax.enable_x64(False):
        y = jnp.asarray(gait_point, jnp.float32)
        directions = _directions(loop.plant)
        greatest = np.array([amount for _, _, amount, _ in directions])
        low, high = np.zeros(len(directions)), greatest
        for _ in range(_REFINEMENTS):
            ladder = low[:, None] + (high - low)[:, None] * np.arange(1, _LEVELS + 1) / _LEVELS
            up = _survives(
                loop, clock, y, _stacked_along(loop.plant, directions, ladder), np.zeros(ladder.size, int)
            )
            up = up.reshape(ladder.shape)
            first = np.where(up.all(axis=1), _LEVELS, np.argmin(up, axis=1))
            rungs = np.concatenate([low[:, None], ladder, ladder[:, -1:]], axis=1)
            low, high = (np.take_along_axis(rungs, (first + more)[:, None], axis=1)[:, 0] for more in (0, 1))
        noise, delay = _noise_and_delay(loop, clock, y)
    found = [
        Tolerance(what, float(amount), float(most), unit)
        for (what, _, most, unit), amount in zip(directions, low, strict=True)
    ]
    return Pushes((*found, Tolerance("torque noise", noise, GREATEST_NOISE, control_unit(loop.plant))), delay)


def _directions(plant: Plant) -> list[tuple[str, Disturbance, float, str]]:
    """Name, direction as the change that one unit of it makes, greatest amount, unit."""
    known = plant.disturbances()
    nothing = jax.tree.map(lambda leaf: jnp.zeros_like(leaf, jnp.float32), undisturbed(plant))
    kicks = [
        (
            f"kick, {kick.name}",
            eqx.tree_at(lambda d: d.kick, nothing, jnp.array(kick.direction)),
            kick.greatest,
            kick.unit,
        )
        for kick in known.kicks
    ]
    changes = [
        (
            change.name,
            eqx.tree_at(
                lambda d, what=change.what: d.changes[what], nothing, jnp.sign(jnp.float32(change.greatest))
            ),
            abs(change.greatest),
            change.unit,
        )
        for change in known.changes
    ]
    return [*kicks, *changes]


def _stacked_along(
    plant: Plant,
    directions: list[tuple[str, Disturbance, float, str]],
    amounts: Float[np.ndarray, "directions levels"],
) -> Disturbance:
    """Every direction at every of its amounts, flat."""
    unit = jax.tree.map(lambda *leaves: np.stack(leaves), *[direction for _, direction, _, _ in directions])

    def along(nominal, change):
        steps = amounts.reshape(*amounts.shape, *[1] * nominal.ndim) * np.asarray(change)[:, None]
        return (np.asarray(nominal) + steps).reshape(-1, *nominal.shape).astype(nominal.dtype)

    return jax.tree.map(along, undisturbed(plant), unit)


def _noise_and_delay(loop: ClosedLoop, clock: Clock, y: Float[Array, " section"]) -> tuple[float, bool]:
    """The greatest noise of a ladder up to which enough seeds are up, and whether lateness is survived."""
    levels = NOISE_LEVELS
    amounts = np.concatenate([[0.0], np.geomspace(LEAST_NOISE, GREATEST_NOISE, levels - 1)])
    many = jax.tree.map(
        lambda leaf: np.tile(np.asarray(leaf), (levels * NOISE_SEEDS, *[1] * leaf.ndim)),
        undisturbed(loop.plant),
    )
    seeds = np.tile(np.arange(NOISE_SEEDS), levels)
    late = np.zeros(levels * NOISE_SEEDS, bool)
    late[0] = True  # without noise all seeds are the same walk, so one of them can be spent on the delay
    noisy = eqx.tree_at(
        lambda d: (d.noise, d.delay), many, (np.repeat(amounts, NOISE_SEEDS).astype(np.float32), late)
    )
    up = _survives(loop, clock, y, noisy, seeds)
    enough = up.reshape(levels, NOISE_SEEDS)[1:].mean(axis=1) >= ENOUGH
    num_survived = len(enough) if enough.all() else int(np.argmin(enough))
    return float(amounts[num_survived]), bool(up[0])


def _survives(
    loop: ClosedLoop, clock: Clock, y: Float[Array, " section"], disturbances: Disturbance, seeds: np.ndarray
) -> np.ndarray:
    """Whether each disturbance is survived."""
    seconds = _seconds_up(loop, clock, y, jax.tree.map(jnp.asarray, disturbances), jnp.asarray(seeds))
    return np.asarray(seconds) >= SECONDS - loop.control_dt / 2


@eqx.filter_jit
def _seconds_up(
    loop: ClosedLoop,
    clock: Clock,
    y: Float[Array, " section"],
    disturbances: Disturbance,
    seeds: Int[Array, " disturbances"],
) -> Float[Array, " disturbances"]:
    def one(pair):
        disturbance, seed = pair
        return seconds_up(loop, clock, y, disturbance, jax.random.PRNGKey(seed), seconds=SECONDS)

    return lax.map(one, (disturbances, seeds), batch_size=_AT_ONCE)
