"""How much a gait takes: kicks, other masses and lengths, gravity, slopes, noisy and late torques."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from coachable.envs.walking_task import Clock
from coachable.verification.gait.section import Loop
from coachable.verification.robustness.disturbance import Disturbance, seconds_up, undisturbed

SECONDS = 10.0
"""Who is still up after so long has survived."""

GREATEST_KICK = 3.0
"""[rad/s]"""
LEAST_NOISE, GREATEST_NOISE = 0.01, 1.0
"""Standard deviations of the torque noise between which the limit is looked for [N m]."""
NOISE_SEEDS = 24
ENOUGH = 0.95
"""Share of the noise seeds that have to be up."""

_DIAGONAL = 2**-0.5
_KICKS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "stance leg forward": (-1.0, 0.0),
        "stance leg back": (1.0, 0.0),
        "swing leg forward": (0.0, 1.0),
        "swing leg back": (0.0, -1.0),
        "both forward": (-_DIAGONAL, _DIAGONAL),
        "both back": (_DIAGONAL, -_DIAGONAL),
        "legs closing": (-_DIAGONAL, -_DIAGONAL),
        "legs opening": (_DIAGONAL, _DIAGONAL),
    }
)
"""Directions of a kick in (θ̇1, θ̇2), right after a touchdown; walking forward means θ̇1 < 0."""

_ERRORS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "mass up": ("mass", 2.0),
        "mass down": ("mass", -0.9),
        "length up": ("length", 1.0),
        "length down": ("length", -0.7),
        "gravity up": ("gravity", 2.0),
        "gravity down": ("gravity", -0.9),
        "slope up": ("slope", 0.3),
        "slope down": ("slope", -0.3),
    }
)
"""What is off, and how far at most: a share of the nominal value, or the ground's angle [rad]."""

_LEVELS = 24
_REFINEMENTS = 3
_AT_ONCE = 16


@dataclass(frozen=True)
class Tolerance:
    """The greatest amount up to which the walker was up after `SECONDS`, in one direction."""

    what: str
    amount: float
    """Largest that it survived with all smaller ones that were tried."""
    tried: float
    """The largest that was tried; where `amount` is as large, the limit lies beyond."""
    unit: str


@dataclass(frozen=True)
class Pushes:
    """What a gait under its own clock takes, each disturbance alone, begun right after a touchdown."""

    tolerances: tuple[Tolerance, ...]
    delay_survived: bool
    """Whether it is up after `SECONDS` with every torque one sample late."""


def pushes(loop: Loop, clock: Clock, gait_point: Float[np.ndarray, "3"]) -> Pushes:
    """Search for the limits: a ladder of amounts, then ladders within the rung where it first fell.

    Smaller amounts than the first that fells it were survived as far as they were tried; larger ones may be
    survived, too. Computed in float32.
    """
    with jax.enable_x64(False):
        y = jnp.asarray(gait_point, jnp.float32)
        directions = [*_kicks(), *_errors()]
        greatest = np.array([amount for _, _, amount, _ in directions])
        low, high = np.zeros(len(directions)), greatest
        for _ in range(_REFINEMENTS):
            ladder = low[:, None] + (high - low)[:, None] * np.arange(1, _LEVELS + 1) / _LEVELS
            up = _survives(loop, clock, y, _stacked_along(directions, ladder), np.zeros(ladder.size, int))
            up = up.reshape(ladder.shape)
            first = np.where(up.all(axis=1), _LEVELS, np.argmin(up, axis=1))
            rungs = np.concatenate([low[:, None], ladder, ladder[:, -1:]], axis=1)
            low, high = (np.take_along_axis(rungs, (first + more)[:, None], axis=1)[:, 0] for more in (0, 1))
        noise, delay = _noise_and_delay(loop, clock, y)
    found = [
        Tolerance(what, float(amount), float(most), unit)
        for (what, _, most, unit), amount in zip(directions, low, strict=True)
    ]
    return Pushes((*found, Tolerance("torque noise", noise, GREATEST_NOISE, "N m")), delay)


def _kicks() -> list[tuple[str, Disturbance, float, str]]:
    """Name, direction as the change a unit of it makes, greatest amount, unit."""
    nothing = jax.tree.map(lambda leaf: jnp.zeros_like(leaf, jnp.float32), undisturbed())
    return [
        (
            f"kick, {name}",
            eqx.tree_at(lambda d: d.kick, nothing, jnp.array(direction)),
            GREATEST_KICK,
            "rad/s",
        )
        for name, direction in _KICKS.items()
    ]


def _errors() -> list[tuple[str, Disturbance, float, str]]:
    nothing = jax.tree.map(lambda leaf: jnp.zeros_like(leaf, jnp.float32), undisturbed())
    return [
        (
            name,
            eqx.tree_at(lambda d, field=field: getattr(d, field), nothing, jnp.sign(jnp.float32(greatest))),
            abs(greatest),
            "rad" if field == "slope" else "of nominal",
        )
        for name, (field, greatest) in _ERRORS.items()
    ]


def _stacked_along(
    directions: list[tuple[str, Disturbance, float, str]], amounts: Float[np.ndarray, "directions levels"]
) -> Disturbance:
    """Every direction at every of its amounts, flat."""
    unit = jax.tree.map(lambda *leaves: np.stack(leaves), *[direction for _, direction, _, _ in directions])

    def along(nominal, change):
        steps = amounts.reshape(*amounts.shape, *[1] * nominal.ndim) * np.asarray(change)[:, None]
        return (np.asarray(nominal) + steps).reshape(-1, *nominal.shape).astype(nominal.dtype)

    return jax.tree.map(along, undisturbed(), unit)


def _noise_and_delay(loop: Loop, clock: Clock, y: Float[Array, "3"]) -> tuple[float, bool]:
    """The greatest noise of a ladder up to which enough seeds are up, and whether lateness is survived."""
    levels = len(_KICKS) + len(_ERRORS)
    amounts = np.concatenate([[0.0], np.geomspace(LEAST_NOISE, GREATEST_NOISE, levels - 1)])
    many = jax.tree.map(
        lambda leaf: np.tile(np.asarray(leaf), (levels * NOISE_SEEDS, *[1] * leaf.ndim)), undisturbed()
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
    loop: Loop, clock: Clock, y: Float[Array, "3"], disturbances: Disturbance, seeds: np.ndarray
) -> np.ndarray:
    """Whether each disturbance is survived."""
    seconds = _seconds_up(loop, clock, y, jax.tree.map(jnp.asarray, disturbances), jnp.asarray(seeds))
    return np.asarray(seconds) >= SECONDS - loop.control_dt / 2


@eqx.filter_jit
def _seconds_up(
    loop: Loop,
    clock: Clock,
    y: Float[Array, "3"],
    disturbances: Disturbance,
    seeds: Int[Array, " disturbances"],
) -> Float[Array, " disturbances"]:
    def one(pair):
        disturbance, seed = pair
        return seconds_up(loop, clock, y, disturbance, jax.random.PRNGKey(seed), seconds=SECONDS)

    return lax.map(one, (disturbances, seeds), batch_size=_AT_ONCE)
