"""A study whose setups differ in form, observation and time limit, and are evaluated by two rules."""

import numpy as np
import pytest

from coachable.analysis.measurements import measure
from coachable.envs.rollout import rollout, summary
from coachable.experiments import survival
from coachable.experiments.api import rollout as roll_out
from coachable.experiments.plan import parse_plan
from coachable.experiments.run_folder.schemas import schemas
from coachable.experiments.runner import run_experiment
from coachable.foundation.errors import RunFolderError
from coachable.verification.passport.closed_loop import Subject, lane_subject
from coachable.verification.passport.verify import verify

ARMS = """
name = "arms"
behaviour = "compass-walking-timed"
deterministic = ["expected-action", "clipped-mean"]
steps = 192
evaluate_every = 100
[seeds]
first = 3
count = 1
[ppo]
n_steps = 64
batch_size = 32
n_epochs = 2
hidden_sizes = [8, 8]
[setups.seeing]
orthant = 0.1
observe = "memory"
reward_variant = { form = "schedule", skip_fine = 1.0 }
[setups.hidden]
orthant = 0.1
observe = "value-only"
time_limit = "truncates"
reward_variant = { form = "schedule", skip_fine = 1.0 }
"""
SEED = 3


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    experiment = parse_plan(ARMS, "arms.toml")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(survival, "NUM_STARTS", 4)
        return run_experiment(experiment, tmp_path_factory.mktemp("runs") / "arms", progress=False)


def test_every_lane_has_a_batch_of_its_own_kind_and_is_evaluated_by_both_rules(run):
    assert run.status == "complete"
    assert run.manifest["device_layout"] == {"batch_sizes": [1, 1]}
    assert {"evaluations-clipped-mean", "survival-clipped-mean"} < set(schemas(run.experiment))
    for table in ("evaluations", "survival"):
        ours, theirs = run.columns(table), run.columns(f"{table}-clipped-mean")
        assert [*ours["lane"]] == [*theirs["lane"]]
        assert set(ours["lane"]) == {"seeing-3", "hidden-3"}
    lengths = [run.columns(f"evaluations{rule}")["hip_x"] for rule in ("", "-clipped-mean")]
    assert not np.array_equal(*lengths)


def test_what_is_kept_does_what_was_evaluated_by_either_rule(run):
    assert run.policy("seeing", SEED).deterministic == "expected-action"
    for setup in run.experiment.setups:
        task = run.experiment.problem.task(setup.of_policy)
        for rule, table in (
            ("expected-action", "evaluations"),
            ("clipped-mean", "evaluations-clipped-mean"),
        ):
            policy = run.policy(setup.name, SEED, deterministic=rule)
            found, kept = summary(task, rollout(task, policy)), run.columns(table)
            last = {name: values[kept["lane"] == f"{setup.name}-3"][-1] for name, values in kept.items()}
            assert float(found.hip_x) == pytest.approx(last["hip_x"], rel=1e-4)
            assert float(found.episode_return) == pytest.approx(last["return"], rel=1e-4)


def test_a_seeing_policys_file_tells_what_it_sees_and_rolls_out_by_itself(run):
    seeing, hidden = run.policy("seeing", SEED), run.policy("hidden", SEED)
    assert seeing.observation_names[4:] == (
        *(f"expected O{k}" for k in range(1, 5)),
        "time over",
        "visited",
    )
    assert hidden.observation_names == ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
    assert (hidden.memory, hidden.weights[0].shape) == ("", (8, 4))
    for name, policy in (("seeing", seeing), ("hidden", hidden)):
        walked, stored = roll_out(policy), run.trajectory(name, SEED)
        np.testing.assert_allclose(walked.theta_1, stored["theta_1"], atol=1e-4)
        assert len(walked.time) == len(stored["t"])


def test_measurements_are_of_the_rule_that_is_asked_for(run):
    first, other = measure(run), measure(run, "clipped-mean")
    assert first.experiment.deterministic == ("expected-action",)
    kept = run.columns("evaluations-clipped-mean")
    assert other["seeing"].final_distance[0] == kept["hip_x"][kept["lane"] == "seeing-3"][-1]
    assert not np.array_equal(first["seeing"].distance, other["seeing"].distance)
    with pytest.raises(RunFolderError, match="did you mean 'clipped-mean'"):
        measure(run, "clipped-men")


def test_returns_are_measured_against_the_baselines_under_the_same_setup(run):
    baseline = run.baseline
    assert baseline["returns"].keys() == {"seeing", "hidden"}
    paid = np.dot(run.experiment.setup("seeing").weights, [*baseline["terms"].values()])
    assert baseline["returns"]["seeing"] == pytest.approx(paid)


def test_a_passport_says_what_its_controller_remembers(run):
    subject = lane_subject(run, "seeing", SEED)
    seeing = subject.walker
    assert seeing.memory[0].startswith("expected ")
    both = [lane_subject(run, "hidden", SEED), subject]
    assert both[0].walker.memory == ()
    hidden, seen = verify(both, "quick", None)
    assert (hidden.walker, seen.walker) == (both[0].walker, seeing)
    subject = lane_subject(run, "hidden", SEED)
    assert isinstance(subject, Subject)
    assert (subject.walker.name, subject.walker.deterministic) == ("hidden-3", "expected-action")
    other = lane_subject(run, "hidden", SEED, deterministic="clipped-mean")
    assert (other.walker.name, other.walker.deterministic) == ("hidden-3-clipped-mean", "clipped-mean")
