"""Two studies beside each other: what is the same compares as the same, and what differs as it differs."""

from dataclasses import replace

import numpy as np
import pytest

from coachable.analysis.comparison import (
    Pair,
    compared,
    comparison_figure,
    pairs,
    share_of_overlap,
    write_comparison,
)
from coachable.analysis.measurements import Measurements, SetupRuns
from coachable.analysis.measures import BESIDE_A_BASELINE, RETURN
from coachable.analysis.statistics import mean_curve
from coachable.experiments.plan import load_plan
from coachable.foundation.errors import RunFolderError

STEPS = 100_000
CHECKPOINTS = np.arange(10_000, STEPS + 1, 10_000)
ORTHANT = Pair("orthant", "orthant")
GRID = np.arange(1_000, STEPS + 1, 1_000)


def study(seed, num_runs=8, better=0.0, semantics="paper", name="orthant"):
    rng = np.random.default_rng(seed)
    distance = rng.normal(6 + better, 1, (num_runs, len(CHECKPOINTS)))
    returns = rng.normal(0.8 + better, 0.1, (num_runs, len(GRID)))
    fell = (rng.random(distance.shape) < 0.2) * 1.0
    setup = SetupRuns(
        name=name,
        seeds=np.arange(num_runs),
        evaluations={"distance": distance, "fell": fell, "share_in_cycle": rng.random(distance.shape)},
        final={
            "distance": distance[:, -1],
            "fell": fell[:, -1],
            "share_in_cycle": rng.random(num_runs),
            "seconds_up": rng.uniform(50, 100, num_runs),
            "perturbed_up": rng.random(num_runs),
        },
        returns=returns,
        highest_return=returns.max(axis=1),
        final_return=returns[:, -1],
    )
    plan = load_plan("paper", name="made-up", semantics=semantics)
    return Measurements(plan, STEPS, CHECKPOINTS, GRID, BESIDE_A_BASELINE, 7.83, (setup,))


def test_a_study_does_not_differ_from_itself():
    runs = study(0)
    for row in compared(runs, runs, ORTHANT):
        assert row.difference.value == pytest.approx(0, abs=1e-12)
        assert row.p > 0.9
    curve = mean_curve(runs, runs["orthant"], RETURN)
    assert share_of_overlap(curve, curve) == 1


def test_a_better_study_is_told_to_be_better_by_as_much():
    rows = {row.measure: row for row in compared(study(0, better=2.0), study(1), ORTHANT)}
    final = rows["final distance [m]"]
    assert final.difference.low < 2 < final.difference.high
    assert final.difference.low > 0
    assert final.p < 0.01
    assert final.difference.value == pytest.approx(final.first.value - final.second.value)
    better, worse = (mean_curve(runs, runs["orthant"], RETURN) for runs in (study(0, better=2.0), study(1)))
    assert share_of_overlap(better, worse) == 0


def test_without_intervals_means_are_compared():
    runs = study(0)
    curve = mean_curve(runs, runs["orthant"], RETURN)
    nothing = np.full_like(curve.low, np.nan)
    bare = replace(curve, low=nothing, high=nothing)
    assert share_of_overlap(bare, bare) == 1
    assert share_of_overlap(bare, curve) == 1
    assert share_of_overlap(replace(bare, value=bare.value + 9), curve) == 0
    assert np.isnan(share_of_overlap(curve, replace(curve, steps=curve.steps + 1)))


def test_equal_distributions_rarely_look_different():
    ps = [compared(study(2 * i), study(2 * i + 1), ORTHANT)[1].p for i in range(12)]
    assert 0.25 < np.mean(ps) < 0.75


def test_what_was_not_measured_is_left_out():
    runs = study(0)
    final = runs["orthant"].final | {"seconds_up": np.full(8, np.nan)}
    unwatched = replace(runs, setups=(replace(runs["orthant"], final=final),))
    assert len(compared(runs, unwatched, ORTHANT)) == len(compared(runs, runs, ORTHANT)) - 1


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(RunFolderError, match="semantics"):
        pairs(study(0), study(1, semantics="released-code"))
    with pytest.raises(RunFolderError, match="no setup in common"):
        pairs(study(0), study(1, name="sparse"))


def test_it_is_written_with_units_and_both_names(tmp_path, capsys):
    studies = {"mine": study(0), "theirs": study(1, num_runs=5)}
    write_comparison(studies, tmp_path / "made")
    printed = capsys.readouterr().out
    assert "8 and 5 runs" in printed
    assert "final distance [m]" in printed
    written = (tmp_path / "made" / "comparison.md").read_text()
    assert "| final distance [m] |" in written
    assert (tmp_path / "made" / "comparison-orthant.png").exists()
    labels = [text.get_text() for text in comparison_figure(studies, ORTHANT).legends[0].get_texts()]
    assert labels == ["mine, 8 seeds", "theirs, 5 seeds", "virtual gravity"]


def test_evaluations_at_other_steps_are_told_to_be_so(tmp_path, capsys):
    early = replace(study(1), checkpoints=CHECKPOINTS - 1)
    write_comparison({"mine": study(0), "theirs": early}, tmp_path)
    printed = " ".join(capsys.readouterr().out.split())
    assert "none of the evaluations, which have no step in common" in printed
    assert "nan" not in printed
