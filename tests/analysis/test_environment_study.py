"""Studies of Gymnasium environments: measures are those of the tables, and only what is alike is compared."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from coachable.analysis.comparison import Pair, compared, pairs, shared_measures, write_comparison
from coachable.analysis.figures import figures
from coachable.analysis.measurements import measure, measure_so_far, measure_tables
from coachable.analysis.measures import IN_CYCLE, Measure
from coachable.analysis.sections import sections
from coachable.analysis.statistics import mean_curve
from coachable.experiments.run_folder.reader import open_run
from coachable.foundation.errors import RunFolderError

pytestmark = pytest.mark.usefixtures("quick")

RESULTS = Path(__file__).parents[2] / "docs" / "results"
HOP = RESULTS / "walker2d" / "hop"
BOTH = Pair("both", "both")


@pytest.fixture(scope="module")
def hop():
    return measure(open_run(HOP))


@pytest.fixture(scope="module")
def hop_alone():
    return measure(open_run(RESULTS / "walker2d" / "hop-described"))


@pytest.fixture(scope="module")
def hop_back():
    return measure(open_run(RESULTS / "hopper" / "hop-back"))


def named(runs, column):
    return next(one for one in runs.evaluated if one.column == column)


def test_every_measure_is_the_mean_over_the_episodes_of_an_evaluation(hop):
    (setup,) = hop.setups
    rows = pq.read_table(HOP / "evaluations.parquet").to_pandas()
    assert {one.column for one in hop.evaluated} == {*rows.columns} - {"lane", "step", "episode", "return"}
    assert hop.checkpoints[-1] == hop.steps < rows.step.max()
    for one in hop.evaluated:
        means = rows.astype({one.column: float}).groupby(["lane", "step"])[one.column].mean().unstack()
        means = means.loc[[f"both-{seed}" for seed in setup.seeds]].to_numpy()
        np.testing.assert_allclose(setup.values(one), means[:, :-1], rtol=1e-5)
        np.testing.assert_allclose(setup.last(one), means[:, -1], rtol=1e-5)
        np.testing.assert_allclose(mean_curve(hop, setup, one).value, means[:, :-1].mean(axis=0), rtol=1e-5)


def test_returns_in_training_are_those_that_were_paid(hop):
    (setup,) = hop.setups
    rows = pq.read_table(HOP / "episodes.parquet").to_pandas()
    last = rows[rows.end_step <= hop.grid[-1]].sort_values("end_step").groupby("lane")["return"].last()
    np.testing.assert_allclose(setup.returns[:, -1], last, rtol=1e-5)


def test_a_column_of_its_own_is_a_measure_with_the_columns_unit(hop):
    run = open_run(HOP)
    evaluations, episodes = run.table("evaluations"), run.table("episodes")
    speed = pa.field("top_speed", pa.float32(), metadata={"unit": "m/s"})
    more = evaluations.append_column(speed, pc.multiply(evaluations["length"], 0.5).cast(pa.float32()))
    runs = measure_tables(run.experiment, None, more, episodes, None)
    assert Measure("top_speed", "Top speed", "m/s", "top_speed", "m/s") in runs.measures
    np.testing.assert_allclose(
        runs["both"].final["top_speed"], 0.5 * hop["both"].last(named(hop, "length")), rtol=1e-6
    )
    nothing = evaluations.set_column(
        evaluations.column_names.index("distance"),
        "distance",
        pa.array(np.full(len(evaluations), np.nan, np.float32)),
    )
    without = measure_tables(run.experiment, None, nothing, episodes, None)
    assert {one.column for one in hop.measures} - {one.column for one in without.measures} == {"distance"}


def test_a_plant_without_a_baseline_is_measured_like_an_environment(tables):
    plan, _, evaluations, episodes, survival = tables(("sparse", "mine"))
    runs = measure_tables(plan, None, evaluations, episodes, survival)
    assert not runs.has_baseline
    assert {"hip_x", "distance", "share_in_cycle"} <= {one.column for one in runs.evaluated}
    np.testing.assert_array_equal(runs["mine"].final["distance"], runs["mine"].final["hip_x"])
    assert sections(runs)[0].title == "Last evaluation"


def test_a_lane_may_have_finished_no_episode_yet(hop):
    run = open_run(HOP)
    episodes = run.table("episodes").filter(pc.field("lane") != "both-1")
    runs = measure_tables(run.experiment, None, run.table("evaluations"), episodes, None)
    assert np.isnan(runs["both"].returns).all(axis=1).tolist() == [False, True, False]
    (learning,) = figures(runs).values()
    assert len([axes for axes in learning.axes if axes.get_visible()]) == len(hop.evaluated)


def test_a_study_under_way_is_measured_up_to_a_common_step(tmp_path, hop):
    copy = shutil.copytree(HOP, tmp_path / "run")
    table = pq.read_table(copy / "evaluations.parquet")
    rows = pc.field("step") <= pc.if_else(pc.field("lane") == "both-2", 80_000, 200_000)
    pq.write_table(table.filter(rows), copy / "evaluations.parquet")
    run = replace(open_run(HOP), path=copy, manifest={"status": "running", "files": {}})
    runs = measure_so_far(run)
    assert runs.steps == 200_000
    assert runs["both"].seeds.tolist() == [0, 1]
    np.testing.assert_array_equal(
        runs["both"].evaluations["distance"], hop["both"].evaluations["distance"][:2, :5]
    )
    with pytest.raises(RunFolderError, match=r"lane both-2 lacks evaluations"):
        measure(run)


def test_tables_hold_the_means_and_every_seed(hop):
    by_setup, by_seed = sections(hop)
    assert by_setup.header[0] == "setup"
    assert "falls [%]" in by_setup.header
    column = by_seed.header.index("distance [m]")
    shown = [float(row[column].replace("−", "-")) for row in by_seed.rows]
    assert [row[0] for row in by_seed.rows] == ["both-0", "both-1", "both-2"]
    np.testing.assert_allclose(shown, hop["both"].final["distance"], rtol=5e-3)
    (row,) = by_setup.rows
    assert row[column].startswith(f"{np.mean(hop['both'].final['distance']):.3g} [")


def test_a_study_does_not_differ_from_itself(hop):
    assert pairs(hop, hop) == [BOTH]
    rows = compared(hop, hop, BOTH)
    assert len(rows) == len(hop.evaluated)
    for row in rows:
        assert row.difference.value == pytest.approx(0, abs=1e-9)
        assert row.p > 0.9
    assert shared_measures(hop, hop, BOTH) == list(hop.measures)


def test_what_is_described_otherwise_is_not_compared(hop, hop_alone):
    """The two are paid otherwise for the same hopping; another description also shares no cycle."""
    (pair,) = pairs(hop, hop_alone)
    assert pair == Pair("both", "described")
    shared = shared_measures(hop, hop_alone, pair)
    assert {one.depends_on for one in shared} == {"environment", "behaviour"}
    signals = replace(hop_alone.experiment.problem, signals={"left_load": 0})
    other = replace(hop_alone, experiment=replace(hop_alone.experiment, problem=signals))
    assert {one.depends_on for one in shared_measures(hop, other, pair)} == {"environment"}
    measured = {row.measure for row in compared(hop, other, pair)}
    assert "final environment's return" in measured
    assert f"final {IN_CYCLE.heading}" not in measured


def test_different_problems_are_refused(hop, hop_back, small_study):
    with pytest.raises(RunFolderError, match="of Walker2d-v5 and of Hopper-v5"):
        pairs(hop, hop_back)
    with pytest.raises(RunFolderError, match="Walker2d-v5 and of the compass walker"):
        pairs(hop, small_study)
    slower = replace(hop.experiment.problem, env_options={"frame_skip": 8})
    other = replace(hop, experiment=replace(hop.experiment, problem=slower))
    with pytest.raises(RunFolderError, match="Walker2d-v5 with frame_skip = 8"):
        pairs(hop, other)


def test_the_comparison_is_written_with_what_it_leaves_out(hop, hop_alone, tmp_path, capsys):
    write_comparison({"with the reward": hop, "alone": hop_alone}, tmp_path)
    printed = " ".join(capsys.readouterr().out.split())
    assert "both-described, 3 and 3 runs" in printed
    assert (
        "Not comparable, since described or paid otherwise: behaviour's return, return in training."
        in printed
    )
    assert "| final distance [m] |" in (tmp_path / "comparison.md").read_text(encoding="utf-8")
    assert (tmp_path / "comparison-both-described.png").exists()
