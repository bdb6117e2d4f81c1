"""A plant that the pictures do not know, with more than two legs, is drawn from its skeleton alone."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from matplotlib.colors import to_hex
from PIL import Image

from coachable.behaviours.library import load_behaviour
from coachable.drawing.motion import Motion
from coachable.drawing.stage import SIZE
from coachable.foundation.errors import ParameterError
from coachable.foundation.style import STANCE, SWING
from coachable.plants.integrate import advance
from coachable.plants.plant import Plant
from coachable.viewing.scene import Scene
from coachable.viewing.strobe import strobe
from coachable.viewing.watch import draw_motions
from tests.plants.rimless_wheel import RimlessWheel

WHEEL, DT = RimlessWheel(), 0.01
LENGTH = WHEEL.parameters.length
NUM_SPOKES = 10


@pytest.fixture(scope="module")
def columns():
    """Ten seconds of rolling, as a run folder stores them."""

    def step(carry, _):
        x, foot_x = carry
        after = advance(WHEEL, x, foot_x, jnp.zeros(1), DT)
        return (after.x, after.foot_x), (after.x, after.foot_x)

    with jax.enable_x64(True):
        start = (jnp.array(WHEEL.start), jnp.array(0.0))
        _, (states, foot_x) = jax.device_get(jax.jit(lambda: lax.scan(step, start, length=1000))())
    times = DT * np.arange(1, 1001)
    theta, dtheta = states.T
    return {"t": times, "theta": theta, "dtheta": dtheta, "foot_x": foot_x, "phase": np.zeros(1000, int)}


@pytest.fixture(scope="module")
def rolling(columns):
    return Motion.of(WHEEL, columns)


def test_spokes_have_their_length_and_the_stance_foot_is_on_the_ground(rolling, columns):
    feet = rolling.points[:, 1:]
    assert feet.shape[1] == NUM_SPOKES
    np.testing.assert_allclose(np.linalg.norm(feet - rolling.base[:, None], axis=-1), LENGTH)
    np.testing.assert_allclose(feet[:, 0], np.stack([rolling.foot_x, 0 * rolling.foot_x], -1), atol=1e-12)
    assert (feet[:, 1:, 1] > -1e-9).all()
    with jax.enable_x64(True):
        x = jnp.stack([columns["theta"], columns["dtheta"]], axis=-1)
        base = jax.vmap(WHEEL.base)(x, jnp.asarray(rolling.foot_x))
    np.testing.assert_allclose(rolling.base, base, atol=1e-12)


def test_every_spoke_keeps_its_identity_across_touchdowns(rolling):
    assert rolling.touched_down.sum() > NUM_SPOKES
    leg_of_spoke = (np.arange(NUM_SPOKES) - rolling.touchdowns[:, None]) % NUM_SPOKES
    feet = np.take_along_axis(rolling.points[:, 1:], leg_of_spoke[..., None], axis=1)
    jumps = np.abs(np.diff(feet, axis=0)).max(axis=-1)
    # Spokes 2 α apart leave a gap: the stance spoke alone crosses it, when it becomes the last one.
    assert jumps[leg_of_spoke[1:] < NUM_SPOKES - 1].max() < 0.06
    assert np.abs(np.diff(rolling.points[:, 1:], axis=0)).max() > 0.3  # a role changes spokes
    for sample in range(0, len(rolling.time), 50):
        touchdowns = int(rolling.touchdowns[sample])
        first = [rolling.skeleton.stands_first(int(leg), touchdowns) for leg in leg_of_spoke[sample]]
        assert first == [True] + [False] * (NUM_SPOKES - 1)


def test_a_strobe_picture_shows_every_spoke(rolling):
    figure = strobe({"": rolling}, load_behaviour("compass-walking").phases)
    (axes,) = figure.axes
    spokes = [line for line in axes.lines if line.get_linewidth() == 2.2]
    colours = [to_hex(line.get_color()) for line in spokes[-NUM_SPOKES:]]
    assert len(spokes) % NUM_SPOKES == 0
    assert colours == [SWING] * (NUM_SPOKES - 1) + [STANCE]
    (left, right), (_, top) = axes.get_xlim(), axes.get_ylim()
    drawn = np.concatenate([line.get_xydata() for line in spokes])
    assert left < drawn[:, 0].min() < drawn[:, 0].max() < right
    assert drawn[:, 1].max() < top


def test_a_film_shows_the_wheel_where_it_is(rolling, tmp_path):
    phases = load_behaviour("compass-walking").phases
    draw_motions({"": rolling.part(0, 3)}, tmp_path / "wheel.gif", phases)
    with Image.open(tmp_path / "wheel.gif") as film:
        assert film.size == SIZE
    scene = Scene.of(rolling, phases)
    for sample in (0, 120, 999):
        pixels, stage = np.asarray(scene.frame(float(rolling.time[sample]))), scene.stage(sample)
        for leg, colour in enumerate([STANCE] + [SWING] * (NUM_SPOKES - 1)):
            middle = rolling.points[sample, [0, 1 + leg]].mean(axis=0)
            x, y = stage.place(middle)
            assert tuple(pixels[round(y), round(x)]) == tuple(bytes.fromhex(colour[1:]))


def test_a_plant_without_a_skeleton_is_refused_in_a_sentence(columns):
    class Undrawn(RimlessWheel):
        skeleton = Plant.skeleton
        kinematics = Plant.kinematics

    with pytest.raises(ParameterError, match=r"^the rimless wheel does not define its (skeleton|kinematics)"):
        Motion.of(Undrawn(), columns)
