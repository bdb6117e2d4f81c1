from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from PIL import Image

from coachable.analysis.figures import draw_figures, learning_curves, rules_figure, walking_distance
from coachable.analysis.measurements import measure_tables
from coachable.analysis.measures import DISTANCE, HIGHEST, RETURN
from coachable.analysis.paper import paper_curves
from coachable.analysis.statistics import mean_curve
from coachable.foundation.errors import RunFolderError
from coachable.foundation.style import INK, setup_colours


def curves(axes):
    return {to_hex(line.get_color()): line for line in axes.lines if line.get_linestyle() == "-"}


def dashed(axes):
    return {to_hex(line.get_color()): line for line in axes.lines if line.get_linestyle() != "-"}


def assert_band(axes, index, band):
    """The polygon of a band has just the ends of the intervals for corners, and one where it closes."""
    corners = np.concatenate([path.vertices for path in axes.collections[index].get_paths()])
    expected = np.concatenate([np.c_[band.steps, band.low], np.c_[band.steps, band.high]])
    for corner in expected[~np.isnan(expected).any(axis=1)]:
        assert np.any(np.all(np.isclose(corners, corner), axis=1))
    assert np.nanmin(corners[:, 1]) == pytest.approx(np.nanmin(band.low))
    assert np.nanmax(corners[:, 1]) == pytest.approx(np.nanmax(band.high))


def test_learning_curves_are_the_statistics(small_study):
    (axes,) = learning_curves(small_study).axes
    colours = setup_colours(small_study.setup_names)
    for index, setup in enumerate(small_study.setups):
        band = mean_curve(small_study, setup, RETURN)
        line = curves(axes)[colours[setup.name]]
        np.testing.assert_array_equal(line.get_xydata(), np.c_[band.steps, band.value])
        assert_band(axes, index, band)
    assert np.unique(curves(axes)[INK].get_ydata()) == [1.0]


def test_walking_distance_is_the_best_run_and_the_mean(small_study):
    best, average = walking_distance(small_study).axes
    colours = setup_colours(small_study.setup_names)
    for index, setup in enumerate(small_study.setups):
        line = curves(best)[colours[setup.name]]
        np.testing.assert_array_equal(line.get_ydata(), setup.highest_of_all_runs)
        assert_band(average, index, mean_curve(small_study, setup, HIGHEST))
    assert not best.collections  # a maximum has no interval
    for axes in (best, average):
        assert np.unique(curves(axes)[INK].get_ydata()) == [small_study.baseline_distance]


@pytest.mark.parametrize("figure", ["learning_curves", "walking_distance"])
def test_the_paper_s_curves_are_dashed_in_the_colour_of_ours(small_study, figure):
    axes = {"learning_curves": learning_curves, "walking_distance": walking_distance}[figure](
        small_study
    ).axes[0]
    for name, colour in setup_colours(small_study.setup_names).items():
        np.testing.assert_array_equal(dashed(axes)[colour].get_ydata(), paper_curves(figure)[name].value)


def test_other_setups_have_no_curve_of_the_paper_and_a_colour_each(tables):
    runs = measure_tables(*tables(("mine", "yours", "orthant")))
    (axes,) = learning_curves(runs).axes
    assert set(dashed(axes)) == {setup_colours(("orthant",))["orthant"]}
    assert len(curves(axes)) == 4


def test_axes_say_what_they_are_and_in_which_unit(small_study):
    for axes in (*learning_curves(small_study).axes, *walking_distance(small_study).axes):
        assert axes.get_xlabel() == "training steps"
    assert "[m]" in walking_distance(small_study).axes[0].get_ylabel()


def test_files_are_the_same_bytes_each_time(small_study, tmp_path):
    paths = draw_figures(small_study, tmp_path / "new" / "one")
    again = draw_figures(small_study, tmp_path / "two")
    assert [path.name for path in paths] == [
        "learning_curves.svg",
        "learning_curves.png",
        "walking_distance.svg",
        "walking_distance.png",
    ]
    for first, second in zip(paths, again, strict=True):
        assert first.read_bytes() == second.read_bytes()
    with Image.open(paths[1]) as picture:
        assert picture.width == pytest.approx(7.16 * 200, abs=1)


def test_one_seed_is_drawn_without_bands(tables):
    runs = measure_tables(*tables(("sparse",), num_seeds=1))
    (axes,) = learning_curves(runs).axes
    assert len(curves(axes)) == 2
    assert not any(np.size(path.vertices) for band in axes.collections for path in band.get_paths())


def test_rules_are_drawn_side_by_side_of_the_same_runs(small_study, tmp_path):
    other = replace(
        small_study, experiment=replace(small_study.experiment, deterministic=("expected-action",))
    )
    some = [runs.of_setups(["orthant", "sparse"]) for runs in (other, small_study)]
    left, right = rules_figure(some).axes
    assert [axes.get_title(loc="left") for axes in (left, right)] == ["expected action", "clipped mean"]
    curve = mean_curve(small_study, small_study["orthant"], DISTANCE)
    np.testing.assert_allclose(left.lines[0].get_ydata(), curve.value)
    assert len(left.lines) == len(some[0].setups) + 1  # and the baseline
    names = {path.name for path in draw_figures(some[0], tmp_path, some[1:])}
    assert {"rules.svg", "rules.png"} <= names
    with pytest.raises(RunFolderError, match="did you mean 'sparse'"):
        small_study.of_setups(["sparce"])
