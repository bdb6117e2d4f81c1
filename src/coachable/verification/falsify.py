"""Look for a fall: a start or a disturbance within stated bounds that makes a walker fall.

A search that finds nothing proves nothing. One that finds a fall shows it only after SciPy has walked it once
more, by `resimulation.py`, with nothing of what the search ran on.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from coachable.envs.walking_task import NO_BOX, Clock, WalkingTask, make_task
from coachable.errors import MissingExtraError, ParameterError
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters
from coachable.rewards.setup import PAPER_SETUPS
from coachable.verification.margin import Controller, endurance
from coachable.verification.perturbation import Perturbation, Points, usual_perturbations
from coachable.verification.resimulation import Resimulation, numpy_controller, resimulate

Method = Literal["cma-es", "random"]
Walks = Callable[
    [Points], tuple[Float[np.ndarray, " walks"], Float[np.ndarray, " walks"], Bool[np.ndarray, " walks"]]
]

Proposals = Generator[Points, Float[np.ndarray, " walks"] | None, None]
"""Generation after generation of points; each is sent the margins of the one before."""

POPULATION = 16
"""Walks side by side: a generation of CMA-ES, and a batch of the random search."""
_FIRST_STEP = 0.4
"""Standard deviation of a first generation, in half-widths of the box."""
_TRIES = 4
"""So many falls for each counterexample wanted are given to SciPy at most."""


@dataclass(frozen=True, eq=False)
class Fall:
    """A walk of a search that ended in a fall."""

    found_by: Method
    point: Float[np.ndarray, " size"]
    """Where in the cube [−1, 1]ⁿ of the perturbation."""
    time: float
    """When it fell [s]."""


@dataclass(frozen=True, eq=False)
class Search:
    """What one search came to."""

    method: Method
    walks: int
    """How many walks it took: its budget."""
    least_margin: float
    """See `margin.py`; not above 0 if and only if there was a fall."""
    first_fall: int | None
    """Which of its walks was the first to fall, counted from 1, or None."""
    falls: tuple[Fall, ...]


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
    _require_cma()
    numpy_controller(controller)
    if budget < 1 or keep < 1:
        raise ParameterError(f"budget and keep must be at least 1, but they are {budget} and {keep}")
    with jax.enable_x64(True):
        walks = _walks(controller, perturbation, parameters, clock, seconds)
        told = (lambda done: None) if progress is None else lambda done: progress(done, 2 * budget)
        cma_es = _search("cma-es", _cma_es(perturbation.size, seed), walks, budget, told)
        at_random = _search(
            "random", _at_random(perturbation.size, seed), walks, budget, lambda done: told(budget + done)
        )
    found = sorted((*cma_es.falls, *at_random.falls), key=lambda fall: np.max(np.abs(fall.point)))
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
        searches=(cma_es, at_random),
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
    for search in result.searches:
        name = "CMA-ES with restarts" if search.method == "cma-es" else "random search"
        first = "no fall" if search.first_fall is None else f"first fall in walk {search.first_fall:,}"
        lines.append(f"  {name}, {search.walks:,} walks: {first}, least margin {search.least_margin:.3f}")
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


def _search(
    method: Method,
    proposals: Proposals,
    walks: Walks,
    budget: int,
    told: Callable[[int], None],
) -> Search:
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
        told(taken)
    return Search(method, taken, least, first_fall, tuple(falls))


def _cma_es(size: int, seed: int) -> Proposals:
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


def _at_random(size: int, seed: int) -> Proposals:
    generator = np.random.default_rng((seed, 1))
    while True:
        yield generator.uniform(-1, 1, (POPULATION, size))


def _walks(
    controller: Controller,
    perturbation: Perturbation,
    parameters: CompassParameters,
    clock: Clock,
    seconds: float,
) -> Walks:
    """From points of the cube to (margins, times, whether fallen), a full generation at a time."""
    setup = PAPER_SETUPS["sparse"]  # what is paid does not matter here
    task = make_task(setup, clock=clock, parameters=parameters, seconds=seconds, box=NO_BOX)

    def walks(points: Points):
        whole = np.concatenate([points, np.repeat(points[:1], POPULATION - len(points), axis=0)])
        margins, times, fell = map(
            np.asarray, _walk_all(task, controller, *map(jnp.asarray, perturbation.at(whole)))
        )
        count = len(points)
        return margins[:count], times[:count], fell[:count]

    return walks


@eqx.filter_jit
def _walk_all(
    task: WalkingTask,
    controller: Controller,
    starts: Float[Array, "walks 4"],
    disturbances: Float[Array, "walks steps 2"],
) -> tuple[Float[Array, " walks"], Float[Array, " walks"], Bool[Array, " walks"]]:
    """Margins, times, whether fallen. Compiled once for all walkers of a kind."""

    def walk(x0, push):
        walked = endurance(task, controller, x0, push)
        # The plant ignores a swing foot in the ground ahead until it has risen. Nobody can start like that.
        impossible = task.plant.can_touch_down(x0) & (task.plant.guard(x0) < 0)
        return jnp.where(impossible, 1, walked.margin), walked.time, walked.fell & ~impossible

    return jax.vmap(walk)(starts, disturbances)


def _require_cma() -> None:
    try:
        import cma  # noqa: F401
    except ImportError:
        raise MissingExtraError("falsification", "verify") from None
