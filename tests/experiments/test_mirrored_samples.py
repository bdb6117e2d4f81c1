"""`mirror = "samples"` in a setup: what is learned from, what policies keep of it, and who refuses it."""

from dataclasses import replace

import numpy as np
import pytest

from coachable.behaviours.text.parser import parse
from coachable.envs.problem import EnvironmentProblem
from coachable.envs.symmetry.derived import RobotMirror
from coachable.experiments.plan import parse_plan
from coachable.experiments.trainers import process_lane
from coachable.foundation.errors import ParameterError, PlanError
from coachable.rewards.setup import DescribedSetup
from tests.envs.symmetry.rower import MIRROR, ROBOT, ROWING, TABLES
from tests.experiments.test_environment_ppo import trained

PLAN = f"""
env = "{ROBOT}"
behaviour = "rowing.behaviour"
steps = 320
evaluate_every = 320
evaluation_episodes = 1
{TABLES}[setups.samples]
reward_variant = "schedule"
observe = "memory"
mirror = "samples"
[setups.blind]
reward_variant = "schedule"
mirror = "samples"
[setups.plain]
reward_variant = "schedule"
mirror = false
[ppo]
n_envs = 2
n_steps = 40
batch_size = 40
n_epochs = 2
"""
ONE_SIDED = ROWING.replace("mirror left <-> right\n", "").replace(
    "cycle\n  left_ahead -> right_ahead\n",
    "  right_ahead for at most 0.4 s:  left_oar <= right_oar\n\n"
    "cycle\n  left_ahead -> right_ahead -> left_ahead\n",
)


def problem(mirror=MIRROR, behaviour=ROWING):
    signals = {"left_oar": 1, "right_oar": 2}
    return EnvironmentProblem(behaviour=parse(behaviour), env=ROBOT, signals=signals, mirror_image=mirror)


def setup(**options):
    return DescribedSetup(name="a", **{"reward_variant": "schedule", "mirror": "samples", **options})


@pytest.fixture
def experiment(tmp_path):
    (tmp_path / "rowing.behaviour").write_text(ROWING)
    return parse_plan(PLAN, "rower.toml", tmp_path)


@pytest.mark.parametrize(
    ("observe", "form"),
    [
        ("nothing", "schedule"),
        ("memory", "stay"),
        ("memory", "schedule"),
        ("memory", {"form": "schedule", "skip_fine": 0.1, "fine_spread": True}),
    ],
)
def test_what_is_added_is_what_the_robot_would_have_seen_and_been_paid_in_the_mirror(observe, form):
    rower, described = problem(), setup(observe=observe, reward_variant=form)
    mirror = rower.sample_mirror(described)
    assert mirror.observation.is_involution
    assert mirror.action.is_involution
    ours, theirs = (rower.training_environment(described, 100) for _ in range(2))
    rng = np.random.default_rng(0)
    for seed in range(3):
        seen, _ = ours.reset(seed=seed)
        image, _ = theirs.reset(options={"state": mirror.observation(np.r_[seen])[:4]})
        np.testing.assert_allclose(image, mirror.observation(seen), atol=1e-12)
        for action in rng.uniform(-1, 1, (30, 2)):
            (seen, paid, *_), (image, paid_there, *_) = ours.step(action), theirs.step(mirror.action(action))
            np.testing.assert_allclose(image, mirror.observation(seen), atol=1e-12)
            assert paid_there == pytest.approx(paid)


def test_it_takes_the_place_of_mirroring_by_phase():
    rower, by_phase = problem(), problem().mirror(setup(mirror=True))
    assert rower.sample_mirror(setup()) == RobotMirror(by_phase.observation, by_phase.action)
    assert rower.mirror(setup()) is None
    assert rower.policy_description(setup()) == {}
    assert {*rower.policy_description(setup(observe="memory"))} == {"memory"}
    for other in (None, True, False):
        assert rower.sample_mirror(setup(mirror=other)) is None


def test_a_plan_holds_it_and_its_policies_are_as_without(experiment, tmp_path):
    again = parse_plan(experiment.to_toml(), "again", described=experiment.behaviour)
    assert again == experiment
    assert [each.mirror for each in again.setups] == ["samples", "samples", False]
    policies = [
        trained(experiment, tmp_path / name, lane=lane)[1]["last"]
        for lane, name in enumerate(experiment.setup_names)
    ]
    assert [bool(policy.memory) for policy in policies] == [True, False, False]
    _, mirrored, plain = policies
    assert mirrored.description() == plain.description(), "how it was trained is not in the policy"
    assert not np.array_equal(mirrored.weights[0], plain.weights[0])


def test_a_lane_that_was_killed_goes_on_to_the_bit(experiment, tmp_path, monkeypatch):
    monkeypatch.setattr(process_lane, "SECONDS_BETWEEN_CHECKPOINTS", 0.0)
    monkeypatch.setattr(process_lane, "MOST_TIME_FOR_SAVING", np.inf)
    _, whole = trained(experiment, tmp_path / "whole")
    trained(experiment, tmp_path / "killed", stop_at=160)
    _, policies = trained(experiment, tmp_path / "killed")
    for which, policy in whole.items():
        for name, array in policy.tensors().items():
            np.testing.assert_array_equal(policies[which].tensors()[name], array, err_msg=name)


def test_a_robot_or_a_description_without_a_mirror_is_refused(experiment):
    with pytest.raises(ParameterError, match=r"mirror = 'samples': \S*Rower-v0 is no MuJoCo environment"):
        problem(mirror=None).sample_mirror(setup())
    with pytest.raises(ParameterError, match=r"mirror = 'samples': the description has no mirror"):
        problem(mirror=None, behaviour=ONE_SIDED).sample_mirror(setup())
    for without, said in (
        (problem(mirror=None), "no MuJoCo environment"),
        (problem(mirror=None, behaviour=ONE_SIDED), "the description has no mirror"),
    ):
        unable = replace(experiment, problem=without)
        with pytest.raises(PlanError, match=f"setup 'samples': mirror = 'samples': .*{said}"):
            unable.trainer.check(unable)


def test_another_word_is_refused(tmp_path):
    (tmp_path / "rowing.behaviour").write_text(ROWING)
    with pytest.raises(PlanError, match=r"setups\.samples\.mirror must be true or false or one of 'samples'"):
        parse_plan(PLAN.replace('"samples"', '"sample"', 1), "rower.toml", tmp_path)
    with pytest.raises(ParameterError, match="mirror must be true, false or 'samples', got 'sample'"):
        setup(mirror="sample")


def test_a_trainer_that_cannot_is_named(tmp_path):
    (tmp_path / "rowing.behaviour").write_text(ROWING)
    plan = PLAN.partition("[ppo]")[0]
    with pytest.raises(
        PlanError, match=r"'samples': mirror = 'samples' needs trainer = 'ppo'; sb3-sac adds no"
    ):
        parse_plan('trainer = "sb3-sac"' + plan, "rower.toml", tmp_path)
