"""Look for a fall: a start or a disturbance within stated bounds that makes a walker fall.

A search that finds nothing proves nothing. One that finds a fall shows it only after SciPy has walked it once
more, by `resimulation.py`, with nothing of what the search ran on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from coachable.envs.walking_task import Clock
from coachable.foundation.errors import ParameterError
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters
from coachable.verification.falsification.fall_margin import Controller
from coachable.verification.falsification.fall_search import (
    Fall,
    Search,
    at_random,
    cma_es,
    require_cma,
    search,
    walks_of,
)
from coachable.verification.falsification.perturbation import Perturbation, usual_perturbations
from coachable.verification.falsification.resimulation import Resimulation, numpy_controller, resimulate

_TRIES = 4
"""So many falls for each counterexample wanted are given to SciPy at most."""


@dataclass(frozen=True, eq=False)
class Counterexample:
    """A fall that SciPy has walked once more, with the same end."""

    fall: Fall
    x0: Float[np.ndarray, "4"]
    disturbance: Float[np.ndarray, "steps 2"]
    """Torques added to the controller's in the first control steps [N m]."""
    walk: Resimulation
    """As SciPy has it."""

    @property
    def size(self) -> float:
        """How much of the perturbation's bounds it takes: 1 is all."""
        return float(np.max(np.abs(self.fall.point)))


@dataclass(frozen=True, eq=False)
class Falsification:
    """Two searches for a fall, at the same budget, and what was found."""

    perturbation: Perturbation
    clock: Clock
    seconds: float
    """How long each walk lasts, at most."""
    seed: int
    searches: tuple[Search, Search]
    """CMA-ES with restarts, and random search."""
    counterexamples: tuple[Counterexample, ...]
    """Confirmed by SciPy, the smallest perturbations first."""
    unconfirmed: tuple[Fall, ...]
    """What SciPy was given and did not see fall; they do not count."""

    @property
    def falsified(self) -> bool:
        """Whether the walker falls within the bounds."""
        return bool(self.counterexamples)


def falsify(
    controller: Controller,
    perturbation: Perturbation,
    *,
    parameters: CompassParameters = PAPER_PARAMETERS,
    clock: Clock = "free",
    seconds: float = 10.0,
    budget: int = 2_000,
    keep: int = 3,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Falsification:
    """Search for a fall by CMA-ES with restarts, and beside it at random, in float64 by the paper's rules.

    CMA-ES begins anew, somewhere else, wherever it has found a fall or comes no further.

    **Arguments:**

    - `controller`: a learned policy or one of the baselines.
    - `perturbation`: what the walker may meet, and within which bounds. Starts with the swing foot in the
      ground ahead of the stance foot are passed over: they count as walks, but never as falls.
    - `parameters`, `clock`, `seconds`: of the walks.
    - `budget`: how many walks each search may take.
    - `keep`: how many counterexamples are wanted; those nearest to the undisturbed walk are kept.
    - `seed`: the same one finds the same.
    - `progress`: called with (walks taken, walks in all) as the searches go on.

    **Raises:** `MissingExtraError` without the [verify] extra; `ParameterError` for a budget or a number of
    counterexamples that is not positive, and for a controller that could not be confirmed to fall.
    """
    require_cma()
    numpy_controller(controller)
    if budget < 1 or keep < 1:
        raise ParameterError(f"budget and keep must be at least 1, but they are {budget} and {keep}")
    with jax.enable_x64(True):
        walks = walks_of(controller, perturbation, parameters, clock, seconds)
        told = (lambda done: None) if progress is None else lambda done: progress(done, 2 * budget)
        directed = search("cma-es", cma_es(perturbation.size, seed), walks, budget, told)
        undirected = search(
            "random", at_random(perturbation.size, seed), walks, budget, lambda done: told(budget + done)
        )
    found = sorted((*directed.falls, *undirected.falls), key=lambda fall: np.max(np.abs(fall.point)))
    counterexamples, unconfirmed = [], []
    for fall in found[: _TRIES * keep]:
        starts, disturbances = perturbation.at(fall.point[None])
        walk = resimulate(controller, starts[0], disturbances[0], parameters, clock, seconds)
        if walk.fell:
            counterexamples.append(Counterexample(fall, starts[0], disturbances[0], walk))
        else:
            unconfirmed.append(fall)
        if len(counterexamples) == keep:
            break
    return Falsification(
        perturbation=perturbation,
        clock=clock,
        seconds=seconds,
        seed=seed,
        searches=(directed, undirected),
        counterexamples=tuple(counterexamples),
        unconfirmed=tuple(unconfirmed),
    )


def search_for_falls(
    controller: Controller,
    section_point: Sequence[float] | None,
    *,
    parameters: CompassParameters = PAPER_PARAMETERS,
    clock: Clock = "free",
    budget: int = 2_000,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Falsification, ...]:
    """`falsify` with each of `usual_perturbations`: what a passport holds.

    **Arguments:** `section_point`, where the walker's gait is right after touchdown, (β, θ̇1, θ̇2), or `None`;
    `budget`, of each search of each; `progress`, called with (walks taken, walks in all); the rest as in
    `falsify`, and so is what is raised.
    """
    perturbations = usual_perturbations(section_point)
    results, in_all = [], 2 * budget * len(perturbations)
    for perturbation in perturbations:
        before = 2 * budget * len(results)

        def told(done: int, _: int, before: int = before) -> None:
            if progress is not None:
                progress(before + done, in_all)

        results.append(
            falsify(
                controller,
                perturbation,
                parameters=parameters,
                clock=clock,
                budget=budget,
                seed=seed,
                progress=told,
            )
        )
    return tuple(results)


def summary_of(result: Falsification) -> str:
    """A falsification for people, a few lines."""
    lines = [f"Looked for a fall within {result.seconds:g} s: {result.perturbation.sentence}."]
    for one in result.searches:
        name = "CMA-ES with restarts" if one.method == "cma-es" else "random search"
        first = "no fall" if one.first_fall is None else f"first fall in walk {one.first_fall:,}"
        lines.append(f"  {name}, {one.walks:,} walks: {first}, least margin {one.least_margin:.3f}")
    for number, one in enumerate(result.counterexamples, start=1):
        lines.append(
            f"  counterexample {number}, found by {one.fall.found_by}: {one.size:.0%} of the bounds, "
            f"falls after {one.fall.time:.3f} s; SciPy: {one.walk.seconds:.3f} s"
        )
    if result.unconfirmed:
        lines.append(f"  {len(result.unconfirmed)} not confirmed by SciPy, and not counted")
    if not result.falsified:
        lines.append("  No counterexample. That is no proof: what was not tried may fall.")
    return "\n".join(lines)
