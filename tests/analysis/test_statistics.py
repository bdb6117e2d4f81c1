import math

import numpy as np
import pytest
from scipy.stats import trim_mean

from coachable.analysis.measurements import measure_tables
from coachable.analysis.measures import HIGHEST, RETURN
from coachable.analysis.statistics import mean_curve, statistics_of

pytestmark = pytest.mark.usefixtures("quick")


def test_every_number_is_what_it_says(small_study):
    setup = small_study["orthant"]
    s = statistics_of(small_study, setup)
    assert s.highest == setup.distance.max()
    assert s.highest_mean.value == pytest.approx(setup.distance.max(axis=1).mean())
    assert s.highest_iqm.value == pytest.approx(trim_mean(setup.distance.max(axis=1), 0.25))
    assert s.highest_std.value == pytest.approx(np.std(setup.highest, ddof=1))
    assert s.final_mean.value == pytest.approx(setup.final_distance.mean())
    assert s.final_std.value == pytest.approx(np.std(setup.final_distance, ddof=1))
    assert s.final_return_std.value == pytest.approx(np.std(setup.returns[:, -1], ddof=1))
    assert s.highest_return_std.value == pytest.approx(np.std(setup.highest_return, ddof=1))
    assert s.late_return.value == pytest.approx(setup.returns.mean())  # the study has just 50,000 steps
    assert s.num_up_at_end == s.num_runs == 4
    assert s.num_up_watched == np.sum(setup.seconds_up == 100)
    for estimate in (s.highest_mean, s.highest_iqm, s.final_mean, s.late_return, s.share_in_cycle):
        assert estimate.low < estimate.value < estimate.high


def test_the_best_run_passes_the_baseline_first(small_study):
    for setup in small_study.setups:
        s = statistics_of(small_study, setup)
        if s.num_above_baseline:
            assert s.first_above_baseline == small_study.steps_to_baseline(setup).min()
            assert s.first_above_baseline <= s.steps_to_baseline.value
        else:
            assert s.first_above_baseline == math.inf


def test_nobody_passes_a_baseline_out_of_reach(tables):
    plan, baseline, *rest = tables()
    runs = measure_tables(plan, baseline | {"hip_x": 99.0}, *rest)
    s = statistics_of(runs, runs["forward"])
    assert s.first_above_baseline == math.inf
    assert s.steps_to_baseline.value == plan.steps
    assert not s.steps_to_baseline.has_interval  # all are censored: the resamples say nothing
    assert s.num_above_baseline == 0


def test_unwatched_walkers_have_no_numbers(tables):
    runs = measure_tables(*tables(survival=False))
    s = statistics_of(runs, runs["sparse"])
    assert s.num_up_watched is None
    assert math.isnan(s.perturbed_up.value)


def test_one_seed_has_values_and_no_intervals(tables):
    runs = measure_tables(*tables(num_seeds=1))
    s = statistics_of(runs, runs["sparse"])
    assert s.highest_mean.value == s.highest
    assert not s.highest_mean.has_interval
    assert math.isnan(s.highest_std.value)


def test_bands_are_the_means_over_runs_within_their_intervals(small_study):
    setup = small_study["forward"]
    for band, values in (
        (mean_curve(small_study, setup, HIGHEST), setup.highest_so_far),
        (mean_curve(small_study, setup, RETURN), setup.returns),
    ):
        np.testing.assert_allclose(band.value, values.mean(axis=0))
        varied = ~np.isnan(band.low)
        assert varied.mean() > 0.5
        assert np.all((band.low < band.value) & (band.value < band.high), where=varied)
        assert np.all((values.min(axis=0) <= band.low) & (band.high <= values.max(axis=0)), where=varied)


def test_the_learning_curve_begins_when_every_run_has_finished_an_episode(tables):
    plan, baseline, evaluations, episodes, survival = tables()
    ends = np.array(episodes["end_step"].to_pylist())
    late = np.array(episodes["lane"].to_pylist()) == "sparse-1"
    runs = measure_tables(plan, baseline, evaluations, episodes.filter(~late | (ends > 4_200)), survival)
    first_end = ends[late & (ends > 4_200)].min()
    assert mean_curve(runs, runs["sparse"], RETURN).steps[0] == math.ceil(first_end / 1_000) * 1_000
    assert mean_curve(runs, runs["forward"], RETURN).steps[0] == 1_000
