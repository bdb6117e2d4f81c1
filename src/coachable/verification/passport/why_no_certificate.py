"""Why a closed loop has no gait to put a box around, in a sentence: what it does, and what is near."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import numpy as np

from coachable.foundation.suggestion import in_a_row
from coachable.learning.policy import Policy
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.gait.orbit import FixedPoint, Orbit, fixed_points, last_points
from coachable.verification.gait.stability import Stability, wanted_without_bounds
from coachable.verification.gait.walk import SampledWalk
from coachable.verification.labels import actuators

_GUESSES = 6
"""From so many of the last touchdowns Newton's method looks for a gait in which every step is alike."""
_LONGEST_PERIOD = 16
_REPEATED = 1e-9
_LAST_SECONDS = 10.0


def obstacles(
    loops: ClosedLoop,
    walks: Sequence[SampledWalk],
    orbits: Sequence[Orbit],
    stable: Sequence[Stability | None],
) -> list[str]:
    """What keeps each of stacked loops from a certificate; empty where a stable gait was found.

    Arguments: walks and orbits under the touchdown clock, and what is known of the orbits' stability. To be
    called under `jax.enable_x64(True)`.
    """
    settled = [found is not None and found.verdict == "stable" for found in stable]
    near = [None] * len(walks) if all(settled) else _gaits_near(loops, walks)
    return [
        ""
        if settled[lane]
        else _sentence(jax.tree.map(lambda leaf, i=lane: leaf[i], loops), *one, near[lane])
        for lane, one in enumerate(zip(walks, orbits, stable, strict=True))
    ]


def _sentence(
    loop: ClosedLoop, walk: SampledWalk, orbit: Orbit, stability: Stability | None, near: FixedPoint | None
) -> str:
    if stability is not None:
        return f"the gait is {stability.verdict}: its largest |λ| is {stability.largest:.3f}"
    reasons = [_what_it_does(walk, orbit)]
    if near is not None:
        values = np.abs(np.linalg.eigvals(near.jacobian))
        norm = f"largest |λ| {np.max(values):.3f}, ‖DP‖₂ {np.linalg.norm(near.jacobian, 2):.1f}"
        if np.max(values) < 1:
            reasons.append(f"a gait of equal steps that would hold ({norm}) is not reached from this start")
        else:
            reasons.append(f"a gait of equal steps is there, but deviations from it grow ({norm})")
    reasons.extend(_clipping(loop, walk))
    return "; ".join(reasons)


def _what_it_does(walk: SampledWalk, orbit: Orbit) -> str:
    if orbit.kind == "none":
        return "it stops walking" if walk.up else f"it falls after {walk.seconds:.2f} s"
    last = walk.section[-2 * _LONGEST_PERIOD :]
    for k in range(1, _LONGEST_PERIOD + 1):
        if np.max(np.abs(last[k:] - last[:-k])) <= _REPEATED:
            return f"it repeats itself only every {k} steps"
    return f"its steps, {orbit.step_length:.2f} m, never repeat (± {max(orbit.wander):.1e})"


def _gaits_near(loops: ClosedLoop, walks: Sequence[SampledWalk]) -> list[FixedPoint | None]:
    """Of the fixed points of P that Newton's method finds from each walk's last touchdowns, the calmest."""
    best: list[FixedPoint | None] = [None] * len(walks)
    sizes = [np.inf] * len(walks)
    for back in range(1, _GUESSES + 1):
        guesses = last_points(walks, back)
        for lane, found in enumerate(fixed_points(loops, guesses, np.ones(len(walks), int))):
            if found.found and (size := np.max(np.abs(np.linalg.eigvals(found.jacobian)))) < sizes[lane]:
                best[lane], sizes[lane] = found, size
    return best


def _clipping(loop: ClosedLoop, walk: SampledWalk) -> list[str]:
    """How much of the walk's end a clipped policy spends at its bounds, where it feeds nothing back."""
    if not (isinstance(loop.controller, Policy) and loop.controller.clips):
        return []
    late = np.append(walk.time[:-1] > walk.seconds - _LAST_SECONDS, False)
    wanted = wanted_without_bounds(loop, walk, late)
    beyond = (wanted < np.asarray(loop.controller.low)) | (wanted > np.asarray(loop.controller.high))
    names = actuators(loop.plant)
    if beyond.all():
        every = {1: "the torque stays", 2: "both torques stay"}.get(len(names), "all torques stay")
        return [f"{every} at a bound: nothing is fed back"]
    shares = [f"{share:.0f} % ({name})" for share, name in zip(100 * beyond.mean(axis=0), names, strict=True)]
    return [f"torque at a bound in {in_a_row(shares)} of the samples"]
