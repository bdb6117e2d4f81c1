import sys
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image, ImageSequence

from coachable.drawing.stage import SIZE
from coachable.foundation.errors import CoachableError, MissingExtraError, ParameterError
from coachable.foundation.style import STANCE, SWING, phase_colours
from coachable.plants.compass import CompassParameters
from coachable.viewing.animation import animate
from coachable.viewing.scene import Scene, SideBySide
from coachable.viewing.watch import draw_motions


@pytest.fixture(scope="module")
def gif(until, phases, tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "gait.gif"
    animate({"": until(2.0)}, path, phases)
    return path


def frames_of(path):
    with Image.open(path) as film:
        for frame in ImageSequence.Iterator(film):
            yield frame.info["duration"], np.asarray(frame.convert("RGB")).astype(int)


def test_a_gif_has_twenty_five_frames_a_second_and_each_is_another(gif):
    frames = list(frames_of(gif))
    assert len(frames) == 2 * 25
    assert {duration for duration, _ in frames[:-1]} == {40}
    assert frames[-1][0] == 1000
    for (_, one), (_, other) in pairwise(frames):
        assert np.any(one != other)


def test_a_gif_is_small_and_its_page_white(gif):
    assert gif.stat().st_size < 2 * 200_000  # five seconds must stay below a megabyte
    for _, frame in frames_of(gif):
        assert frame.shape == (SIZE[1], SIZE[0], 3)
        assert frame[100, 5].tolist() == [255, 255, 255]


def rgb(colour):
    return tuple(int(colour[i : i + 2], 16) for i in (1, 3, 5))


def test_the_chip_has_the_colour_of_the_phase(motion, phases):
    scene, colours = Scene.of(motion, phases), phase_colours(len(phases))
    seen = set()
    for time in np.arange(0.5, 3.0, 0.13):
        phase = int(motion.phase[motion.at(time)])
        assert scene.frame(float(time)).getpixel((30, 33)) == rgb(colours[phase])
        seen.add(phase)
    after_touchdown = motion.time[np.flatnonzero(motion.touched_down)[2]]
    assert scene.frame(float(after_touchdown)).getpixel((30, 33)) == rgb(colours[-1])
    assert seen >= {0, 1, 2, 3}


def test_legs_are_where_the_motion_has_them_and_hidden_below_the_ground(motion, phases):
    scene, hip = Scene.of(motion, phases), motion.point("hip")
    for time in (1.0, 2.3, 4.1):
        sample, pixels = motion.at(time), np.asarray(scene.frame(time))
        for role, colour in (("stance", STANCE), ("swing", SWING)):
            foot, mass = motion.point(f"{role}_foot"), motion.point(f"{role}_mass")
            middle = 0.75 * hip[sample] + 0.25 * foot[sample]
            x, y = scene.stage(sample).place(middle)
            assert tuple(pixels[round(y), round(x)]) == rgb(colour)
            assert np.allclose(mass[sample], 0.5 * hip[sample] + 0.5 * foot[sample])
        below = np.array(scene.frame(time))[300:320].reshape(-1, 3)
        assert not any((below == rgb(colour)).all(axis=1).any() for colour in (STANCE, SWING))


def test_the_camera_keeps_the_robot_in_the_picture(motion, phases):
    scene = Scene.of(motion, phases)
    x = np.array([scene.stage(sample).place(at)[0] for sample, at in enumerate(motion.base)])
    assert np.all(np.abs(x - SIZE[0] / 2) < 50)
    assert np.all(np.diff(scene.camera) > 0)


def test_an_mp4_has_fifty_frames_a_second(until, phases, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="mp4 needs the [video] extra")
    path = tmp_path / "gait.mp4"
    animate({"": until(1.0)}, path, phases)
    frames, seconds = ffmpeg.count_frames_and_secs(str(path))
    assert frames == 50
    assert seconds == pytest.approx(1.0, abs=0.02)


def test_a_place_that_cannot_be_written_to_is_named(until, phases, tmp_path):
    pytest.importorskip("imageio_ffmpeg", reason="mp4 needs the [video] extra")
    with pytest.raises(OSError, match="nowhere"):
        animate({"": until(0.1)}, tmp_path / "nowhere" / "gait.mp4", phases)


def test_without_the_extra_an_mp4_says_how_to_get_it(until, phases, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'coachable\[video\]'"):
        animate({"": until(0.1)}, tmp_path / "gait.mp4", phases)


def test_motions_side_by_side_each_are_what_they_are_alone(until, phases):
    motions = [until(seconds) for seconds in (1.0, 0.4, 0.7)]
    scenes = tuple(Scene.of(motion, phases, f"seed {number}") for number, motion in enumerate(motions))
    together = SideBySide(scenes)
    assert together.size == (2 * SIZE[0], 2 * SIZE[1])
    for time in (0.2, 0.9):
        frame = np.asarray(together.frame(time))
        for place, scene in enumerate(scenes):
            row, column = divmod(place, 2)
            part = frame[SIZE[1] * row :, SIZE[0] * column :][: SIZE[1], : SIZE[0]]
            np.testing.assert_array_equal(part, np.asarray(scene.frame(time)))
        assert np.all(frame[SIZE[1] :, SIZE[0] :] == 255)


def test_a_title_distinguishes_motions(until, phases):
    plain, titled = (Scene.of(until(0.2), phases, title).frame(0.1) for title in ("", "seed 3"))
    changed = np.argwhere(np.any(np.asarray(plain) != np.asarray(titled), axis=-1))
    assert 50 < changed[:, 0].min() < changed[:, 0].max() < 75


def test_a_film_lasts_as_long_as_its_longest_motion(until, phases, tmp_path):
    animate({"short": until(0.2), "long": until(0.4)}, tmp_path / "both.gif", phases)
    assert len(list(frames_of(tmp_path / "both.gif"))) == 10


def test_another_suffix_is_refused(until, phases, tmp_path):
    with pytest.raises(CoachableError, match=r"\.gif or \.mp4"):
        animate({"": until(0.1)}, tmp_path / "gait.webm", phases)


def test_a_single_sample_and_long_legs_are_filmed(until, columns, motion_of, phases, tmp_path):
    animate({"": until(0.0)}, tmp_path / "moment.gif", phases)
    assert len(list(frames_of(tmp_path / "moment.gif"))) == 1
    long = motion_of(columns, CompassParameters(a=2.0, hip_mass=0.1)).part(0, 21)
    animate({"": long}, tmp_path / "long.gif", phases)
    assert len(list(frames_of(tmp_path / "long.gif"))) == 5


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_a_walk_that_ends_within_a_microsecond_is_filmed_and_drawn(
    columns, motion_of, phases, tmp_path, samples
):
    short = {name: column[:samples] for name, column in columns.items()}
    short["t"] = 1e-9 * np.arange(samples)
    for suffix in (".gif", ".png"):
        draw_motions({"": motion_of(short)}, tmp_path / f"moment{suffix}", phases)
        with Image.open(tmp_path / f"moment{suffix}") as picture:
            picture.load()


def test_a_walk_without_a_finite_sample_is_a_sentence(columns, motion_of):
    nothing = {name: np.full_like(column, np.nan, float) for name, column in columns.items()}
    nothing["phase"] = columns["phase"]
    with pytest.raises(ParameterError, match="nothing to draw"):
        motion_of(nothing)


def test_legs_much_lighter_than_the_body_are_filmed(columns, motion_of, phases, tmp_path):
    heavy = motion_of(columns, CompassParameters(hip_mass=1e4)).part(0, 81)
    for suffix in (".gif", ".png"):
        draw_motions({"": heavy}, tmp_path / f"heavy{suffix}", phases)
