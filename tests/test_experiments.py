"""The experiments' plans can be trained as they stand, and docs/debugging.md shows what their files say."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from coachable import cli
from coachable.behaviours.library import SHIPPED
from coachable.behaviours.text.document import formatted_file
from coachable.experiments.plan import load_plan, trainer_settings
from coachable.experiments.trainers.environment_ppo import EnvironmentPPO

ROOT = Path(__file__).parents[1]
EXPERIMENTS = ROOT / "experiments"
BEYOND = EXPERIMENTS / "beyond-paper"
PLANS = sorted(path for path in EXPERIMENTS.rglob("*.toml") if path.parent != BEYOND)
ZOO = [path for path in PLANS if path.is_relative_to(EXPERIMENTS / "zoo")]
OWN = [path for path in PLANS if path not in ZOO]
GUIDE = (ROOT / "docs" / "debugging.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+) ?(\S*)\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("path", ZOO, ids=lambda path: path.stem)
def test_a_plan_of_the_zoo_has_a_behaviour_that_ships_or_lies_there_and_the_defaults_of_our_ppo(path):
    plan = load_plan(path)
    beside_it = [each.resolve() for each in (EXPERIMENTS / "zoo").glob("*.behaviour")]
    assert plan.described_by in SHIPPED or Path(plan.described_by).resolve() in beside_it
    assert plan.trainer == EnvironmentPPO()
    if path.parent.name == "zoo":
        assert plan.setups == load_plan(None, env=plan.problem.robot, behaviour=plan.described_by).setups


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.stem)
def test_a_plan_is_one_with_the_shipped_settings_and_a_behaviour_beside_it(path):
    plan = load_plan(path)
    assert plan.trainer.settings == trainer_settings("ppo-mujoco")
    assert Path(plan.described_by).parent == path.parent


@pytest.mark.parametrize("path", sorted(EXPERIMENTS.rglob("*.behaviour")), ids=lambda path: path.stem)
def test_a_description_is_formatted(path):
    text, formatted = formatted_file(path)
    assert text == formatted


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_a_plan_can_be_trained(path):
    """Its environment is made, with every setup, and takes a step."""
    for module in ("mujoco", "stable_baselines3"):
        pytest.importorskip(module)
    plan = load_plan(path)
    plan.trainer.check(plan)


def test_no_seed_is_both_picked_on_and_reported():
    named = ("first-try", "second-try", "weights", "cycles")
    on_them = [path for path in PLANS if path.stem in named or path.parent.name == "tuning"]
    picked, reported = (
        set.union(*(set(load_plan(path).seeds) for path in paths))
        for paths in (on_them, [path for path in PLANS if path not in on_them])
    )
    assert picked.isdisjoint(reported)


@pytest.mark.parametrize(
    ("name", "text"), [(name, text) for kind, name, text in BLOCKS if kind == "behaviour"]
)
def test_the_guide_shows_the_files_as_they_are(name, text):
    assert (EXPERIMENTS / "walker2d" / name).read_text(encoding="utf-8") == text


def test_the_recorded_walk_is_explained_as_the_guide_tells(capsys):
    walker = EXPERIMENTS / "walker2d"
    with pytest.raises(SystemExit, match="1"):
        cli.main(["explain", str(walker / "first-try.behaviour"), str(walker / "first-try.csv.gz")])
    told = capsys.readouterr().out
    shown = next(text for kind, _, text in BLOCKS if kind == "text")
    assert shown in told


def test_the_guides_commands_are_commands_and_their_files_are_there():
    commands = [shlex.split(line) for kind, _, text in BLOCKS if kind == "sh" for line in text.splitlines()]
    assert len(commands) >= 6
    for program, name, *arguments in commands:
        assert program == "coachable"
        assert name in cli.COMMANDS
        for argument in arguments:
            assert not argument.startswith("experiments/") or (ROOT / argument).exists()


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(((?!https:)[^)#]+)(?:#[^)]*)?\)", GUIDE))))
def test_what_the_guide_links_to_is_there(target):
    assert (ROOT / "docs" / target).exists()


def test_what_was_tuned_on_is_not_reported():
    """Of the study beyond the paper: tuned on seeds from 10,000 on, reported on others, each on its own."""
    tuned = {seed for name in ("clock", "clock-2") for seed in load_plan(BEYOND / f"{name}.toml").seeds}
    reported = [
        set(load_plan(name).seeds) for name in ("beyond-paper", BEYOND / "sensitivity.toml", "paper-100")
    ]
    assert min(tuned) >= 10_000
    assert tuned.isdisjoint(set.union(*reported))
    assert len(set.union(*reported)) == sum(map(len, reported))


def test_the_tuned_clock_is_one_of_those_that_were_tried():
    tuned, gait = (load_plan("beyond-paper").setup(name) for name in ("clock-tuned", "clock-gait"))
    tried = load_plan(BEYOND / "clock-2.toml")
    for chosen, name in ((tuned, "distcut-long-10"), (gait, "distcut-gait-10")):
        assert replace(chosen, name=name) == tried.setup(name)


def test_the_sensitivity_varies_one_number_at_a_time():
    plan, whole = load_plan(BEYOND / "sensitivity.toml"), load_plan("beyond-paper")
    assert replace(plan.setup("as-published"), name="description-alone") == whole.setup("description-alone")
    limits = [phase.dwell.at_most for phase in plan.behaviour.phases]
    for factor in (80, 125, 160):
        durations = plan.problem.form_of(plan.setup(f"limits-{factor}")).durations
        assert [*durations.values()] == pytest.approx([factor / 100 * limit for limit in limits])
    for gamma in ("098", "0995"):
        settings = trainer_settings(str(BEYOND / f"gamma-{gamma}.toml"))
        changed = load_plan(BEYOND / "sensitivity.toml", settings=settings, setups=["as-published"])
        assert changed.trainer.config.gamma == float(f"0.{gamma[1:]}")
