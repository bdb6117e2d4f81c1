"""The periodic orbit that a closed loop settles to: run to the attractor, then Newton on the return map."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from coachable.plants.metered import has_power
from coachable.plants.sampled import Clock
from coachable.verification.gait.closed_loop import ClosedLoop, stacked
from coachable.verification.gait.section import Stride, linearised
from coachable.verification.gait.walk import SampledWalk

PERIODS = (1, 2, 4)
"""How many steps a gait may take until it repeats itself, to be found as a periodic orbit."""

RESIDUAL = 1e-11
"""Largest |Pᵏ(y) − y| of a fixed point, in the units of the section."""

_NEWTON_STEPS = 12
_LAST = 32
"""From so many of the last touchdowns it is decided what a gait has settled to."""
_SETTLED = 1e-9
_NEARER = 0.9
"""A walk is still settling to an orbit if it came so much nearer over those touchdowns."""
_REPEATS = 1e-3
"""Up to here a gait under the free clock counts as repeating itself."""

Kind = Literal["periodic", "wandering", "none"]


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """A zero of Pᵏ(y) − y, or where Newton's method gave up."""

    y: Float[np.ndarray, " point"]
    """See `ClosedLoop.point`."""
    residual: float
    """Largest component of |Pᵏ(y) − y|; NaN where the plant falls."""
    jacobian: Float[np.ndarray, "point point"]
    """DPᵏ(y)."""
    strides: tuple[Stride, ...]
    """The k steps that start at y."""

    @property
    def found(self) -> bool:
        """Whether it is one, to `RESIDUAL`."""
        return self.residual <= RESIDUAL


def fixed_point(loop: ClosedLoop, guess: Sequence[float] | np.ndarray, num_steps: int = 1) -> FixedPoint:
    """Newton's method for Pᵏ(y) = y under the touchdown clock, with the derivative of `linearised`.

    Arguments: guess, a point of the return map near the fixed point; num_steps, k. To be called under
    `jax.enable_x64(True)`; nothing is raised, `found` says whether it converged.
    """
    return fixed_points(stacked([loop]), np.array([guess]), np.array([num_steps]))[0]


def fixed_points(
    loops: ClosedLoop, guesses: Float[np.ndarray, "walkers point"], num_steps: Int[np.ndarray, " walkers"]
) -> list[FixedPoint]:
    """`fixed_point` of stacked loops, side by side, each with its guess and its k."""
    at = np.array(guesses, np.float64)
    unit = np.eye(at.shape[1])
    for taken in range(_NEWTON_STEPS + 1):
        after, jacobians, steps = follow(loops, at, num_steps)
        residuals = np.max(np.abs(after - at), axis=1)
        improvable = residuals > 0.01 * RESIDUAL
        if taken == _NEWTON_STEPS or not improvable.any():
            break
        for lane in np.flatnonzero(improvable):
            at[lane] += np.linalg.lstsq(unit - jacobians[lane], after[lane] - at[lane], rcond=None)[0]
    return [
        FixedPoint(y, float(residual), jacobian, tuple(mine))
        for y, residual, jacobian, mine in zip(at, residuals, jacobians, steps, strict=True)
    ]


def follow(
    loops: ClosedLoop,
    points: Float[np.ndarray, "walkers point"],
    num_steps: Int[np.ndarray, " walkers"],
    refinement: int = 1,
) -> tuple[Float[np.ndarray, "walkers point"], Float[np.ndarray, "walkers point point"], list[list[Stride]]]:
    """Pᵏ and DPᵏ at each walker's point of the return map, and the strides on the way; NaN after a fall."""
    y = np.array(points, np.float64)
    jacobians = np.tile(np.eye(y.shape[1]), (len(y), 1, 1))
    steps: list[list[Stride]] = [[] for _ in y]
    for step in range(int(np.max(num_steps, initial=0))):
        taken, derivatives = jax.device_get(_strides(loops, jnp.asarray(y), jnp.asarray(refinement)))
        for lane in np.flatnonzero(num_steps > step):
            mine = jax.tree.map(lambda leaf, lane=lane: leaf[lane], taken)
            steps[lane].append(mine)
            y[lane] = mine.y if mine.landed else np.nan
            jacobians[lane] = derivatives[lane] @ jacobians[lane]
    return y, jacobians, steps


@eqx.filter_jit
def _strides(
    loops: ClosedLoop, points: Float[Array, "walkers point"], refinement: Int[Array, ""]
) -> tuple[Stride, Float[Array, "walkers point point"]]:
    # The one program behind orbits and multipliers: what is built on it is done in NumPy, since nested loops
    # of derivatives take XLA a minute to compile.
    return eqx.filter_vmap(lambda loop, y: linearised(loop, y, refinement))(loops, points)


@dataclass(frozen=True)
class Orbit:
    """The gait that a closed loop settles to under one clock.

    `periodic` repeats itself every `num_steps` steps: under the touchdown clock to rounding, under the free
    clock up to `wander`, for there the gait depends on where in a sample the touchdown falls. `wandering`
    goes on without repeating itself (quasi-periodic, chaotic, or of a longer period than `PERIODS`). `none`
    falls or stands still.
    """

    clock: Clock
    kind: Kind
    num_steps: int
    """k of a periodic gait, else 0."""
    points: tuple[tuple[float, ...], ...]
    """The k points on the section of a periodic gait (means under the free clock), else the last one seen."""
    wander: tuple[float, ...]
    """Largest distance in β [rad], θ̇1, θ̇2 [rad/s] of a section point from its mean over the last steps."""
    period: float
    """From touchdown to touchdown, mean over the steps of the orbit, or the last ones [s]."""
    step_length: float
    """Likewise [m]."""
    cost_of_transport: float
    """∫ Σ |τ ω| dt / (weight · d), d the distance walked meanwhile; NaN where the plant has no power."""
    residual: float
    """|Pᵏ(y) − y| of a periodic orbit under the touchdown clock, else NaN."""
    memories: tuple[tuple[float, ...], ...] = ()
    """What the controller remembers at each of the points of a periodic orbit under the touchdown clock, as
    `ClosedLoop.numbers`; none of a state feedback."""

    @property
    def speed(self) -> float:
        """step_length / period [m/s]."""
        return self.step_length / self.period


def find_orbits(loops: ClosedLoop, walks: Sequence[SampledWalk], clock: Clock) -> list[Orbit]:
    """The gaits of stacked loops that settled so.

    Under the touchdown clock Newton's method starts where each walk ended, for every k of `PERIODS`. The
    shortest period counts to which the walk had settled, or else, where it was still on its way, the
    shortest with a stable fixed point that it came nearer to.
    """
    lasts = [walk.section[-_LAST:] for walk in walks]
    if clock == "free":
        return [_free_orbit(loops, walk, last) for walk, last in zip(walks, lasts, strict=True)]
    guesses = last_points(walks)
    some_walk = any(walk.up for walk in walks)  # else nothing needs to be compiled
    found = {k: fixed_points(loops, guesses, np.full(len(walks), k)) for k in PERIODS if some_walk}
    orbits = []
    for lane, (walk, last) in enumerate(zip(walks, lasts, strict=True)):
        candidates = {k: points[lane] for k, points in found.items()}
        k = _period(walk, last, candidates)
        if k is None:
            orbits.append(_unsettled(loops, walk, last, clock))
            continue
        mine, size = candidates[k], last.shape[1]
        points = np.stack([mine.y, *(step.y for step in mine.strides[:-1])])
        length = float(sum(step.length for step in mine.strides))
        orbits.append(
            Orbit(
                clock=clock,
                kind="periodic",
                num_steps=k,
                points=_points(points[:, :size]),
                wander=(0.0,) * size,
                period=float(np.mean([step.time for step in mine.strides])),
                step_length=length / k,
                cost_of_transport=_cost_of_transport(
                    loops, float(sum(step.work for step in mine.strides)), length
                ),
                residual=mine.residual,
                memories=_points(points[:, size:]) if points.shape[1] > size else (),
            )
        )
    return orbits


def last_points(walks: Sequence[SampledWalk], back: int = 1) -> Float[np.ndarray, "walkers point"]:
    """Of the return map, where each walk's last touchdown was, or an earlier one; NaN without it."""
    points = [np.hstack([walk.section, walk.section_memory]) for walk in walks]
    return np.stack([one[-back] if len(one) >= back else np.full(one.shape[1], np.nan) for one in points])


def _period(walk: SampledWalk, last: np.ndarray, candidates: dict[int, FixedPoint]) -> int | None:
    """The shortest period that the walk has settled to, or is settling to."""
    if not walk.up or len(last) < _LAST:
        return None
    for k in PERIODS:
        if np.max(np.abs(last[k:] - last[:-k])) <= _SETTLED and candidates[k].found:
            return k
    for k, candidate in candidates.items():
        distance = np.max(np.abs(last[::-1][::k] - candidate.y[: last.shape[1]]), axis=1)  # latest first
        approaches = candidate.found and distance[0] <= _NEARER * distance[-1]
        if approaches and np.max(np.abs(np.linalg.eigvals(candidate.jacobian))) < 1:
            return k
    return None


def _free_orbit(loops: ClosedLoop, walk: SampledWalk, last: np.ndarray) -> Orbit:
    """What a gait under the free clock repeats, up to how far it wanders."""
    if not walk.up or len(last) < _LAST:
        return _unsettled(loops, walk, last, "free")
    for k in PERIODS:
        classes = last.reshape(-1, k, last.shape[1])
        mean = classes.mean(axis=0)
        wander = np.abs(classes - mean).max(axis=(0, 1))
        if wander.max() <= _REPEATS:
            return _measured(loops, walk, "free", "periodic", k, mean, wander)
    return _unsettled(loops, walk, last, "free")


def _unsettled(loops: ClosedLoop, walk: SampledWalk, last: np.ndarray, clock: Clock) -> Orbit:
    """A gait that repeats nothing, or none at all."""
    if walk.up and len(last) == _LAST:
        wander = np.abs(last - last.mean(axis=0)).max(axis=0)
        return _measured(loops, walk, clock, "wandering", 0, last[-1:], wander)
    nothing = float("nan")
    return Orbit(clock, "none", 0, (), (nothing,) * last.shape[1], nothing, nothing, nothing, nothing)


def _measured(
    loops: ClosedLoop,
    walk: SampledWalk,
    clock: Clock,
    kind: Kind,
    k: int,
    points: np.ndarray,
    wander: np.ndarray,
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
        wander=_points(wander[None])[0],
        period=float(walk.touchdown_time[-1] - walk.touchdown_time[-_LAST]) / steps,
        step_length=length / steps,
        cost_of_transport=_cost_of_transport(loops, work, length),
        residual=float("nan"),
    )


def _cost_of_transport(loops: ClosedLoop, work: float, length: float) -> float:
    if not (length and has_power(loops.plant)):
        return float("nan")
    return work / (loops.plant.weight * length)


def _points(points: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, point)) for point in points)
