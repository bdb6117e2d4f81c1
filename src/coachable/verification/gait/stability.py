"""Floquet multipliers of a periodic orbit, with what is known of their error, and the kinks near it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.learning.policy import Policy
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.gait.orbit import Orbit, follow
from coachable.verification.gait.section import states_at
from coachable.verification.gait.walk import SampledWalk, settle

StabilityVerdict = Literal["stable", "unstable", "undecided"]

EXACTLY = 1e-6
"""An orbit touches a kink exactly if it comes so near: in units of a control's bound, in s of a sample."""

_DIFFERENCE = 1e-6
"""Step of the central differences, in the units of the section."""
_ROUNDING = 1e-12

_Kinks = tuple[int, tuple[int, ...], float | None, float | None]
"""`num_samples`, `num_clipped`, `clip_margin` and `sample_margin` of a `Stability`."""


@dataclass(frozen=True)
class Stability:
    """The multipliers of Pᵏ at a periodic orbit of k steps under the touchdown clock.

    Where the controller has a memory, P maps what it remembers, too. Its real numbers, such as the time since
    a phase is expected, have multipliers like the state's; phases are the same after the period.
    """

    multipliers: tuple[complex, ...]
    """Eigenvalues of DPᵏ, largest modulus first."""
    errors: tuple[float, ...]
    """For each a bound on its numerical error: the condition of the eigenvectors times the change of DPᵏ when
    the integrator's steps are halved (Bauer and Fike, 1960). An estimate, not a proof."""
    norm: float
    """‖DPᵏ‖₂, how much a deviation can grow in one period before it shrinks."""
    disagreement: float
    """Largest difference of an entry of DPᵏ from central differences of width 1e-6."""
    num_samples: int
    """Samples in one period."""
    num_clipped: tuple[int, ...]
    """In how many of them each control wanted is beyond its bounds."""
    clip_margin: float | None
    """The nearest that a control wanted comes to one of its bounds; `None` if nothing is clipped."""
    sample_margin: float | None
    """The shortest time between a touchdown and a sample taken or due then [s]; `None` if continuous."""

    @property
    def largest(self) -> float:
        """The largest modulus."""
        return abs(self.multipliers[0])

    @property
    def error(self) -> float:
        """The largest error bound."""
        return max(self.errors)

    @property
    def verdict(self) -> StabilityVerdict:
        """`stable` only if every modulus is below 1 by more than its error bound."""
        sizes = [
            (abs(multiplier), error) for multiplier, error in zip(self.multipliers, self.errors, strict=True)
        ]
        if all(size + error < 1 for size, error in sizes):
            return "stable"
        return "unstable" if any(size - error > 1 for size, error in sizes) else "undecided"

    @property
    def kinks(self) -> tuple[str, ...]:
        """What makes Pᵏ not differentiable at the orbit, as far as it was seen."""
        found = []
        if self.clip_margin is not None and self.clip_margin <= EXACTLY:
            found.append("a wanted torque lies exactly on its bound")
        if self.sample_margin is not None and self.sample_margin <= EXACTLY:
            found.append("a touchdown falls exactly on a sample")
        return tuple(found)


def stabilities(loops: ClosedLoop, orbits: Sequence[Orbit]) -> list[Stability | None]:
    """The stability of each of stacked loops' orbits; `None` for what is not periodic.

    To be called under `jax.enable_x64(True)`, with orbits under the touchdown clock.
    """
    periods = np.array([orbit.num_steps for orbit in orbits])
    if not periods.any():
        return [None] * len(orbits)
    size, real = len(loops.plant.section_names), loops.continuous
    points = np.full((len(orbits), len(real)), np.nan)
    for lane, orbit in enumerate(orbits):
        if orbit.num_steps:
            points[lane] = (*orbit.points[0], *(orbit.memories[0] if orbit.memories else ()))
    _, coarse, _ = follow(loops, points, periods)
    _, fine, _ = follow(loops, points, periods, refinement=2)
    differences = _central_differences(loops, points, periods)
    fine, coarse, differences = (each[:, real][:, :, real] for each in (fine, coarse, differences))
    starts = states_at(loops.plant, points[:, :size])
    walks = settle(loops, starts, "touchdown", memories=points[:, size:])
    return [
        None
        if not orbit.num_steps
        else _stability(
            fine[lane],
            coarse[lane],
            differences[lane],
            _kinks(jax.tree.map(lambda leaf, i=lane: leaf[i], loops), orbit, walks[lane]),
        )
        for lane, orbit in enumerate(orbits)
    ]


def multipliers_with_errors(
    jacobian: Float[np.ndarray, "point point"], change: float
) -> tuple[tuple[complex, ...], tuple[float, ...]]:
    """Eigenvalues, largest first, and how far each may be off if the matrix is off by `change` in ‖·‖₂."""
    values, vectors = np.linalg.eig(jacobian)
    bound = float(np.linalg.cond(vectors)) * change
    order = np.argsort(-np.abs(values))
    return tuple(complex(value) for value in values[order]), (bound,) * len(values)


def _stability(
    jacobian: np.ndarray,
    coarse: np.ndarray,
    differences: np.ndarray,
    kinks: _Kinks,
) -> Stability:
    norm = float(np.linalg.norm(jacobian, 2))
    change = float(np.linalg.norm(jacobian - coarse, 2)) + _ROUNDING * norm
    multipliers, errors = multipliers_with_errors(jacobian, change)
    num_samples, num_clipped, clip_margin, sample_margin = kinks
    return Stability(
        multipliers=multipliers,
        errors=errors,
        norm=norm,
        disagreement=float(np.max(np.abs(coarse - differences))),
        num_samples=num_samples,
        num_clipped=num_clipped,
        clip_margin=clip_margin,
        sample_margin=sample_margin,
    )


def _kinks(loop: ClosedLoop, orbit: Orbit, walk: SampledWalk) -> _Kinks:
    """Samples in one period, how many are clipped, and the margins to the nearest kinks."""
    none_clipped = (0,) * len(loop.plant.control_names)
    if loop.hold == "continuous":
        return 0, none_clipped, None, None
    touchdowns = walk.touchdown_time[: orbit.num_steps]
    taken = walk.time < touchdowns[-1] - 1e-12
    held = np.diff(np.concatenate([[0.0], touchdowns]))
    rest = np.mod(held, loop.control_dt)
    sample_margin = float(np.min(np.minimum(rest, loop.control_dt - rest)))
    if not (isinstance(loop.controller, Policy) and loop.controller.clips):
        return int(taken.sum()), none_clipped, None, sample_margin
    wanted = wanted_without_bounds(loop, walk, taken)
    low, high = np.asarray(loop.controller.low), np.asarray(loop.controller.high)
    clipped = ((wanted < low) | (wanted > high)).sum(axis=0)
    margin = np.minimum(np.abs(wanted - low), np.abs(wanted - high))
    return int(taken.sum()), tuple(clipped.tolist()), float(margin.min()), sample_margin


def without_bounds(policy: Policy) -> Policy:
    """A clipped policy before its controls are clipped."""
    return eqx.tree_at(
        lambda policy: (policy.low, policy.high), policy, (policy.low - jnp.inf, policy.high + jnp.inf)
    )


def wanted_without_bounds(
    loop: ClosedLoop, walk: SampledWalk, rows: Bool[np.ndarray, " samples"]
) -> Float[np.ndarray, "rows control"]:
    """What a clipped policy asks for in some rows of a walk, before its controls are clipped."""
    bare = replace(loop, controller=without_bounds(cast(Policy, loop.controller)))

    def wanted(x, memory):
        return bare.wanted(x, bare.recalled(memory))

    return np.asarray(jax.vmap(wanted)(jnp.asarray(walk.x[rows]), jnp.asarray(walk.memory[rows])))


def _central_differences(
    loops: ClosedLoop, points: Float[np.ndarray, "walkers point"], periods: Int[np.ndarray, " walkers"]
) -> Float[np.ndarray, "walkers point point"]:
    def mapped(points):
        return follow(loops, points, periods)[0]

    columns = [
        (mapped(points + step) - mapped(points - step)) / (2 * _DIFFERENCE)
        for step in _DIFFERENCE * np.eye(points.shape[1])
    ]
    return np.stack(columns, axis=-1)
