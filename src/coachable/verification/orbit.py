"""The periodic orbit that a walker settles to: run to the attractor, then Newton on the return map."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from coachable.envs.walking_task import Clock
from coachable.plants.compass import START
from coachable.verification.section import Loop, Stride, return_map, state_of, stride
from coachable.verification.walk import Samples, Walk, sample_walk

PERIODS = (1, 2, 4)
"""How many steps a gait may take until it repeats itself, to be found as a periodic orbit."""

SETTLING_SECONDS = 100.0
"""How long a walker may take to settle."""

RESIDUAL = 1e-11
"""Largest |Pᵏ(y) − y| of a fixed point, in rad and rad/s."""

_NEWTON_STEPS = 12
_LAST = 32
"""How many of the last touchdowns tell what a gait has settled to."""
_SETTLED = 1e-9
_REPEATS = 1e-3
"""Up to here a gait under the free clock counts as repeating itself."""

Kind = Literal["periodic", "wandering", "none"]


class FixedPoint(eqx.Module):
    """A zero of Pᵏ(y) − y, or where Newton's method gave up."""

    y: Float[Array, "3"]
    residual: Float[Array, ""]
    """Largest component of |Pᵏ(y) − y|; NaN where the walker falls."""
    jacobian: Float[Array, "3 3"]
    """DPᵏ(y)."""

    @property
    def found(self) -> Bool[Array, ""]:
        """Whether it is one, to `RESIDUAL`."""
        return self.residual <= RESIDUAL


def iterate(loop: Loop, y: Float[Array, "3"], num_steps: Int[Array, ""] | int) -> Float[Array, "3"]:
    """Pᵏ(y), k = `num_steps`; NaN if the walker falls on the way."""
    return lax.fori_loop(0, num_steps, lambda _, y: return_map(loop, y), y)


def fixed_point(loop: Loop, guess: Float[Array, "3"], num_steps: Int[Array, ""] | int = 1) -> FixedPoint:
    """Newton's method for Pᵏ(y) = y under the touchdown clock, the derivative by autodiff through touchdown.

    Arguments: guess, near the fixed point (β, θ̇1, θ̇2) [rad, rad/s]; num_steps, k. Pure JAX, to be called in
    float64; nothing is raised, `found` says whether it converged.
    """

    def mapped(y):
        after = iterate(loop, y, num_steps)
        return after, after

    def improve(now):
        _, y, taken = now
        jacobian, after = jax.jacfwd(mapped, has_aux=True)(y)
        better = y + jnp.linalg.solve(jnp.eye(3) - jacobian, after - y)
        return FixedPoint(y, jnp.max(jnp.abs(after - y)), jacobian), better, taken + 1

    def goes_on(now):
        at, _, taken = now
        return (at.residual > 0.01 * RESIDUAL) & (taken < _NEWTON_STEPS)

    nothing = FixedPoint(guess, jnp.full((), jnp.inf, guess.dtype), jnp.zeros((3, 3), guess.dtype))
    return lax.while_loop(goes_on, improve, (nothing, guess, 0))[0]


def laps(loop: Loop, y: Float[Array, "3"], num_steps: int) -> Stride:
    """So many strides in a row from a point of the section, stacked."""

    def step(y, _):
        taken = stride(loop, state_of(y))
        return taken.y, taken

    return lax.scan(step, y, length=num_steps)[1]


@dataclass(frozen=True)
class Orbit:
    """The gait that a walker settles to under one clock.

    `periodic` repeats itself every `num_steps` steps: under the touchdown clock to rounding, under the free
    clock up to `wander`, for there the gait depends on where in a sample the touchdown falls. `wandering`
    goes on without repeating itself (quasi-periodic, chaotic, or of a longer period than `PERIODS`). `none`
    falls or stands still.
    """

    clock: Clock
    kind: Kind
    num_steps: int
    """k of a periodic gait, else 0."""
    points: tuple[tuple[float, float, float], ...]
    """The k points on the section of a periodic gait (means under the free clock), else the last one seen."""
    wander: tuple[float, float, float]
    """Largest distance in β [rad], θ̇1, θ̇2 [rad/s] of a section point from its mean over the last steps."""
    period: float
    """From touchdown to touchdown, mean over the steps of the orbit, or the last ones [s]."""
    step_length: float
    """Likewise [m]."""
    cost_of_transport: float
    """∫ (|u₁ θ̇₁| + |u₂ (θ̇₁ − θ̇₂)|) dt / (M g d), d the distance walked meanwhile."""
    residual: float
    """|Pᵏ(y) − y| of a periodic orbit under the touchdown clock, else NaN."""

    @property
    def speed(self) -> float:
        """step_length / period [m/s]."""
        return self.step_length / self.period

    @property
    def points_array(self) -> Float[np.ndarray, "steps 3"]:
        """The points as an array."""
        return np.array(self.points).reshape(-1, 3)


def find_orbit(loop: Loop, clock: Clock = "touchdown", x0: Sequence[float] = START) -> Orbit:
    """The gait that one walker settles to from x0. To be called under `jax.enable_x64(True)`.

    `find_orbits` does many at once.
    """
    alone = stacked([loop])
    return find_orbits(alone, settle(alone, np.array([x0]), clock), clock)[0]


def stacked(loops: Sequence[Loop]) -> Loop:
    """Loops of one kind as one whose arrays have a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *loops)


def settle(
    loops: Loop, starts: Float[np.ndarray, "walkers 4"], clock: Clock, seconds: float = SETTLING_SECONDS
) -> list[Walk]:
    """Long walks of stacked loops, each from its start, side by side."""
    samples = jax.device_get(_sample_walks(loops, jnp.asarray(starts, jnp.float64), clock, seconds))
    return [
        Walk.of(jax.tree.map(lambda leaf, i=i: leaf[i], samples), start) for i, start in enumerate(starts)
    ]


def find_orbits(loops: Loop, walks: Sequence[Walk], clock: Clock) -> list[Orbit]:
    """The gaits of stacked loops that settled so.

    Under the touchdown clock Newton's method starts where each walk ended, for every k of `PERIODS`. The
    shortest period counts to which the walk had settled, or else, where it was still on its way, the
    shortest with a fixed point that attracts it.
    """
    lasts = [walk.section[-_LAST:] for walk in walks]
    if clock == "free":
        return [_free_orbit(loops, walk, last) for walk, last in zip(walks, lasts, strict=True)]
    guesses = jnp.stack(
        [jnp.asarray(last[-1] if len(last) else np.full(3, np.nan), jnp.float64) for last in lasts]
    )
    found = {k: jax.device_get(_fixed_points(loops, guesses, jnp.asarray(k))) for k in PERIODS}
    steps = {k: jax.device_get(_laps(loops, found[k].y)) for k in PERIODS}
    orbits = []
    for lane, (walk, last) in enumerate(zip(walks, lasts, strict=True)):
        candidates = {k: jax.tree.map(lambda leaf, i=lane: leaf[i], found[k]) for k in PERIODS}
        k = _period(walk, last, candidates)
        if k is None:
            orbits.append(_unsettled(loops, walk, last, clock))
            continue
        mine = jax.tree.map(lambda leaf, i=lane, k=k: leaf[i, :k], steps[k])
        orbits.append(
            Orbit(
                clock=clock,
                kind="periodic",
                num_steps=k,
                points=_points(np.concatenate([candidates[k].y[None], mine.y[:-1]])),
                wander=(0.0, 0.0, 0.0),
                period=float(np.mean(mine.time)),
                step_length=float(np.mean(mine.length)),
                cost_of_transport=_cost_of_transport(loops, float(mine.work.sum()), float(mine.length.sum())),
                residual=float(candidates[k].residual),
            )
        )
    return orbits


def _period(walk: Walk, last: np.ndarray, candidates: dict[int, FixedPoint]) -> int | None:
    """The shortest period that the walk has settled to, or is settling to."""
    if not walk.up or len(last) < _LAST:
        return None
    for k in PERIODS:
        if np.max(np.abs(last[k:] - last[:-k])) <= _SETTLED and candidates[k].found:
            return k
    for k, candidate in candidates.items():
        moved = np.max(np.abs(last[k:] - last[:-k]))
        if candidate.found and np.max(np.abs(candidate.y - last[-1])) <= 100 * moved:
            if np.max(np.abs(np.linalg.eigvals(candidate.jacobian))) < 1:
                return k
    return None


def _free_orbit(loops: Loop, walk: Walk, last: np.ndarray) -> Orbit:
    """What a gait under the free clock repeats, up to how far it wanders."""
    if not walk.up or len(last) < _LAST:
        return _unsettled(loops, walk, last, "free")
    for k in PERIODS:
        classes = last.reshape(-1, k, 3)
        mean = classes.mean(axis=0)
        wander = np.abs(classes - mean).max(axis=(0, 1))
        if wander.max() <= _REPEATS:
            return _measured(loops, walk, "free", "periodic", k, mean, wander)
    return _unsettled(loops, walk, last, "free")


def _unsettled(loops: Loop, walk: Walk, last: np.ndarray, clock: Clock) -> Orbit:
    """A gait that repeats nothing, or none at all."""
    if walk.up and len(last) == _LAST:
        wander = np.abs(last - last.mean(axis=0)).max(axis=0)
        return _measured(loops, walk, clock, "wandering", 0, last[-1:], wander)
    nothing = float("nan")
    return Orbit(clock, "none", 0, (), (nothing,) * 3, nothing, nothing, nothing, nothing)


def _measured(
    loops: Loop, walk: Walk, clock: Clock, kind: Kind, k: int, points: np.ndarray, wander: np.ndarray
) -> Orbit:
    """Means over the last steps of a walk."""
    steps = _LAST - 1
    length = float(walk.touchdown_foot[-1] - walk.touchdown_foot[-_LAST])
    work = float(walk.touchdown_work[-1] - walk.touchdown_work[-_LAST])
    return Orbit(
        clock=clock,
        kind=kind,
        num_steps=k,
        points=_points(points),
        wander=tuple(wander.tolist()),
        period=float(walk.touchdown_time[-1] - walk.touchdown_time[-_LAST]) / steps,
        step_length=length / steps,
        cost_of_transport=_cost_of_transport(loops, work, length),
        residual=float("nan"),
    )


def _cost_of_transport(loops: Loop, work: float, length: float) -> float:
    p = loops.plant.parameters
    return work / ((p.hip_mass + 2 * p.leg_mass) * p.gravity * length) if length else float("nan")


def _points(points: np.ndarray) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(beta), float(one), float(two)) for beta, one, two in points)


@eqx.filter_jit
def _sample_walks(loops: Loop, starts: Float[Array, "walkers 4"], clock: Clock, seconds: float) -> Samples:
    return eqx.filter_vmap(lambda loop, x0: sample_walk(loop, x0, clock, seconds))(loops, starts)


@eqx.filter_jit
def _fixed_points(loops: Loop, guesses: Array, num_steps: Array) -> FixedPoint:
    return eqx.filter_vmap(lambda loop, guess: fixed_point(loop, guess, num_steps))(loops, guesses)


@eqx.filter_jit
def _laps(loops: Loop, starts: Float[Array, "walkers 3"]) -> Stride:
    return eqx.filter_vmap(partial(laps, num_steps=max(PERIODS)))(loops, starts)
