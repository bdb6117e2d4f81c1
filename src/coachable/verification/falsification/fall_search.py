"""Two ways to look for a fall: CMA-ES with restarts, which follows the margin, and at random."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from coachable.foundation.errors import MissingExtraError
from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import Clock
from coachable.verification.falsification.fall_margin import endurance
from coachable.verification.falsification.perturbation import Perturbation, Points

Method = Literal["cma-es", "random"]

Walks = Callable[
    [Points], tuple[Float[np.ndarray, " walks"], Float[np.ndarray, " walks"], Bool[np.ndarray, " walks"]]
]
"""From points of the cube to the walks' margins, their times [s], and whether they fell."""

Proposals = Generator[Points, Float[np.ndarray, " walks"] | None, None]
"""Generation after generation of points; each is sent the margins of the one before."""

POPULATION = 16
"""Walks side by side: a generation of CMA-ES, and a batch of the random search."""
_FIRST_STEP = 0.4
"""Standard deviation of a first generation, in half-widths of the box."""


@dataclass(frozen=True, eq=False)
class Fall:
    """A walk of a search that ended in a fall."""

    found_by: Method
    point: Float[np.ndarray, " size"]
    """Where in the cube [−1, 1]ⁿ of the perturbation."""
    time: float
    """When it fell [s]."""


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The result of one search."""

    method: Method
    walks: int
    """How many walks it took: its budget."""
    least_margin: float
    """See `fall_margin.py`; not above 0 if and only if there was a fall."""
    first_fall: int | None
    """Which of its walks was the first to fall, counted from 1, or None."""
    falls: tuple[Fall, ...]


def search(
    method: Method,
    proposals: Proposals,
    walks: Walks,
    budget: int,
    progress: Callable[[int], None],
) -> SearchResult:
    """Walk what is proposed, generation by generation, until exactly the budget is spent."""
    taken, least, first_fall, falls = 0, np.inf, None, []
    margins: Float[np.ndarray, " walks"] | None = None
    while taken < budget:
        points = proposals.send(margins)[: budget - taken]
        margins, times, fell = walks(points)
        least = min(least, float(margins.min()))
        if first_fall is None and fell.any():
            first_fall = taken + int(np.argmax(fell)) + 1
        falls += [Fall(method, points[k], float(times[k])) for k in np.flatnonzero(fell)]
        taken += len(points)
        progress(taken)
    return SearchResult(method, taken, least, first_fall, tuple(falls))


def cma_es(size: int, seed: int) -> Proposals:
    """Generations of CMA-ES, which is sent their margins; begun anew after a fall and where it stalls."""
    import cma

    generator = np.random.default_rng((seed, 0))
    options = {
        "bounds": [-1, 1],
        "popsize": POPULATION,
        # Fewer numbers to learn where there are many: then the axes of the ellipsoid stay those of the cube.
        "CMA_diagonal": size > 2 * POPULATION,
        "randn": lambda *shape: generator.standard_normal(shape),
        "seed": np.nan,
        # A descent that moves or gains less than this is over; there are other places to begin.
        "tolx": 1e-2,
        "tolfun": 1e-3,
        "verbose": -9,
    }
    while True:
        descent = cma.CMAEvolutionStrategy(generator.uniform(-1, 1, size), _FIRST_STEP, options)
        least = np.inf
        while least > 0 and not descent.stop():
            points = np.array(descent.ask())
            margins = yield points
            assert margins is not None
            descent.tell(list(points), margins.tolist())
            least = margins.min()


def at_random(size: int, seed: int) -> Proposals:
    """Even draws from the cube."""
    generator = np.random.default_rng((seed, 1))
    while True:
        yield generator.uniform(-1, 1, (POPULATION, size))


def walks_of(
    plant: Plant,
    controller: Controller,
    perturbation: Perturbation,
    clock: Clock,
    seconds: float,
) -> Walks:
    """From points of the cube to (margins, times, whether fallen), a full generation at a time."""

    def walks(points: Points):
        whole = np.concatenate([points, np.repeat(points[:1], POPULATION - len(points), axis=0)])
        starts, disturbances = map(jnp.asarray, perturbation.at(plant, whole))
        margins, times, fell = map(
            np.asarray, _walk_all(plant, controller, starts, disturbances, clock, seconds)
        )
        count = len(points)
        return margins[:count], times[:count], fell[:count]

    return walks


@eqx.filter_jit
def _walk_all(
    plant: Plant,
    controller: Controller,
    starts: Float[Array, "walks state"],
    disturbances: Float[Array, "walks steps control"],
    clock: Clock,
    seconds: float,
) -> tuple[Float[Array, " walks"], Float[Array, " walks"], Bool[Array, " walks"]]:
    """Margins, times, whether fallen. Compiled once for all closed loops of a kind."""

    def walk(x0, push):
        walked = endurance(plant, controller, x0, push, clock, seconds)
        # An event whose guard has fallen below zero before is ignored until it has risen: no robot stands so.
        impossible = jnp.zeros((), bool)
        for event in plant.events:
            impossible |= event.admissible(x0) & (event.guard(x0) < 0)
        return jnp.where(impossible, 1, walked.margin), walked.time, walked.fell & ~impossible

    return jax.vmap(walk)(starts, disturbances)


def require_cma() -> None:
    """**Raises:** `MissingExtraError` without the [verify] extra."""
    try:
        import cma  # noqa: F401
    except ImportError:
        raise MissingExtraError("falsification", "verify") from None
