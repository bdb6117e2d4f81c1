"""The experiments' plans can be trained as they stand, and docs/debugging.md shows what their files say."""

import re
import shlex
from pathlib import Path

import pytest

from coachable import cli
from coachable.behaviours.text.document import formatted_file
from coachable.experiments.plan import load_plan, trainer_settings

ROOT = Path(__file__).parents[1]
EXPERIMENTS = ROOT / "experiments"
PLANS = sorted(EXPERIMENTS.rglob("*.toml"))
GUIDE = (ROOT / "docs" / "debugging.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+) ?(\S*)\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
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
    seeds = {path.stem: set(load_plan(path).seeds) for path in PLANS}
    picked = set.union(*(seeds.pop(name) for name in ("first-try", "second-try", "weights", "cycles")))
    assert picked.isdisjoint(set.union(*seeds.values()))


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
