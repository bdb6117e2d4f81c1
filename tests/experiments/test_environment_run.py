"""A small experiment with a pendulum: its folder, its numbers, going on, and what is refused beforehand."""

import json
import random
import shutil
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import gymnasium
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("stable_baselines3", reason="needs the [sb3] extra: pip install 'coachable[sb3]'")

import torch

from coachable import cli
from coachable.analysis.gait_table import by_seed
from coachable.analysis.measurements import measure
from coachable.automata.monitor import Monitor
from coachable.behaviours.text.parser import parse
from coachable.experiments.assessment import assessment
from coachable.experiments.experiment import Lane
from coachable.experiments.plan import load_plan, parse_plan
from coachable.experiments.recorded_episodes import recorded_walk
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.runner import run_experiment
from coachable.foundation.errors import BehaviourError, CoachableError, PlanError, RunFolderError
from tests.experiments.swing import SWING

pytestmark = pytest.mark.sb3

PLAN = """
env = "Pendulum-v1"
behaviour = "swing.behaviour"
steps = 256
evaluate_every = 128
evaluation_episodes = 2
[signals]
height = 0
speed = 2
[setups.alone]
weight = 0
[setups.both]
weight = 0.5
append_phase = true
[sb3]
n_steps = 64
batch_size = 32
n_epochs = 1
normalize = true
"""


STANDING_HOPPER = 'env_options = { frame_skip = 0 }\nenv = "Hopper-v5"'


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plans")
    (folder / "swing.behaviour").write_text(SWING)
    (folder / "swing.toml").write_text(PLAN)
    return folder / "swing.toml"


@pytest.fixture(scope="module")
def run(plan, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "swing"
    return run_experiment(load_plan(plan), out, progress=False, track=True)


def test_the_folder_holds_what_was_trained(run):
    assert run.status == "complete"
    assert run.manifest["format_version"] == 2
    assert run.experiment.name == run.experiment.problem.robot == "Pendulum-v1"
    assert run.baseline is None
    assert not (run.path / "checkpoints").exists()
    assert {path.name for path in (run.path / "policies").glob("*.json")} == {
        f"{setup}-0-{which}.json" for setup in ("alone", "both") for which in ("last", "best")
    }
    assert list((run.path / "tensorboard" / "both-0").glob("events*"))


def test_evaluations_are_what_the_last_policy_reaches(run):
    columns = run.columns("evaluations")
    assert sorted(set(columns["step"])) == [128, 256]
    for setup in run.experiment.setups:
        measure = assessment(run.experiment, Lane(setup.name, 0))
        again = measure.evaluate(run.policy(setup.name, 0))
        mine = (columns["lane"] == f"{setup.name}-0") & (columns["step"] == 256)
        for name in ("return", "environment", "behaviour", "length", "share_in_cycle", "cycles"):
            np.testing.assert_allclose(columns[name][mine], again[name], rtol=1e-4, err_msg=name)
        assert (columns["length"][mine] == 200).all()
        monitor = Monitor(run.behaviour)
        first = recorded_walk(run, setup.name, 0)
        monitor.feed_rows(first.time, first.trace.values)
        assert monitor.report().cycles == (columns["cycles"][mine][0],)
        assert not columns["fell"][mine].any(), "an episode that was cut off has not fallen"


def test_returns_add_up_and_episodes_follow_one_another(run):
    for table in ("episodes", "evaluations"):
        columns = run.columns(table)
        np.testing.assert_allclose(
            columns["return"], columns["environment"] + columns["behaviour"], rtol=1e-4
        )
        alone = columns["lane"] == "alone-0"
        assert alone.any()
        assert (columns["behaviour"][alone] == 0).all()
        assert (columns["behaviour"][~alone] > 0).any()
    episodes = run.columns("episodes")
    assert list(episodes["end_step"]) == [200, 200], "an episode a lane, of 256 steps"


def test_the_appended_phase_is_part_of_the_policys_input(run):
    assert run.policy("alone", 0).weights[0].shape[1] == 3
    assert run.policy("both", 0).weights[0].shape[1] == 3 + 3
    assert run.policy("both", 0).scale is not None


def test_the_same_command_finds_it_complete_and_another_plan_is_refused(run, plan):
    again = run_experiment(load_plan(plan), run.path, progress=False)
    assert again.manifest == run.manifest
    with pytest.raises(RunFolderError, match="steps: 256 → 300"):
        run_experiment(load_plan(plan, steps=300), run.path, progress=False)


def test_means_by_seed_are_those_of_the_table(run):
    steps, rows = by_seed(run, "both", "return")
    assert list(steps) == [128, 256]
    columns = run.columns("evaluations")
    mine = (columns["lane"] == "both-0") & (columns["step"] == 256)
    assert rows.shape == (1, 2)
    assert rows[0, 1] == pytest.approx(columns["return"][mine].mean(), rel=1e-6)
    assert by_seed(run, "both", "length")[1][0, 1] == measure(run)["both"].final["length"][0] == 200


def test_stopped_it_goes_on_from_its_checkpoint(plan, tmp_path):
    experiment = load_plan(plan, seeds=1)
    counted = []

    def interrupted(works, workers, receive, watch):
        def stop(progress):
            counted.append(progress.steps)
            if progress.steps == 128:
                raise KeyboardInterrupt

        assert works[0].finished() is None
        works[0].run(lambda progress: None)
        last = works[0].finished()
        assert (last.steps, last.done, len(last.latest["return"])) == (256, True, 2)
        works[1].run(stop)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("coachable.experiments.trainers.environment_trainer.run_lanes", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run_experiment(experiment, tmp_path / "run", progress=False)
    stopped = Run.open(tmp_path / "run")
    assert stopped.status == "interrupted"
    assert counted[-1] == 128
    assert sorted(stopped.columns("evaluations")["step"]) == [128, 128, 128, 128, 256, 256]
    done = run_experiment(experiment, tmp_path / "run", progress=False)
    assert done.status == "complete"
    steps = done.columns("evaluations")
    for lane in ("alone-0", "both-0"):
        assert list(steps["step"][steps["lane"] == lane]) == [128, 128, 256, 256]


def test_the_environments_reward_can_be_put_together_anew(plan):
    text = PLAN.replace("[setups.alone]\nweight = 0", "[setups.alone]\nweight = 0\nterms = { bonus = 2 }")
    experiment = parse_plan(text, "plan.toml", described=parse(SWING))
    env = experiment.problem.environment(experiment.setup("alone"))
    env.reset(seed=0)
    with pytest.raises(CoachableError, match="no term 'bonus'"):
        env.step(env.action_space.sample())


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ("Pendulum-v1", "Pendulun-v1", PlanError, "cannot be made"),
        ("Pendulum-v1", "no_such_module:Thing-v0", PlanError, "cannot be made"),
        (
            'env = "Pendulum-v1"',
            STANDING_HOPPER,
            PlanError,
            r"with frame_skip = 0 \(env_options\): ZeroDivisionError",
        ),
        ("Pendulum-v1", "CartPole-v1", PlanError, "actions must be a row"),
        ("height = 0\n", "", CoachableError, "height"),
        ("speed = 2", "speed = 9", CoachableError, "signal 'speed' cannot be read after the reset"),
        ("n_steps = 64", "n_stepz = 64", PlanError, "no setting 'n_stepz'"),
        ("n_steps = 64", "n_steps = 1", PlanError, "does not take these settings"),
        ("swing.behaviour", "swim.behaviour", BehaviourError, "swim"),
    ],
)
def test_what_cannot_be_trained_is_refused_before_a_folder_is_made(plan, tmp_path, old, new, error, message):
    assert old in PLAN
    text = PLAN.replace(old, new)
    with pytest.raises(error, match=message):
        run_experiment(parse_plan(text, "plan.toml", plan.parent), tmp_path / "run", progress=False)
    assert not (tmp_path / "run").exists()


def test_nobody_works_for_less_than_one(plan, tmp_path):
    with pytest.raises(PlanError, match="workers must be at least 1"):
        run_experiment(load_plan(plan), tmp_path / "run", workers=0)


def call(capsys, *arguments):
    try:
        cli.main([str(argument) for argument in arguments])
        status = 0
    except SystemExit as stopped:
        status = stopped.code
    out, err = capsys.readouterr()
    return out, err, status


def test_the_table_is_printed_and_drawn(run, tmp_path, capsys):
    out, _, status = call(capsys, "table", run.path, "--out", tmp_path)
    assert status == 0
    assert "2 setups × 1 seed × 256 steps" in out
    assert "alone" in out
    assert (tmp_path / "table.md").read_text().count("|") > 20
    with Image.open(tmp_path / "learning_curves.png") as picture:
        assert picture.size[0] > 1000


def test_it_is_compared_and_reported(run, tmp_path, capsys):
    out, err, status = call(capsys, "compare", run.path, run.path, "-o", tmp_path / "compared")
    assert (status, err) == (0, "")
    assert "final environment's return" in out
    assert (tmp_path / "compared" / "comparison-both.svg").exists()
    out, err, status = call(capsys, "report", run.path, "-o", tmp_path / "report.html")
    assert status == 0, err
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Pendulum-v1 is a Gymnasium environment" in page
    assert "approx_kl" in page, "the updates' diagnostics"


def test_a_robot_without_feet_has_no_gait(run, capsys):
    _, err, status = call(capsys, "gait", run.path)
    assert status == 2
    assert "no signal that ends in foot_contact" in err
    _, err, status = call(capsys, "gait", run.path, "--speed", "nan")
    assert status == 2
    assert "speed must be a finite number" in err
    assert not (run.path / "gaits.parquet").exists()


def test_a_trained_robot_can_be_watched(run, tmp_path, capsys):
    film = tmp_path / "swing.gif"
    _, err, status = call(capsys, "watch", run.path, "--setup", "both", "--seconds", 0.5, "-o", film)
    assert status == 0, err
    with Image.open(film) as picture:
        assert picture.n_frames > 5
    _, err, status = call(capsys, "watch", run.path, "-o", tmp_path / "swing.png")
    assert status == 2
    assert "in a film: .gif or .mp4" in err


def with_signals(run, signals):
    problem = replace(run.experiment.problem, signals=signals)
    return replace(run, experiment=replace(run.experiment, problem=problem))


def test_signals_are_recorded_as_the_reward_reads_them(run):
    """Also where the plan counts columns from the end, and the phase has been appended behind them."""
    signals = {"height": -3, "speed": -1}
    from_the_end = with_signals(run, signals)
    for setup in ("alone", "both"):
        expected = recorded_walk(run, setup, 0, seconds=1.0)
        found = recorded_walk(from_the_end, setup, 0, seconds=1.0)
        for name in signals:
            numbers, right = found.trace.values[name], expected.trace.values[name]
            np.testing.assert_array_equal(numbers, right, err_msg=setup)


class Closing(gymnasium.Wrapper):
    """Notes which environments are open."""

    open: ClassVar[set] = set()

    def __init__(self, env):
        super().__init__(env)
        self.open.add(self)

    def close(self):
        self.open.discard(self)
        super().close()


@pytest.fixture
def opened(monkeypatch):
    make = gymnasium.make
    monkeypatch.setattr(gymnasium, "make", lambda *args, **kwargs: Closing(make(*args, **kwargs)))
    Closing.open.clear()
    return Closing.open


def test_trying_a_plan_out_leaves_nothing_behind(plan, opened):
    experiment = parse_plan(plan.read_text() + "n_envs = 2\n", "plan", described=parse(SWING))
    num_threads = torch.get_num_threads()
    torch.set_num_threads(num_threads + 1)
    drawn = []
    for seed in (7, 8):
        np.random.seed(seed), torch.manual_seed(seed)
        expected = np.random.random(), torch.rand(1).item()
        random.seed(seed), np.random.seed(seed), torch.manual_seed(seed)
        experiment.trainer.check(experiment)
        assert (np.random.random(), torch.rand(1).item()) == expected
        drawn.append(random.random())  # beartype draws from it, too, so what comes is not known
    assert drawn[0] != drawn[1]
    assert torch.get_num_threads() == num_threads + 1
    assert not opened
    torch.set_num_threads(num_threads)


def test_a_walk_that_fails_closes_its_environment(run, opened):
    broken = with_signals(run, {"height": 0, "speed": 99})
    with pytest.raises(CoachableError, match="signal 'speed' cannot be read"):
        recorded_walk(broken, "alone", 0)
    assert not opened


def test_a_damaged_run_is_refused_with_the_file(run, tmp_path):
    copy = shutil.copytree(run.path, tmp_path / "copy")
    manifest = json.loads((copy / "manifest.json").read_text())
    (copy / "evaluations.parquet").write_bytes(b"no table")
    with pytest.raises(RunFolderError, match=r"evaluations\.parquet is damaged"):
        Run.open(copy).columns("evaluations")
    (copy / "manifest.json").write_text(json.dumps(manifest | {"files": []}))
    with pytest.raises(RunFolderError, match=r"manifest\.json is damaged: files must be a table, got \[\]"):
        Run.open(copy)
    del manifest["reward_hashes"]
    (copy / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(RunFolderError, match="lacks 'reward_hashes'"):
        Run.open(copy)


def test_train_needs_a_plan_or_an_environment(capsys):
    _, err, status = call(capsys, "train", "--behaviour", "hop")
    assert status == 2
    assert "train what?" in err
    walker = ("--env", "coachable/CompassWalker-v0", "--behaviour", "compass-walking")
    _, err, status = call(capsys, "train", *walker, "--weight", "0.5")
    assert status == 2
    assert "the weight of a plant's reward is in its setup's table" in err


def test_runs_of_format_version_1_can_be_read():
    published = Path(__file__).parents[2] / "docs" / "results" / "walker2d" / "walk"
    run = Run.open(published)
    assert run.manifest["format_version"] == 1
    assert run.experiment.problem.robot == "Walker2d-v5"
    assert np.isnan(run.columns("evaluations")["cycles"]).all(), "that version did not count them"
    assert len(run.columns("gaits")["lane"]) == 10 * len(run.lanes)
    lane = run.lanes[0]
    assert run.policy(lane.setup, lane.seed).weights[0].shape[1] == 17


def test_an_unfinished_run_of_format_version_1_is_not_gone_on_with(run, plan, tmp_path):
    copy = shutil.copytree(run.path, tmp_path / "copy")
    manifest = json.loads((copy / "manifest.json").read_text())
    old = manifest | {"format_version": 1, "status": "interrupted"}
    (copy / "manifest.json").write_text(json.dumps(old))
    assert len(Run.open(copy).columns("evaluations")["step"])
    with pytest.raises(RunFolderError, match="unfinished and of format_version 1"):
        run_experiment(load_plan(plan), copy, progress=False)
