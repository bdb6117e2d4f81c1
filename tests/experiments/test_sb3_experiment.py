"""A plant trained by stable-baselines3: the same folder, tables and commands as with our PPO."""

import json

import jax
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the [sb3] extra: pip install 'coachable[sb3]'")

from coachable.automata.cycle_progress import completed_cycles
from coachable.envs.rollout import rollout, summary
from coachable.experiments.plan import load_plan, parse_plan
from coachable.experiments.runner import run_experiment
from coachable.experiments.trainers.compiled import Tasks
from coachable.experiments.trainers.process_lane import load_lane
from coachable.foundation.errors import PlanError, RunFolderError

pytestmark = pytest.mark.sb3

PLAN = """
name = "small-sb3"
trainer = "sb3-ppo"
steps = 200
evaluate_every = 100
setups = ["orthant", "sparse"]
[seeds]
first = 3
count = 1
[sb3]
n_steps = 64
batch_size = 32
n_epochs = 1
"""


@pytest.fixture(scope="module")
def experiment():
    return parse_plan(PLAN, "small.toml")


@pytest.fixture(scope="module")
def run(experiment, tmp_path_factory):
    return run_experiment(experiment, tmp_path_factory.mktemp("runs") / "sb3", progress=False)


def test_the_folder_is_that_of_every_plant(run, experiment):
    assert run.status == "complete"
    assert run.experiment == experiment
    evaluations = run.columns("evaluations")
    # Four updates of 64 steps; the evaluation at step 100 uses the weights after the first.
    assert [*evaluations["step"][evaluations["lane"] == "orthant-3"]] == [100, 200, 256]
    assert set(run.columns("survival")["lane"]) == {"orthant-3", "sparse-3"}
    assert run.manifest["baseline"]["hip_x"] == pytest.approx(7.8334, abs=1e-4)


def test_the_kept_policy_walks_as_the_last_evaluation_tells(run, experiment):
    tasks = Tasks.of(experiment)
    evaluations = run.columns("evaluations")
    for lane in experiment.lanes:
        task = tasks.weighted(tasks.evaluation, lane)
        policy = run.policy(lane.setup, lane.seed)
        assert policy.observation_names == ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
        walk = jax.jit(lambda task=task, policy=policy: summary(task, rollout(task, policy)))()
        last = {name: values[evaluations["lane"] == lane.name][-1] for name, values in evaluations.items()}
        assert float(walk.hip_x) == pytest.approx(last["hip_x"], rel=1e-5)
        assert float(walk.episode_return) == pytest.approx(last["return"], rel=1e-5)
        stored = run.trajectory(lane.setup, lane.seed)
        assert len(stored["t"]) == last["length"] + 1
        assert last["cycles"] == completed_cycles(run.behaviour, stored["phase"])


def test_setups_differ_in_what_they_pay_and_not_in_the_seed(run):
    episodes = run.columns("episodes")
    assert set(episodes["lane"]) == {"orthant-3", "sparse-3"}
    first = {lane: episodes["return"][episodes["lane"] == lane][0] for lane in set(episodes["lane"])}
    assert first["orthant-3"] != first["sparse-3"]


def test_the_same_command_finds_it_complete(run, experiment):
    assert run_experiment(experiment, run.path, progress=False).manifest == run.manifest


def test_settings_of_the_other_trainer_are_refused(tmp_path):
    with pytest.raises(PlanError, match="the table sb3 is not for trainer = 'ppo'"):
        parse_plan(PLAN.replace('"sb3-ppo"', '"ppo"'), "small.toml")
    with pytest.raises(PlanError, match="no setting 'n_step'"):
        run_experiment(parse_plan(PLAN.replace("n_epochs", "n_step"), "small.toml"), tmp_path / "run")
    assert not (tmp_path / "run").exists()
    assert load_plan("paper", trainer="sb3-sac").total_steps == 500_000


def test_a_lane_that_was_damaged_is_named(tmp_path):
    (tmp_path / "batch-000.safetensors").write_bytes(b"nothing")
    with pytest.raises(RunFolderError, match="batch-000"):
        load_lane(tmp_path / "batch-000.safetensors")


def test_the_resolved_plan_holds_the_settings_of_its_trainer_alone(run):
    text = (run.path / "plan.toml").read_text()
    assert "[sb3]" in text
    assert "[ppo]" not in text
    assert json.loads((run.path / "manifest.json").read_text())["device_layout"] == {"batch_sizes": [1, 1]}
    assert np.isfinite(run.columns("evaluations")["return"]).all()
