"""Look for a fall: a start or a disturbance within stated bounds that makes a plant fall.

A search that finds nothing proves nothing. One that finds a fall shows it only after SciPy has walked it once
more, by `resimulation.py`, with nothing of what the search ran on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from coachable.foundation.errors import ParameterError
from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import Clock
from coachable.verification.falsification.fall_search import (
    Fall,
    SearchResult,
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
    x0: Float[np.ndarray, " state"]
    disturbance: Float[np.ndarray, "steps control"]
    """Added to the controller's controls in the first control steps."""
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
    searches: tuple[SearchResult, SearchResult]
    """CMA-ES with restarts, and random search."""
    counterexamples: tuple[Counterexample, ...]
    """Confirmed by SciPy, the smallest perturbations first."""
    unconfirmed: tuple[Fall, ...]
    """What SciPy was given and did not see fall; they do not count."""

    @property
    def falsified(self) -> bool:
        """Whether the plant falls within the bounds."""
        return bool(self.counterexamples)


def falsify(
    plant: Plant,
    controller: Controller,
    perturbation: Perturbation,
    *,
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

    - `plant`, `controller`: a learned policy or one of the plant's written controllers.
    - `perturbation`: what the plant may meet, and within which bounds. Starts at which an event is admissible
      and its guard below zero (a foot in the ground ahead) count as walks, but never as falls.
    - `clock`, `seconds`: of the walks.
    - `budget`: how many walks each search may take.
    - `keep`: how many counterexamples are wanted; those nearest to the undisturbed walk are kept.
    - `seed`: the same one finds the same.
    - `progress`: called with (walks taken, walks in all) as the searches go on.

    **Raises:** `MissingExtraError` without the [verify] extra; `ParameterError` for a budget or a number of
    counterexamples that is not positive, for a perturbation that is not one of the plant's, and for a plant
    or a controller of which no fall could be confirmed.
    """
    require_cma()
    restated = plant.restated()
    numpy_controller(controller)  # refuses, before the search, one that SciPy could not walk with
    if restated is None:
        raise ParameterError(
            f"{plant.name} has no second statement for SciPy, so no fall of it could be confirmed; "
            "give it `restated`"
        )
    size = perturbation.size(plant)
    if budget < 1 or keep < 1:
        raise ParameterError(f"budget and keep must be at least 1, but they are {budget} and {keep}")
    with jax.enable_x64(True):
        walks = walks_of(plant, controller, perturbation, clock, seconds)
        walked = (lambda done: None) if progress is None else lambda done: progress(done, 2 * budget)
        directed = search("cma-es", cma_es(size, seed), walks, budget, walked)
        undirected = search(
            "random", at_random(size, seed), walks, budget, lambda done: walked(budget + done)
        )
    found = sorted((*directed.falls, *undirected.falls), key=lambda fall: np.max(np.abs(fall.point)))
    counterexamples, unconfirmed = [], []
    for fall in found[: _TRIES * keep]:
        starts, disturbances = perturbation.at(plant, fall.point[None])
        walk = resimulate(restated, controller, starts[0], disturbances[0], clock, seconds)
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
    plant: Plant,
    controller: Controller,
    section_point: Sequence[float] | None,
    *,
    clock: Clock = "free",
    budget: int = 2_000,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Falsification, ...]:
    """`falsify` with each of `usual_perturbations`: what a passport holds.

    **Arguments:** `section_point`, where the gait is right after touchdown, or `None`; `budget`, of each
    search of each; `progress`, called with (walks taken, walks in all); the rest as in `falsify`, and so is
    what is raised.
    """
    perturbations = usual_perturbations(plant, section_point)
    results, in_all = [], 2 * budget * len(perturbations)
    for perturbation in perturbations:
        before = 2 * budget * len(results)

        def walked(done: int, _: int, before: int = before) -> None:
            if progress is not None:
                progress(before + done, in_all)

        results.append(
            falsify(
                plant,
                controller,
                perturbation,
                clock=clock,
                budget=budget,
                seed=seed,
                progress=walked,
            )
        )
    return tuple(results)
