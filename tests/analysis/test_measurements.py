from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.analysis.measurements import Measurements, SetupRuns, measure, measure_tables
from coachable.analysis.measures import BESIDE_A_BASELINE
from coachable.experiments.plan import load_plan
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import schemas
from coachable.foundation.errors import RunFolderError
from coachable.rewards.setup import RewardSetup


def by_hand_plan(**options):
    plan = load_plan("paper", name="by-hand", steps=30_000, seeds={"first": 7, "count": 2}, **options)
    return replace(plan, setups=(RewardSetup(name="a-b"),))


BY_HAND = by_hand_plan()


def by_hand(**changes):
    """One setup, two seeds, three evaluations and a final one."""
    plan = BY_HAND
    evaluations = {
        "lane": ["a-b-8"] * 4 + ["a-b-7"] * 4,
        "step": [30_720, 10_000, 20_000, 30_000] * 2,
        "hip_x": [6.0, 1.0, 9.0, 5.0, 7.5, 1.0, 2.0, 3.0],
        "foot_x": [5.5, 0.5, 8.5, 4.5, 7.0, 0.5, 1.5, 2.5],
        "fell": [True, True, True, False, False, True, True, True],
        "share_in_cycle": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8],
    }
    episodes = {
        "lane": ["a-b-7", "a-b-8", "a-b-7", "a-b-8"],
        "end_step": [2_500, 400, 1_000, 28_000],
        "return": [4.0, -2.0, 6.0, 10.0],
    }
    survival = {"lane": ["a-b-8", "a-b-7"], "seconds_up": [3.0, 100.0], "perturbed_up": [0.1, 0.9]}
    baseline = {"hip_x": 4.0, "foot_x": 8.0, "returns": {"a-b": 2.0}}
    tables = [plan, baseline, *map(pa.table, (evaluations, episodes, survival))]
    for index, value in changes.items():
        tables[int(index[1:])] = value
    return tables


def test_runs_are_in_order_of_their_seeds_and_the_final_evaluation_is_apart():
    (setup,) = measure_tables(*by_hand()).setups
    assert setup.seeds.tolist() == [7, 8]
    assert setup.distance.tolist() == [[1.0, 2.0, 3.0], [1.0, 9.0, 5.0]]
    assert setup.final_distance.tolist() == [7.5, 6.0]
    assert setup.final_fell.tolist() == [False, True]
    assert setup.final_share_in_cycle.tolist() == [0.5, 0.1]
    assert setup.seconds_up.tolist() == [100.0, 3.0]
    assert setup.up_to_the_end.tolist() == [True, False]


def test_highest_counts_falls_and_beside_it_survivors_alone():
    (setup,) = measure_tables(*by_hand()).setups
    assert setup.highest.tolist() == [3.0, 9.0]
    assert setup.highest_surviving.tolist() == [5.0]
    assert setup.final_surviving.tolist() == [7.5]
    assert setup.highest_so_far.tolist() == [[1.0, 2.0, 3.0], [1.0, 9.0, 9.0]]
    assert setup.highest_of_all_runs.tolist() == [1.0, 9.0, 9.0]


def test_steps_to_baseline_are_the_first_passing_evaluation_or_all_steps():
    runs = measure_tables(*by_hand())
    assert runs.baseline_distance == 4.0
    assert runs.steps_to_baseline(runs["a-b"]).tolist() == [30_000.0, 20_000.0]
    assert runs.passes_baseline(runs["a-b"]).tolist() == [False, True]


def test_reaching_the_baseline_exactly_is_not_passing_it():
    runs = measure_tables(*by_hand(_1={"hip_x": 9.0, "foot_x": 8.0, "returns": {"a-b": 2.0}}))
    assert not runs.passes_baseline(runs["a-b"]).any()
    assert runs.steps_to_baseline(runs["a-b"]).tolist() == [30_000.0, 30_000.0]


def test_the_released_code_measures_the_stance_foot():
    released = by_hand_plan(semantics="released-code")
    runs = measure_tables(*by_hand(_0=released))
    assert runs.baseline_distance == 8.0
    assert runs["a-b"].highest.tolist() == [2.5, 8.5]


def test_returns_are_those_of_the_last_finished_episode_over_the_baseline_s():
    runs = measure_tables(*by_hand())
    first, second = runs["a-b"].returns
    assert runs.grid[:3].tolist() == [1_000, 2_000, 3_000]
    assert runs.grid[-1] == 30_000
    assert first[:3].tolist() == [3.0, 3.0, 2.0]
    assert second[[0, 26, 27, 29]].tolist() == [-1.0, -1.0, 5.0, 5.0]
    assert runs["a-b"].highest_return.tolist() == [3.0, 5.0]
    assert runs["a-b"].final_return.tolist() == [2.0, 5.0]


def test_before_the_first_finished_episode_there_is_no_return():
    late = pa.table({"lane": ["a-b-7", "a-b-8"], "end_step": [1_001, 900], "return": [1.0, 1.0]})
    (setup,) = measure_tables(*by_hand(_3=late)).setups
    assert np.isnan(setup.returns[:, 0]).tolist() == [True, False]
    assert not np.isnan(setup.returns[:, 1:]).any()


def test_a_baseline_that_earns_nothing_normalises_nothing():
    (setup,) = measure_tables(*by_hand(_1={"hip_x": 4.0, "foot_x": 8.0, "returns": {"a-b": -1.0}})).setups
    assert np.isnan(setup.returns).all()
    assert np.isnan(setup.final_return).all()


def test_without_a_survival_table_nobody_was_watched():
    (setup,) = measure_tables(*by_hand(_4=None)).setups
    assert not setup.watched_on
    assert np.isnan(setup.perturbed_up).all()


def test_the_rows_may_come_in_any_order(tables):
    plan, baseline, *rows = tables()
    shuffled = [table.take(np.random.default_rng(0).permutation(len(table))) for table in rows]
    for one, other in zip(
        measure_tables(plan, baseline, *rows).setups,
        measure_tables(plan, baseline, *shuffled).setups,
        strict=True,
    ):
        for name in vars(one):
            np.testing.assert_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("lacking", ["an evaluation", "all of them", "every episode"])
def test_an_unfinished_lane_is_named(tables, lacking):
    plan, baseline, evaluations, episodes, survival = tables()
    of_lane = pc.field("lane") == "forward-2"
    if lacking == "an evaluation":
        evaluations = evaluations.filter(~(of_lane & (pc.field("step") > 40_000)))
    elif lacking == "all of them":
        evaluations = evaluations.filter(~of_lane)
    else:
        episodes = episodes.filter(~of_lane)
    with pytest.raises(RunFolderError, match=r"lane forward-2 .*go on"):
        measure_tables(plan, baseline, evaluations, episodes, survival)


def test_a_run_folder_gives_what_its_tables_do(tmp_path, tables):
    plan, baseline, evaluations, episodes, survival = tables(("sparse", "mine"))
    for name, table in (("evaluations", evaluations), ("episodes", episodes), ("survival", survival)):
        zeros = np.zeros(len(table))
        columns = {
            field.name: table[field.name]
            if field.name in table.column_names
            else zeros.astype(field.type.to_pandas_dtype())
            for field in schemas(plan)[name]
        }
        pq.write_table(pa.table(columns).cast(schemas(plan)[name]), tmp_path / f"{name}.parquet")
    manifest = {"status": "complete", "baseline": baseline, "files": {}}
    run = Run(tmp_path, plan, manifest)
    expected = measure_tables(plan, baseline, evaluations, episodes, survival)
    found = measure(run)
    assert found.setup_names == ("sparse", "mine")
    for name in ("distance", "returns", "perturbed_up"):  # the folder keeps float32
        np.testing.assert_allclose(getattr(found["mine"], name), getattr(expected["mine"], name), rtol=1e-6)


@given(st.lists(st.integers(1, 60), min_size=1, max_size=12))
def test_the_mean_of_the_steps_is_the_area_under_the_survival_curve(first_passes):
    """∫₀ᵀ S(t) dt, S(t) the share of runs that have not passed by t, is what a restricted mean is."""
    checkpoints = np.arange(1, 51)
    distance = (checkpoints >= np.array(first_passes)[:, None]).astype(float)
    each, nothing = np.zeros(len(distance)), np.zeros((len(distance), 1))
    setup = SetupRuns(
        name="a-b",
        seeds=np.arange(len(distance)),
        evaluations={"distance": distance},
        final={"distance": each},
        returns=nothing,
        highest_return=each,
        final_return=each,
    )
    runs = Measurements(BY_HAND, 50, checkpoints, checkpoints, BESIDE_A_BASELINE, 0.5, (setup,))
    not_yet = [np.mean([t < passes for passes in first_passes]) for t in range(50)]
    assert runs.steps_to_baseline(setup).mean() == pytest.approx(sum(not_yet))
