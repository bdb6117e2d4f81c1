import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb
from matplotlib.patches import Rectangle
from PIL import Image

from coachable.drawing.motion import runs_of
from coachable.foundation.style import INK, PAGE, STANCE, SWING, phase_colours
from coachable.plants.compass import CompassParameters
from coachable.viewing.strobe import strobe, write_strobe


def legs(figure):
    """Lines from a foot to the hip, oldest first."""
    return [line for line in figure.axes[0].lines if line.get_linewidth() == 2.2]


def strip(figure):
    """The coloured rectangles beneath, without the page that covers what is below the ground."""
    patches = [patch for patch in figure.axes[0].patches if isinstance(patch, Rectangle)]
    return [patch for patch in patches if to_hex(patch.get_facecolor()) != PAGE]


def test_a_pose_every_tenth_of_a_second_of_the_last_strides(motion, phases):
    start = motion.time[np.flatnonzero(motion.touched_down)[-4]]
    figure = strobe({"": motion}, phases, strides=3)
    assert len(legs(figure)) == 2 * (int((motion.time[-1] - start + 1e-6) / 0.1) + 1)
    everything = strobe({"": motion}, phases, strides=99)
    assert len(legs(everything)) == 2 * 101


def test_the_last_pose_is_the_end_of_the_motion_in_full_colour(motion, phases):
    hip = motion.point("hip")[-1]
    swing, stance = legs(strobe({"": motion}, phases))[-2:]
    np.testing.assert_allclose(np.asarray(swing.get_xydata()), [motion.point("swing_foot")[-1], hip])
    np.testing.assert_allclose(np.asarray(stance.get_xydata()), [motion.point("stance_foot")[-1], hip])
    assert (to_hex(swing.get_color()), to_hex(stance.get_color())) == (SWING, STANCE)


def test_older_poses_are_fainter_and_behind(motion, phases):
    stance = legs(strobe({"": motion}, phases))[1::2]
    brightness = [sum(to_rgb(line.get_color())) for line in stance]
    assert brightness == sorted(brightness, reverse=True)
    levels = [line.get_zorder() for line in stance]
    assert levels == sorted(levels)


def test_the_strip_shows_the_phases_over_time(motion, phases):
    shown = motion.part(int(np.flatnonzero(motion.touched_down)[-3]), len(motion.time))
    figure = strobe({"": motion}, phases, strides=2)
    colours = phase_colours(len(phases))
    stretches = runs_of(shown.phase)
    assert [to_hex(patch.get_facecolor()) for patch in strip(figure)] == [
        colours[phase] for phase, _, _ in stretches
    ]
    widths = np.array([patch.get_width() for patch in strip(figure)])
    seconds = np.array(
        [shown.time[min(stop, len(shown.time) - 1)] - shown.time[start] for _, start, stop in stretches]
    )
    np.testing.assert_allclose(widths / widths.sum(), seconds / seconds.sum(), atol=1e-9)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert {"O1", "O2", "O3", "O4"} < set(texts)
    left = strip(figure)[0].get_x()
    lines = [
        np.asarray(line.get_xdata())[0]
        for line in figure.axes[0].lines
        if line.get_linewidth() == 0.8 and line.get_color() == INK
    ]
    touchdowns = shown.time[shown.touched_down] - shown.time[0]
    np.testing.assert_allclose(np.array(lines), left + widths.sum() * touchdowns / shown.seconds)


def test_metres_are_square_and_the_whole_robot_is_in_the_picture(motion, phases):
    figure = strobe({"": motion}, phases)
    (axes,) = figure.axes
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert (right - left) / (top - bottom) == pytest.approx(np.divide(*figure.get_size_inches()))
    drawn = np.concatenate([line.get_xydata() for line in legs(figure)])
    assert left < drawn[:, 0].min() < drawn[:, 0].max() < right
    assert drawn[:, 1].max() < top


def test_several_motions_stand_below_one_another_at_one_scale(until, phases):
    figure = strobe({"seed 1": until(3.0), "seed 2": until(1.0)}, phases)
    first, second = figure.axes
    assert np.ptp(first.get_xlim()) == pytest.approx(np.ptp(second.get_xlim()))
    assert first.get_position().y0 == pytest.approx(second.get_position().y1)
    for axes, title in ((first, "seed 1"), (second, "seed 2")):
        assert title in {text.get_text() for text in axes.texts}


def test_files_are_the_same_bytes_each_time(motion, phases, tmp_path):
    for name in ("gait.svg", "gait.png"):
        first, second = tmp_path / name, tmp_path / f"again-{name}"
        write_strobe({"": motion}, first, phases)
        write_strobe({"": motion}, second, phases)
        assert first.read_bytes() == second.read_bytes()
    with Image.open(tmp_path / "gait.png") as picture:
        assert picture.width == pytest.approx(7.16 * 200, abs=1)


def test_short_motions_and_long_legs_are_drawn(until, columns, motion_of, phases, tmp_path):
    long = motion_of(columns, CompassParameters(b=2.5)).part(0, 301)
    for motion in (until(0.0), until(0.03), long):
        write_strobe({"": motion}, tmp_path / "gait.png", phases)
