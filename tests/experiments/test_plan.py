"""A plan survives being written, says what is wrong with it, and knows what its semantics imply."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.behaviours import load_behaviour
from coachable.behaviours.text.printer import to_text
from coachable.experiments.plan import Study, behaviour_of, differences, load_plan, parse_plan, shipped_plans
from coachable.foundation.errors import BehaviourError, PlanError
from coachable.learning.config import PPOConfig
from coachable.plants.compass import CompassParameters
from coachable.rewards.setup import PAPER_SETUPS, RewardSetup

names = st.from_regex(r"[A-Za-z0-9_+-]{1,12}", fullmatch=True)
finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
positive = st.floats(min_value=1e-3, max_value=1e3)
setups = st.builds(RewardSetup, names, *[finite] * 5)
study_fields = st.fixed_dictionaries(
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
        "plant": st.builds(CompassParameters, positive, positive, positive, positive, positive),
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


@given(study_fields)
def test_a_written_plan_is_the_same_plan(fields):
    study = Study(**fields)
    text = study.to_toml()
    again = parse_plan(text, "plan.toml")
    assert again == study
    assert again.to_toml() == text


@given(study_fields, study_fields, st.sets(st.sampled_from(["name", "steps", "setups", "plant", "clock"])))
def test_plans_differ_exactly_where_their_differences_say(fields, others, changed):
    one, other = Study(**fields), Study(**fields | {key: others[key] for key in changed})
    assert bool(differences(one, other)) == (one != other)
    assert {line.split(":")[0].split(".")[0] for line in differences(one, other)} <= changed


def test_differences_name_the_key_and_both_values():
    one, other = load_plan("paper"), load_plan("paper", steps=1000, setups=["sparse"])
    found = differences(one, other)
    assert "steps: 500000 → 1000" in found
    assert "setups.orthant.orthant: 0.01 → 'absent'" in found


def test_the_plans_that_ship_are_the_papers():
    assert shipped_plans() == ["certifiable", "demo", "paper", "paper-100"]
    paper, hundred = load_plan("paper"), load_plan("paper-100")
    assert paper == Study(name="paper")
    assert paper.setups == tuple(PAPER_SETUPS.values())
    assert (len(paper.lanes), paper.num_updates) == (60, 245)
    assert len(hundred.lanes) == 400
    assert not set(hundred.seeds) & set(paper.seeds)
    assert [lane.name for lane in load_plan("demo").lanes] == [f"orthant-{seed}" for seed in range(4)]


def test_the_released_code_brings_its_own_reward_and_behaviour():
    study = load_plan("paper", semantics="released-code")
    assert (study.reward_variant, study.behaviour) == ("released", "compass-walking-released")
    assert study.distance == "foot_x"
    said = load_plan("paper", semantics="released-code", reward_variant="stay")
    assert (said.reward_variant, said.behaviour) == ("stay", "compass-walking-released")


def test_options_win_over_the_file_and_the_file_over_the_defaults():
    text = 'name = "mine"\nsteps = 7\nclock = "touchdown"\n[ppo]\nn_steps = 128\n[seeds]\nfirst = 3\n'
    study = parse_plan(text, "mine.toml", steps=9, seeds=2)
    assert (study.steps, study.clock, study.semantics) == (9, "touchdown", "paper")
    assert study.ppo == PPOConfig(n_steps=128)
    assert list(study.seeds) == [3, 4]


def test_a_setup_of_ones_own_needs_only_its_weights():
    text = 'name = "mine"\n[setups.eager]\nforward = 1\n[setups.orthant]\northant = 0.02\n'
    study = parse_plan(text, "mine.toml")
    assert study.setups == (RewardSetup("eager", forward=1.0), RewardSetup("orthant", orthant=0.02))
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
        ("semantics = 3", ["semantics must be one of", "'paper'"]),
        ("plant = 3", ["plant must be a table", "hip_mass"]),
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
    assert load_plan(plan).behaviour == str(tmp_path / "walk.behaviour")
    assert load_plan(plan, behaviour="other.behaviour").behaviour == "other.behaviour"
    with pytest.raises(BehaviourError, match="neither a behaviour that ships nor a file"):
        behaviour_of(load_plan(plan))
    (tmp_path / "walk.behaviour").write_text(to_text(load_behaviour("compass-walking")), encoding="utf-8")
    assert behaviour_of(load_plan(plan)) == load_behaviour("compass-walking")
    plan.write_text('name = "mine"\nbehaviour = "compass-walking-five-phases"\n', encoding="utf-8")
    assert behaviour_of(load_plan(plan)) == load_behaviour("compass-walking-five-phases")
    with pytest.raises(PlanError, match="the compass walker has no signal 'height'"):
        behaviour_of(load_plan(plan, behaviour="hop"))
