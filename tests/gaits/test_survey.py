"""A small training of Walker2d: its walks are recorded, drawn and measured, and nothing is made up."""

import contextlib
import json
from dataclasses import replace

import equinox as eqx
import gymnasium
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("stable_baselines3", reason="needs the [sb3] extra: pip install 'coachable[sb3]'")
pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")

from coachable import cli
from coachable.automata.trace_file import read_trace
from coachable.envs.signals.limbs import Limbs
from coachable.experiments.experiment import EVALUATION_SEED
from coachable.experiments.plan import load_plan
from coachable.experiments.recorded_episodes import recorded_walk
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.runner import run_experiment
from coachable.gaits import survey as gait_survey
from coachable.viewing.side_view import SIDE, SideView

pytestmark = pytest.mark.sb3

HOPPING = """
behaviour "hopping"

include "planar-walker.vocabulary"

phases
  stance:  left foot is down, right foot is down
  flight:  left foot is up, right foot is up

cycle
  stance -> flight -> stance
"""

PLAN = """
env = "Walker2d-v5"
behaviour = "hopping.behaviour"
steps = 256
evaluate_every = 128
evaluation_episodes = 1
[setups.alone]
weight = 0
[setups.both]
[sb3]
n_envs = 2
n_steps = 64
batch_size = 32
n_epochs = 1
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walker")
    (folder / "hopping.behaviour").write_text(HOPPING)
    (folder / "walker.toml").write_text(PLAN)
    return run_experiment(load_plan(folder / "walker.toml"), folder / "run", progress=False)


@pytest.fixture(scope="module")
def walk(run):
    return recorded_walk(run, "both", 0)


def test_the_steps_of_all_environments_are_counted_once(run):
    episodes = run.columns("episodes")
    for lane in run.lanes:
        mine = episodes["lane"] == lane.name
        assert 0 < episodes["end_step"][mine].max() <= 256
        # Of two environments that step in turn, no more than their last episodes are not over.
        assert 0 <= 256 - episodes["length"][mine].sum() <= 256 - episodes["length"][mine][0]


def test_a_recorded_walk_is_the_episode_that_the_policy_walks(run, walk):
    env = gymnasium.make("Walker2d-v5")
    observation, _ = env.reset(seed=EVALUATION_SEED)
    policy, paid, heights = eqx.filter_jit(run.policy("both", 0)), 0.0, [observation[0]]
    for _ in walk.time[1:]:
        observation, reward, terminated, *_ = env.step(
            np.asarray(policy(jnp.asarray(observation, jnp.float32)))
        )
        paid += reward
        heights.append(observation[0])
    assert terminated == walk.fell
    assert walk.environment_return == pytest.approx(paid, rel=1e-6)
    np.testing.assert_allclose(walk.trace.values["torso_height"], heights, atol=1e-6)
    assert walk.time[1] == pytest.approx(0.008)


def test_its_phases_and_what_follows_are_those_of_its_feet(walk):
    left, right = (walk.trace.values[name] for name in ("left_load", "right_load"))
    down = np.stack([left > 20, right > 20])
    sure = (left > 30) == (left > 10)
    sure &= (right > 30) == (right > 10)
    phase = np.where(down.all(axis=0), 0, np.where(down.any(axis=0), 2, 1))
    np.testing.assert_array_equal(walk.phase[sure], phase[sure])
    # With two phases and an edge each way, whatever ends inside belongs to the behaviour.
    np.testing.assert_array_equal(walk.follows[1:], walk.phase[1:] < 2)


def test_limbs_end_where_the_robots_feet_are(walk):
    assert set(walk.limbs) >= {"torso_geom", "foot_geom", "foot_left_geom"}
    lowest = walk.ends[:, walk.limbs.index("foot_left_geom"), :, 2].min(axis=1)
    radius = walk.radii[walk.limbs.index("foot_left_geom")]
    np.testing.assert_allclose(lowest - radius, walk.trace.values["left_foot_height"], atol=1e-6)


def test_only_robots_of_mujoco_have_limbs():
    assert Limbs.of(gymnasium.make("Pendulum-v1")) is None
    pole = Limbs.of(gymnasium.make("InvertedPendulum-v5"))
    assert "cpole" in pole.names, "a robot without a floor has limbs, too"


def test_the_survey_measures_every_episode(run, capsys):
    cli.main(["gait", str(run.path), "--episodes", "2", "--speed", "0.1"])
    told = capsys.readouterr().out
    gaits = Run.open(run.path).columns("gaits")
    assert sorted(zip(gaits["lane"], gaits["episode"], strict=True)) == [
        (f"{setup}-0", episode) for setup in ("alone", "both") for episode in (0, 1)
    ]
    first = recorded_walk(run, "both", 0)
    row = (gaits["lane"] == "both-0") & (gaits["episode"] == 0)
    assert gaits["length"][row] == len(first.time) - 1
    assert gaits["follows"][row] == pytest.approx(first.follows[1:].mean())
    assert gaits["environment"][row] == pytest.approx(first.environment_return)
    table = (run.path / "gaits.md").read_text()
    for words in (
        "gaits of the seeds",
        "whole cycles [1/s]",
        "environment's return",
        "0.1 m/s after",
        "fell [%]",
    ):
        assert words in table
        assert words in told
    with Image.open(run.path / "footfalls.png") as picture:
        assert picture.width > 1000


def test_the_gaits_are_printed_as_json_and_no_table_is_written(run, capsys):
    (run.path / "gaits.md").unlink(missing_ok=True)
    cli.main(["gait", str(run.path), "--episodes", "2", "--speed", "-9", "--json"])
    numbers = json.loads(capsys.readouterr().out)
    gaits = Run.open(run.path).columns("gaits")
    for setup in numbers["setups"]:
        mine = gaits["lane"] == f"{setup['name']}-0"
        assert sum(setup["gaits"].values()) == mine.sum() == 2
        assert setup["environment"]["value"] == pytest.approx(gaits["environment"][mine].mean())
        assert setup["steps_to_speed"] == [128], "the first evaluation is faster than falling backward"
    assert not (run.path / "gaits.md").exists()


def test_whole_cycles_are_counted_by_the_second(run, walk, monkeypatch):
    """Two hops a second for four seconds, and half of one; a foot that stays down completes nothing."""
    time = np.arange(0.0, 4.3, 0.008)
    load = np.where((time + 0.004) % 0.5 < 0.25, 100.0, 0.0)
    for right, cycles in ((load, 8), (np.full_like(load, 100.0), 0)):
        values = {name: np.zeros_like(time) for name in walk.trace.values}
        trace = replace(walk.trace, time=time, values=values | {"left_load": load, "right_load": right})
        phase, follows = np.zeros(len(time), int), time >= 0
        each = replace(walk, trace=trace, phase=phase, follows=follows, ends=None, radii=None)
        monkeypatch.setattr(gait_survey, "recorded_walk", lambda *_, each=each: each)
        gait_survey.survey(run, 1)
        np.testing.assert_allclose(run.columns("gaits")["cycles"], cycles / time[-1], rtol=1e-6)


def test_a_run_that_was_not_surveyed_says_what_to_do(run, tmp_path):
    from coachable.foundation.errors import RunFolderError

    (run.path / "gaits.parquet").rename(tmp_path / "gaits.parquet")
    with pytest.raises(RunFolderError, match="measure them: coachable gait"):
        run.columns("gaits")


@pytest.mark.parametrize("suffix", ["csv", "csv.gz", "parquet"])
def test_a_record_holds_the_very_numbers(run, walk, tmp_path, suffix, capsys):
    path = tmp_path / f"walk.{suffix}"
    cli.main(["record", str(run.path), "--setup", "both", "-o", str(path)])
    assert f"{len(walk.time)} samples" in capsys.readouterr().out
    (trace,) = read_trace(path, walk.trace.signals)
    np.testing.assert_array_equal(trace.time, walk.time)
    for name, values in walk.trace.values.items():
        np.testing.assert_array_equal(trace.values[name], values)


def test_explaining_a_run_explains_the_walk_that_is_recorded(run, tmp_path, capsys):
    explained = []
    cli.main(["record", str(run.path), "--setup", "both", "-o", str(tmp_path / "walk.parquet")])
    capsys.readouterr()
    own = str(run.path / "behaviour.behaviour")
    for source in ([str(run.path), "--setup", "both"], [own, str(tmp_path / "walk.parquet")]):
        with contextlib.suppress(SystemExit):  # 1 if the little-trained robot strays
            cli.main(["explain", *source, "--json"])
        explained.append(json.loads(capsys.readouterr().out) | {"trace": ""})
    assert explained[0] == explained[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["record", "RUN", "-o", "walk.txt"], "give a file that ends in"),
        (["record", "RUN", "--setup", "bath", "-o", "walk.csv"], "bath"),
        (["record", "nowhere", "-o", "walk.csv"], "nowhere is not a folder"),
        (["gait", "RUN", "--episodes", "0"], "episodes must be at least 1"),
        (["gait", "nowhere"], "nowhere is not a folder"),
    ],
)
def test_what_cannot_be_recorded_or_measured_is_said(run, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match="2"):
        cli.main([str(run.path) if word == "RUN" else word for word in arguments])
    assert message in capsys.readouterr().err


def test_a_strobe_picture_of_a_robot_is_drawn(run, tmp_path):
    cli.main(["watch", str(run.path), "--setup", "both", "-o", str(tmp_path / "strobe.png")])
    with Image.open(tmp_path / "strobe.png") as opened:
        picture = np.asarray(opened.convert("RGB")).reshape(-1, 3)
    for colour in ((0x00, 0x72, 0xB2), (0x22, 0x22, 0x22)):
        assert (picture == colour).all(axis=1).sum() > 100, "the latest pose: the leg in front, and the torso"


def test_a_film_shows_the_robot_where_it_is(run, walk, tmp_path):
    """From the side, the right leg, which is in front, is as wide and as high as its limbs."""
    view = SideView.of(walk)
    sample = len(walk.time) - 1
    picture = np.asarray(view.picture(sample))
    assert picture.shape == (SIDE, SIDE, 3)
    rows, columns = np.nonzero((picture == (0x00, 0x72, 0xB2)).all(axis=2))
    right = [walk.limbs.index(name) for name in ("thigh_geom", "leg_geom", "foot_geom")]
    ends, width = np.ptp(view.ends[sample, right], axis=(0, 1)), 2 * view.widths[right].max()
    scale = (np.ptp(columns) + 1) / (ends[0] + width)
    assert np.ptp(rows) + 1 == pytest.approx(scale * (ends[1] + width), rel=0.15)
    cli.main(
        ["watch", str(run.path), "--setup", "both", "--seconds", "0.3", "-o", str(tmp_path / "walk.gif")]
    )
    with Image.open(tmp_path / "walk.gif") as film:
        assert film.n_frames > 3


def test_a_view_since_a_time_is_the_rest_of_it(walk):
    view = SideView.of(walk)
    rest = view.since(walk.time[3])
    np.testing.assert_array_equal(rest.time, walk.time[3:])
    np.testing.assert_array_equal(rest.ends, view.ends[3:])
    np.testing.assert_array_equal(rest.phase, view.phase[3:])
