"""Plans of trainings: from files and options to a resolved one, and what is refused."""

import pytest

from coachable.experiments.sb3_lane import require_sb3
from coachable.experiments.training import (
    DescribedSetup,
    Training,
    load_training,
    parse_training,
    shipped_settings,
    trainer_settings,
)
from coachable.foundation.errors import PlanError

PLAN = """
name = "mine"
env = "Pendulum-v1"
behaviour = "swing.behaviour"
steps = 5000
[seeds]
first = 7
count = 2
[signals]
height = 0
speed = "speed"
[setups.alone]
weight = 0
[setups.both]
weight = 0.5
append_phase = true
[setups.described]
terms = { reward_survive = 1 }
[sb3]
n_steps = 512
[sb3.policy_kwargs]
net_arch = [32, 32]
"""


def test_a_plan_says_what_it_says_and_defaults_fill_the_rest():
    training = parse_training(PLAN, "mine.toml")
    assert training.seeds == range(7, 9)
    assert [setup.weight for setup in training.setups] == [0.0, 0.5, 1.0]
    assert training.setup("both").append_phase
    assert training.setup("described").terms == {"reward_survive": 1}
    assert training.trainer == "sb3-ppo"
    assert training.total_steps == 5120  # ten updates
    assert [lane.name for lane in training.lanes][:3] == ["alone-7", "both-7", "described-7"]


def test_the_resolved_plan_reads_back_as_itself():
    training = parse_training(PLAN, "mine.toml")
    assert parse_training(training.to_toml(), "plan.toml") == training


def test_options_of_an_environment_may_be_whatever_toml_has():
    options = """
env_options = { day = 2020-01-31, at = 07:32:00, lanes = [{ width = 3.5, marks = ["a"] }, {}], on = true }
"""
    training = parse_training(options + PLAN, "plan")
    assert training.env_options["lanes"] == [{"width": 3.5, "marks": ["a"]}, {}]
    assert parse_training(training.to_toml(), "again") == training


def test_a_behaviour_is_looked_for_beside_the_plan(tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    assert load_training(tmp_path / "plan.toml").behaviour == str(tmp_path / "swing.behaviour")


def test_options_replace_what_the_plan_says():
    training = parse_training(
        PLAN, "mine.toml", seeds=1, weight=2.0, trainer="sb3-sac", settings={"batch_size": 32}
    )
    assert len(training.seeds) == 1
    assert {setup.weight for setup in training.setups} == {2.0}
    assert training.sb3 == {"n_steps": 512, "policy_kwargs": {"net_arch": [32, 32]}, "batch_size": 32}
    assert training.total_steps == 5000


def test_options_alone_are_a_plan():
    training = load_training(None, env="Walker2d-v5", behaviour="perry-gait", steps=100)
    assert (training.name, training.setups) == ("Walker2d-v5", (DescribedSetup(name="both"),))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('env = "A-v0"', "which behaviour"),
        ('behaviour = "hop"', "which environment"),
        ('env = "A-v0"\nbehaviour = "hop"\nsteps = 0', "steps must be at least 1"),
        ('env = "A-v0"\nbehaviour = "hop"\nstep = 1', "unknown key 'step'; did you mean 'steps'"),
        ('env = "A-v0"\nbehaviour = "hop"\ntrainer = "ppo"', "take sb3-ppo"),
        ('env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nweigth = 1', "setups.a.weigth"),
        ('env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nweight = "much"', "setups.a.weight must be a number"),
        (
            'env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nterms = { x = "y" }',
            "setups.a.terms.x must be a number",
        ),
        ('env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nreward_variant = "sty"', "stay"),
        ('env = "A-v0"\nbehaviour = "hop"\n[setups."a/b"]', "it names files"),
        ('env = "A-v0"\nbehaviour = "hop"\n[sb3]\nn_steps = 0.5', "whole number, at least 1"),
        (
            'env = "A-v0"\nbehaviour = "hop"\n[seeds]\nfirst = 500_000\ncount = 1',
            "seeds must be less than 500,000, got 500,000",
        ),
        ("env = ", "is not TOML"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_key(text, message):
    with pytest.raises(PlanError, match=message):
        parse_training(text, "plan.toml")


def test_a_weight_that_is_no_number_is_refused():
    with pytest.raises(PlanError, match="weight must be a finite number"):
        DescribedSetup(name="a", weight=float("nan"))
    with pytest.raises(PlanError, match="each with a name of its own"):
        Training(name="n", env="e", behaviour="b", setups=(DescribedSetup(name="a"),) * 2)


@pytest.mark.parametrize("name", shipped_settings())
def test_settings_that_ship_are_settings_of_their_trainer(name):
    pytest.importorskip("stable_baselines3")
    require_sb3(f"sb3-{name.partition('-')[0]}", trainer_settings(name))


def test_settings_that_do_not_exist_are_refused_with_the_nearest():
    with pytest.raises(PlanError, match="ppo-walker2d"):
        trainer_settings("ppo-walker")


def test_without_stable_baselines3_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr("coachable.experiments.sb3_lane.find_spec", lambda package: None)
    with pytest.raises(PlanError, match=r"pip install 'coachable\[sb3\]'"):
        require_sb3("sb3-ppo", {})
