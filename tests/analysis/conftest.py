"""Studies that never ran: tables with known content, and the measurements in them."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from coachable.analysis import intervals, significance
from coachable.analysis.measurements import Measurements, SetupRuns, measure_tables
from coachable.analysis.measures import BESIDE_A_BASELINE
from coachable.experiments.plan import load_plan
from coachable.rewards.setup import RewardSetup

PAPER = ("sparse", "forward", "orthant", "forward+orthant")


def tables(setups=PAPER, *, num_seeds=4, steps=50_000, survival=True, semantics="paper", seed=0):
    """The arguments of `measure_tables`: walkers that learn to walk, the later setups a little better."""
    rng = np.random.default_rng(seed)
    names = tuple(RewardSetup(name=name) for name in setups)
    plan = load_plan("paper", name="made-up", steps=steps, seeds=num_seeds, semantics=semantics)
    plan = replace(plan, setups=names)
    baseline = {"hip_x": 7.8, "foot_x": 7.6, "returns": {name: 8.0 + 2 * k for k, name in enumerate(setups)}}
    steps_of_evaluations = [*range(10_000, steps + 1, 10_000), 2048 * plan.num_updates]
    evaluations, episodes, survivals = [], [], []
    for order, lane in enumerate(plan.lanes):
        skill = 8 + 0.2 * (order // num_seeds) + rng.normal(0, 0.2)
        for step in steps_of_evaluations:
            share = min(1.0, step / 30_000) * rng.uniform(0.9, 1)
            evaluations.append((lane.name, step, skill * share, skill * share - 0.2, share < 0.6, share))
        ends = np.cumsum(rng.integers(200, 1000, size=steps // 500))
        for end in ends[ends < steps]:
            episodes.append((lane.name, end, 9 * min(1.0, end / 30_000) + rng.normal()))
        survivals.append((lane.name, rng.choice([100.0, 40.0]), rng.uniform(0.5, 1)))
    return (
        plan,
        baseline,
        _table(evaluations, ("lane", "step", "hip_x", "foot_x", "fell", "share_in_cycle")),
        _table(episodes, ("lane", "end_step", "return")),
        _table(survivals, ("lane", "seconds_up", "perturbed_up")) if survival else None,
    )


def _table(rows, names):
    return pa.table(dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)))


def measured(**samples):
    """Measurements whose Highest(run), final distances and the rest are given; what is not given is noise."""
    rng = np.random.default_rng(1)
    size = len(next(iter(samples.values()))["highest"])

    def setup_runs(name, given):
        noise = {key: rng.normal(8, 0.3, size) for key in ("highest", "final", "seconds_up", "perturbed_up")}
        values = noise | {"passes_at": np.full(size, 100_000)} | given
        checkpoints = np.arange(10_000, 500_001, 10_000)
        walks = checkpoints >= np.asarray(values["passes_at"])[:, None]
        distance = np.where(walks, values["highest"][:, None], 0.0)
        nothing = np.zeros((size, 1))
        return SetupRuns(
            name=name,
            seeds=np.arange(size),
            evaluations={
                "distance": distance,
                "fell": np.zeros(distance.shape),
                "share_in_cycle": np.ones(distance.shape),
            },
            final={
                "distance": values["final"],
                "fell": np.zeros(size),
                "share_in_cycle": np.ones(size),
                "seconds_up": values["seconds_up"],
                "perturbed_up": values["perturbed_up"],
            },
            returns=nothing,
            highest_return=nothing[:, 0],
            final_return=nothing[:, 0],
        )

    return Measurements(
        experiment=load_plan("paper", name="made-up"),
        steps=500_000,
        checkpoints=np.arange(10_000, 500_001, 10_000),
        grid=np.array([1000]),
        measures=BESIDE_A_BASELINE,
        baseline_distance=7.0,
        setups=tuple(setup_runs(name.replace("_", "+"), given) for name, given in samples.items()),
    )


@pytest.fixture(scope="module")
def quick():
    """A tenth of the resamples, for tests that need many or do not look at the last digit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(intervals, "RESAMPLES", 999)
        patch.setattr(significance, "RESAMPLES", 999)
        yield


@pytest.fixture(name="tables", scope="session")
def tables_fixture():
    return tables


@pytest.fixture(name="measured", scope="session")
def measured_fixture():
    return measured


@pytest.fixture(scope="session")
def small_study():
    return measure_tables(*tables())
