"""A plan survives being written, says what is wrong with it, and knows what its semantics imply."""

import dataclasses
import re
from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.behaviours import load_behaviour
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.cli.experiments import warn_of_paid_endings
from coachable.envs.problem import EnvironmentProblem, PlantProblem
from coachable.experiments.experiment import Experiment, differences
from coachable.experiments.layout import batch_sizes
from coachable.experiments.named_modules import modules_named, require_trusted
from coachable.experiments.plan import (
    load_plan,
    parse_plan,
    shipped_plans,
    shipped_settings,
    trainer_settings,
)
from coachable.experiments.trainers.environment_ppo import EnvironmentPPO
from coachable.experiments.trainers.ppo import PPO
from coachable.experiments.trainers.stable_baselines3 import StableBaselines3
from coachable.foundation.errors import BehaviourError, ParameterError, PlanError
from coachable.learning.config import EnvironmentPPOConfig, PPOConfig
from coachable.plants.compass import CompassParameters, CompassWalker
from coachable.rewards.forms import Schedule, Stay
from coachable.rewards.setup import PAPER_SETUPS, TERM_NAMES, DescribedSetup, RewardSetup
from tests.experiments.swing import SWING

WALKING = load_behaviour("compass-walking")

names = st.from_regex(r"[A-Za-z0-9_+-]{1,12}", fullmatch=True)
finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
positive = st.floats(min_value=1e-3, max_value=1e3)
setups = st.builds(RewardSetup, names, *[finite] * 5)
plan_fields = st.fixed_dictionaries(
    {
        "name": names,
        "semantics": st.sampled_from(["paper", "released-code"]),
        "reward_variant": st.sampled_from(["stay", "equation", "released"]),
        "behaviour": st.text(st.characters(codec="utf-8"), min_size=1),
        "clock": st.sampled_from(["free", "touchdown"]),
        "steps": st.integers(1, 10**9),
        "evaluate_every": st.integers(1, 10**6),
        "first_seed": st.integers(0, 10**6),
        "num_seeds": st.integers(1, 1000),
        "setups": st.lists(setups, min_size=1, max_size=4, unique_by=lambda s: s.name).map(tuple),
        "plant": st.builds(
            CompassWalker, st.builds(CompassParameters, positive, positive, positive, positive, positive)
        ),
        "ppo": st.builds(
            PPOConfig,
            learning_rate=positive,
            n_steps=st.just(128),
            batch_size=st.sampled_from([2, 32, 128]),
            gamma=st.floats(0, 1),
            hidden_sizes=st.tuples(st.integers(1, 99), st.integers(1, 99)),
        ),
    }
)


def experiment_of(fields):
    """An experiment with a plant, from the fields of its plan."""
    problem = PlantProblem(
        behaviour=WALKING, **{key: fields[key] for key in ("semantics", "reward_variant", "clock", "plant")}
    )
    rest = {
        key: fields[key] for key in ("name", "steps", "evaluate_every", "first_seed", "num_seeds", "setups")
    }
    return Experiment(problem=problem, trainer=PPO(fields["ppo"]), described_by=fields["behaviour"], **rest)


@given(plan_fields)
def test_a_written_plan_is_the_same_plan(fields):
    experiment = experiment_of(fields)
    text = experiment.to_toml()
    again = parse_plan(text, "plan.toml", described=WALKING)
    assert again == experiment
    assert again.to_toml() == text


@given(plan_fields, plan_fields, st.sets(st.sampled_from(["name", "steps", "setups", "plant", "clock"])))
def test_plans_differ_exactly_where_their_differences_say(fields, others, changed):
    one, other = experiment_of(fields), experiment_of(fields | {key: others[key] for key in changed})
    assert bool(differences(one, other)) == (one != other)
    assert {line.split(":")[0].split(".")[0] for line in differences(one, other)} <= changed


def test_differences_name_the_key_and_both_values():
    one, other = load_plan("paper"), load_plan("paper", steps=1000, setups=["sparse"])
    found = differences(one, other)
    assert "steps: 500000 → 1000" in found
    assert "setups.orthant.orthant: 0.01 → 'absent'" in found


def test_the_plans_that_ship_are_the_papers():
    assert shipped_plans() == ["beyond-paper", "certifiable", "demo", "paper", "paper-100"]
    paper, hundred = load_plan("paper"), load_plan("paper-100")
    assert paper == Experiment(
        name="paper",
        problem=PlantProblem(behaviour=WALKING, plant=CompassWalker()),
        setups=tuple(PAPER_SETUPS.values()),
        trainer=PPO(),
        described_by="compass-walking",
        steps=500_000,
        evaluate_every=10_000,
        num_seeds=15,
    )
    assert paper.setups == tuple(PAPER_SETUPS.values())
    assert (len(paper.lanes), paper.num_updates) == (60, 245)
    assert len(hundred.lanes) == 400
    assert not set(hundred.seeds) & set(paper.seeds)
    assert [lane.name for lane in load_plan("demo").lanes] == [f"orthant-{seed}" for seed in range(4)]


def test_the_released_code_brings_its_own_reward_and_behaviour():
    released = load_plan("paper", semantics="released-code")
    assert (released.problem.reward_variant, released.described_by) == (
        "released",
        "compass-walking-released",
    )
    assert released.problem.distance == "foot_x"
    given = load_plan("paper", semantics="released-code", reward_variant="stay")
    assert (given.problem.reward_variant, given.described_by) == ("stay", "compass-walking-released")


def test_options_win_over_the_file_and_the_file_over_the_defaults():
    text = 'name = "mine"\nsteps = 7\nclock = "touchdown"\n[ppo]\nn_steps = 128\n[seeds]\nfirst = 3\n'
    experiment = parse_plan(text, "mine.toml", steps=9, seeds=2)
    problem = experiment.problem
    assert (experiment.steps, problem.clock, problem.semantics) == (9, "touchdown", "paper")
    assert experiment.trainer == PPO(PPOConfig(n_steps=128))
    assert list(experiment.seeds) == [3, 4]


def test_a_setup_of_ones_own_needs_only_its_weights():
    text = 'name = "mine"\n[setups.eager]\nforward = 1\n[setups.orthant]\northant = 0.02\n'
    assert parse_plan(text, "mine.toml").setups == (
        RewardSetup("eager", forward=1.0),
        RewardSetup("orthant", orthant=0.02),
    )
    assert parse_plan(text, "mine.toml", setups=["sparse", "eager"]).setups == (
        PAPER_SETUPS["sparse"],
        RewardSetup("eager", forward=1.0),
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("stpes = 3", ["mine.toml", "'stpes'", "'steps'"]),
        ("[ppo]\nn_step = 3", ["mine.toml", "'ppo.n_step'", "'n_steps'"]),
        ("[plant]\nhip_mas = 3.0", ["'plant.hip_mas'", "'hip_mass'"]),
        ("[setups.mine]\nfoward = 1.0", ["'setups.mine.foward'", "'forward'"]),
        ("[seeds]\nfirst = 1\nnumber = 2", ["'seeds.number'", "'count'"]),
        ("steps = 3.5", ["steps must be a whole number", "3.5"]),
        ("steps = true", ["steps must be a whole number"]),
        ("semantics = 3", ["semantics must be text"]),
        ("plant = 3", ["plant must be a table"]),
        ("setups = 3", ["setups must be"]),
        ('setups = ["orthan"]', ["'orthan'", "'orthant'"]),
        ("setups = []", ["at least one setup"]),
        ('setups = ["sparse", "sparse"]', ["'sparse'", "more than once"]),
        ('[setups."a/b"]\nforward = 1.0', ["'a/b'"]),
        ('semantics = "papr"', ["semantics", "'papr'", "'paper'"]),
        ('clock = "fre"', ["clock", "'free'"]),
        ('reward_variant = "stey"', ["reward_variant", "'stay'"]),
        ("steps = 0", ["steps must be at least 1"]),
        ("[seeds]\nfirst = -1", ["first_seed"]),
        ("[ppo]\nn_steps = 100", ["batch_size", "n_steps = 100"]),
        ("[plant]\nhip_mass = -1.0", ["hip_mass"]),
        ("[setups.mine]\nforward = nan", ["setups.mine", "forward"]),
        ("steps =\nseeds = 3", ["TOML", "line 2"]),
    ],
)
def test_a_mistake_is_named_with_its_file_its_key_and_what_was_meant(text, said):
    with pytest.raises(PlanError) as error:
        parse_plan('name = "mine"\n' + text, "mine.toml")
    for words in ["mine.toml", *said]:
        assert words in str(error.value)


def test_a_plan_without_a_name_and_a_plan_that_is_not_there():
    with pytest.raises(PlanError, match="no name"):
        parse_plan("steps = 3", "mine.toml")
    with pytest.raises(PlanError, match=r"'papr' .* did you mean 'paper'"):
        load_plan("papr")
    with pytest.raises(PlanError, match="'sead'"):
        load_plan("paper", sead=3)


def test_a_plan_names_a_behaviour_that_ships_or_a_file_beside_it(tmp_path):
    plan = tmp_path / "mine.toml"
    plan.write_text('name = "mine"\nbehaviour = "walk.behaviour"\n', encoding="utf-8")
    with pytest.raises(BehaviourError, match=r"walk\.behaviour.*neither a behaviour that ships nor a file"):
        load_plan(plan)
    (tmp_path / "walk.behaviour").write_text(to_text(WALKING), encoding="utf-8")
    assert load_plan(plan).behaviour == WALKING
    assert load_plan(plan).described_by == str(tmp_path / "walk.behaviour")
    plan.write_text('name = "mine"\nbehaviour = "compass-walking-five-phases"\n', encoding="utf-8")
    assert load_plan(plan).behaviour == load_behaviour("compass-walking-five-phases")
    with pytest.raises(PlanError, match="the compass walker has no signal 'feet_down'"):
        load_plan(plan, behaviour="hop")


ENVIRONMENT = """
name = "mine"
env = "Pendulum-v1"
behaviour = "hop"
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


def test_a_plan_for_an_environment_has_defaults_for_the_rest():
    experiment = parse_plan(ENVIRONMENT, "mine.toml")
    assert isinstance(experiment.problem, EnvironmentProblem)
    assert experiment.seeds == range(7, 9)
    assert [setup.weight for setup in experiment.setups] == [0.0, 0.5, 1.0]
    assert experiment.setup("both").observe == "memory"
    assert experiment.setup("described").terms == {"reward_survive": 1}
    assert experiment.trainer.name == "sb3-ppo"
    assert experiment.evaluation_episodes == 5
    assert experiment.total_steps == 5120  # ten updates
    assert [lane.name for lane in experiment.lanes][:3] == ["alone-7", "both-7", "described-7"]


def test_the_resolved_plan_of_an_environment_reads_back_as_itself():
    experiment = parse_plan(ENVIRONMENT, "mine.toml")
    assert parse_plan(experiment.to_toml(), "plan.toml") == experiment


def test_options_of_an_environment_may_be_whatever_toml_has():
    options = """
env_options = { day = 2020-01-31, at = 07:32:00, lanes = [{ width = 3.5, marks = ["a"] }, {}], on = true }
"""
    experiment = parse_plan(options + ENVIRONMENT, "plan")
    assert experiment.problem.env_options["lanes"] == [{"width": 3.5, "marks": ["a"]}, {}]
    assert parse_plan(experiment.to_toml(), "again") == experiment


def test_options_replace_what_a_plan_for_an_environment_says():
    experiment = parse_plan(
        ENVIRONMENT, "mine.toml", seeds=1, weight=2.0, trainer="sb3-sac", settings={"batch_size": 32}
    )
    assert len(experiment.seeds) == 1
    assert {setup.weight for setup in experiment.setups} == {2.0}
    settings = {"n_steps": 512, "policy_kwargs": {"net_arch": [32, 32]}, "batch_size": 32}
    assert experiment.trainer == StableBaselines3("sb3-sac", settings)
    assert experiment.total_steps == 5000


def test_options_alone_are_a_plan():
    experiment = load_plan(None, env="Walker2d-v5", behaviour="walk", steps=100)
    assert experiment.name == "Walker2d-v5"
    assert isinstance(experiment.trainer, EnvironmentPPO)


def test_by_default_the_description_alone_pays_and_being_alive():
    """By the form `schedule`, seen, where the description has the limits that it needs; no step costs."""
    experiment = load_plan(None, env="Walker2d-v5", behaviour="walk")
    (setup,) = experiment.setups
    alone = DescribedSetup(name="described", terms={"alive": 1.0})
    form = {"form": "schedule", "skip_fine": 0.1, "fine_spread": True}
    assert setup == dataclasses.replace(alone, reward_variant=form, observe="memory")
    assert isinstance(experiment.problem, EnvironmentProblem)
    assert experiment.problem.least_pay(setup) == 0
    assert load_plan(None, env="Walker2d-v5", behaviour="perry-gait").setups == (alone,)
    assert load_plan(None, env="Walker2d-v5", behaviour="walk", weight=2.0).setups == (
        dataclasses.replace(setup, weight=2.0),
    )


def test_the_compass_walkers_environment_is_the_plant():
    experiment = load_plan(None, env="coachable/CompassWalker-v0", trainer="sb3-ppo", seeds=2)
    assert isinstance(experiment.problem, PlantProblem)
    assert experiment.name == "CompassWalker-v0"
    assert [lane.name for lane in experiment.lanes] == ["orthant-0", "orthant-1"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('env = "A-v0"', "which behaviour"),
        ('env = "A-v0"\nbehaviour = "hop"\nsteps = 0', "steps must be at least 1"),
        ('env = "A-v0"\nbehaviour = "hop"\nstep = 1', "unknown key 'step'; did you mean 'steps'"),
        ('env = "A-v0"\nbehaviour = "hop"\ntrainer = "ppo"\n[sb3]\nn_envs = 2', "the table sb3 is not for"),
        ('env = "A-v0"\nbehaviour = "hop"\n[ppo]\nn_envs = 0', "n_envs"),
        ('name = "a"\n[ppo]\nn_envs = 2', "n_envs"),
        ('env = "A-v0"\nbehaviour = "hop"\ntrainer = "sb3-poo"', "did you mean 'sb3-ppo'"),
        ('env = "A-v0"\nbehaviour = "hop"\ntrainer = "json:loads"', "is no Trainer"),
        ('env = "A-v0"\nbehaviour = "hop"\nclock = "free"', "clock is for plants"),
        ('name = "a"\nevaluation_episodes = 3', "evaluation_episodes is for Gymnasium environments"),
        ('env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nweigth = 1', r"setups\.a\.weigth"),
        (
            'env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nweight = "much"',
            r"setups\.a\.weight must be a number",
        ),
        (
            'env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nterms = { x = "y" }',
            r"setups\.a\.terms\.x must be a number",
        ),
        ('env = "A-v0"\nbehaviour = "hop"\n[setups.a]\nreward_variant = "sty"', "stay"),
        ('env = "A-v0"\nbehaviour = "hop"\n[setups."a/b"]', "it names files"),
        ('env = "A-v0"\nbehaviour = "hop"\n[sb3]\nn_steps = 0.5', "whole number, at least 1"),
        (
            'env = "A-v0"\nbehaviour = "hop"\ntrainer = "sb3-ppo"\n[ppo]\nn_steps = 64',
            "the table ppo is not for trainer = 'sb3-ppo'",
        ),
        (
            'env = "A-v0"\nbehaviour = "hop"\n[seeds]\nfirst = 500_000\ncount = 1',
            "seeds must be less than 500,000, got 500,000",
        ),
        ("env = ", "is not TOML"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_key(text, message):
    with pytest.raises(PlanError, match=message):
        parse_plan(text, "plan.toml")


def test_a_weight_that_is_no_number_is_refused():
    with pytest.raises(ParameterError, match="weight must be a finite number"):
        DescribedSetup(name="a", weight=float("nan"))


@pytest.mark.parametrize("name", shipped_settings())
def test_settings_that_ship_are_settings_of_their_trainer(name):
    sb3 = pytest.importorskip("coachable.learning.sb3")
    sb3.check_settings(f"sb3-{name.partition('-')[0]}", trainer_settings(name))


def test_settings_that_do_not_exist_are_refused_with_the_nearest():
    with pytest.raises(PlanError, match="ppo-walker2d"):
        trainer_settings("ppo-walker")


def test_without_stable_baselines3_the_error_names_the_extra(monkeypatch):
    monkeypatch.setattr("coachable.experiments.trainers.stable_baselines3.find_spec", lambda package: None)
    experiment = parse_plan(ENVIRONMENT, "mine.toml")
    with pytest.raises(PlanError, match=r"pip install 'coachable\[sb3\]'"):
        experiment.trainer.check(experiment)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"steps": 10**30}, "steps must be"),
        ({"steps": 1e30}, "steps must be a whole number"),
        ({"steps": 1.5}, "steps must be a whole number"),
        ({"seeds": 2_000_000_000}, "setups times seeds must be at most 100,000"),
        ({"seeds": 1.0}, "seeds.count must be a whole number"),
        ({"settings": {"n_steps": 10**12}}, "n_steps must be at most 10,000,000"),
        ({"settings": {"hidden_sizes": [10**9, 64]}}, "hidden_sizes must be at most 10,000"),
        ({"settings": {"learning_rate": 10**400}}, "learning_rate must be a number"),
        ({"setups": {"m" * 300: {}}}, "must have at most 100 letters"),
        ({"name": "n" * 101}, "must have at most 100 letters"),
        ({"setups": {"mine": {"orthant": 10**400}}}, "orthant must be a"),
    ],
)
def test_what_would_take_all_memory_or_time_is_refused_before_any_work(options, said):
    with pytest.raises(PlanError) as refused:
        load_plan("demo", **options)
    assert said in str(refused.value)


def test_a_plan_takes_the_whole_numbers_of_numpy():
    plan = load_plan("demo", steps=np.int64(4096), seeds=np.int32(2), settings={"n_steps": np.int64(1024)})
    assert plan == load_plan("demo", steps=4096, seeds=2, settings={"n_steps": 1024})
    assert type(plan.steps) is int
    assert parse_plan(plan.to_toml(), "again") == plan


def test_a_plan_from_elsewhere_names_what_it_would_import(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    text = 'name = "x"\ntrainer = "thirdparty.trainers:Mine"\n[plant]\nkind = "robots:Hopper"\n'
    for place in (tmp_path, tmp_path / "here"):
        (place / "plan.toml").write_text(text)
        (place / "plain.toml").write_text('name = "x"\nsteps = 3\n')
    (tmp_path / "here" / "link.toml").symlink_to(tmp_path / "plan.toml")
    assert require_trusted("plan.toml") == ("thirdparty.trainers", "robots")
    assert require_trusted(tmp_path / "plain.toml") == require_trusted("demo") == ()
    for path in ("../plan.toml", tmp_path / "plan.toml", "link.toml"):
        with pytest.raises(PlanError, match=r"names thirdparty\.trainers, robots.*--trust"):
            require_trusted(path)


def test_a_run_and_a_counterexample_from_elsewhere_name_what_they_would_import(tmp_path, monkeypatch):
    here, run = tmp_path / "here", tmp_path / "run"
    for folder in (here, run / "counterexamples"):
        folder.mkdir(parents=True)
    monkeypatch.chdir(here)
    (run / "plan.toml").write_text('env = "robots:Line-v0"\n')
    of_plant, of_environment = (run / "counterexamples" / f"{name}-1.json" for name in "ab")
    of_plant.write_text('{"plant_class": "my-plants:Hopper", "found_by": "a search: it fell"}')
    of_environment.write_text('{"environment": "robots:Line-v0"}')
    for path, name in ((run, "robots"), (of_plant, "my-plants"), (of_environment, "robots")):
        with pytest.raises(PlanError, match=f"names {name}.*--trust"):
            require_trusted(path)
        assert require_trusted(path, trusted=True) == (name,)
        assert require_trusted(path, known=[name]) == ()
    (run / "plan.toml").write_text("no plan")
    assert require_trusted(run) == require_trusted(tmp_path / "none.json") == ()


def test_only_a_trainer_is_made_from_the_settings_of_a_plan(tmp_path):
    settings = {"args": ["touch", str(tmp_path / "ran")]}
    with pytest.raises(PlanError, match="is no Trainer"):
        load_plan("demo", trainer="subprocess:Popen", settings=settings)
    assert not list(tmp_path.iterdir())


def test_modules_are_found_wherever_a_plan_names_them():
    data = {
        "env": "mymodule:Line-v0",
        "signals": {"x": "sensors:height", "y": {"info": "a.b"}},
        "setups": {"mine": {"reward_variant": {"form": "forms:Mine", "bonus": 1}}},
        "behaviour": "c:walk.behaviour",
    }
    assert modules_named(data) == ("mymodule", "sensors", "forms")
    assert modules_named({"env": "coachable.envs:coachable/CompassWalker-v0"}) == ()


ARMS = """
name = "arms"
behaviour = "compass-walking-timed"
deterministic = ["expected-action", "clipped-mean"]
[setups.orthant]
reward_variant = { form = "stay", dwells = false }
[setups.seeing]
orthant = 0.1
observe = "memory"
time_limit = "truncates"
reward_variant = { form = "schedule", skip_fine = 1.0 }
[setups.plain]
"""


def test_setups_of_a_plant_may_differ_in_more_than_weights():
    plan = parse_plan(ARMS, "arms.toml")
    assert parse_plan(plan.to_toml(), "plan.toml") == plan
    assert plan.deterministic == ("expected-action", "clipped-mean")
    _, seeing, plain = plan.reward_setups
    assert (seeing.observe, seeing.time_limit) == ("memory", "truncates")
    assert set(plan.to_data()["setups"]["plain"]) == set(TERM_NAMES)
    problem = plan.problem
    assert problem.form_of(seeing) == Schedule(1.0)
    assert problem.form_of(plain) == Stay()
    assert len({problem.program_of(setup) for setup in plan.reward_setups}) == 3
    again = problem.program_of(dataclasses.replace(plain, name="again", forward=0.5))
    assert again == problem.program_of(plain)


def test_batches_hold_lanes_of_one_program():
    plan = parse_plan(ARMS, "arms.toml", seeds=5)
    sizes = plan.trainer.batch_sizes(plan, 2)
    ends = [*accumulate(sizes)]
    assert ends[-1] == len(plan.lanes) == 15
    assert {5, 10} <= set(ends)
    assert load_plan("paper").trainer.batch_sizes(load_plan("paper"), 2) == batch_sizes(60, 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('deterministic = "expected-actoin"', "did you mean 'expected-action'"),
        ('deterministic = ["clipped-mean", "clipped-mean"]', "each rule once"),
        ("deterministic = []", "each rule once"),
        ('deterministic = "expected-action"\n[ppo]\nsquashing = "tanh"', "no closed form"),
        ('trainer = "sb3-ppo"\ndeterministic = ["clipped-mean", "expected-action"]', "evaluates by one rule"),
        ('trainer = "sb3-ppo"\n[setups.a]\nobserve = "value-only"', "needs trainer = 'ppo'"),
        ('[setups.a]\nobserve = "memry"', "observe must be one of 'nothing', 'memory', 'value-only'"),
        ('[setups.a]\ntime_limit = "truncate"', "time_limit must be one of"),
        ('[setups.a]\nreward_variant = { form = "schedul" }', "did you mean 'schedule'"),
        ('[setups.a]\nreward_variant = { form = "schedule", skip_fine = 2.0 }', "skip_fine"),
    ],
)
def test_what_setups_and_rules_cannot_be_is_refused_by_name(text, said):
    with pytest.raises(PlanError, match=said):
        parse_plan('name = "mine"\n' + text, "mine.toml")


def test_a_plants_schedule_charges_in_full_for_what_is_passed_over():
    for form, fine in (("schedule", 1.0), ({"form": "schedule", "skip_fine": 0.3}, 0.3)):
        plan = load_plan("demo", behaviour="compass-walking-timed", reward_variant=form)
        assert plan.problem.form == Schedule(fine)
        assert parse_plan(plan.to_toml(), "plan.toml") == plan
    setups = {"one": {"orthant": 0.1, "reward_variant": "schedule"}}
    plan = load_plan("demo", behaviour="compass-walking-timed", setups=setups)
    assert plan.problem.form_of(plan.reward_setups[0]) == Schedule(1.0)


WEIGHTS = [
    ({"weight": 1.0, "terms": {"alive": 1.0}}, 0.0),
    ({"weight": 2.0, "terms": {"alive": 1.0}}, -1.0),
    ({"weight": 0.5, "replace": True}, -0.5),
    ({"weight": 1.0, "terms": {"alive": 1.0, "reward_ctrl": 1.0}}, None),
    ({"weight": 1.0}, None),
]


@pytest.mark.parametrize(("paid", "least"), WEIGHTS)
def test_a_setup_that_punishes_being_alive_is_named_before_it_is_trained(capsys, paid, least):
    problem = EnvironmentProblem(env="Pendulum-v1", behaviour=parse(SWING), signals={"height": 0, "speed": 2})
    setup = DescribedSetup(name="described", **paid)
    assert problem.least_pay(setup) == least
    trainer = EnvironmentPPO(EnvironmentPPOConfig())
    warn_of_paid_endings(
        Experiment(name="swing", problem=problem, setups=(setup,), trainer=trainer, described_by="swing")
    )
    said = capsys.readouterr().err
    assert bool(said) == (least is not None and least < 0)
    if said:
        enough = float(re.search(r"alive = (\S+) }", said)[1])
        mended = dataclasses.replace(setup, replace=False, terms={"alive": enough})
        assert problem.least_pay(mended) == 0
