"""What docs/extending.md shows works: a plant, a reward form, signals and a trainer of one's own."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import coachable as co
from coachable import cli
from coachable.behaviours.text.document import formatted_file
from coachable.experiments.trainers import environment_trainer

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+) ?(\S*)\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)
COMMANDS = [line for kind, _, text in BLOCKS if kind == "sh" for line in text.splitlines()]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for _, name, text in BLOCKS:
        if name:
            (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", [name for kind, name, _ in BLOCKS if kind == "behaviour"])
def test_every_description_is_one_and_formatted(folder, name):
    text, formatted = formatted_file(folder / name)
    assert text == formatted


def test_the_python_prints_what_its_comments_say(folder):
    (code,) = [text for kind, name, text in BLOCKS if kind == "python" and not name]
    shown = " ".join(re.findall(r"# ?(.*)", code))
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    assert (done.stdout + done.stderr).split() == shown.split()


@pytest.mark.parametrize("run", ["roll", "swing"])
def test_its_commands_train(folder, monkeypatch, capsys, run):
    """In one process, and with few steps: what is trained here need not be good."""
    monkeypatch.setattr(environment_trainer, "run_lanes", one_after_another)
    train, table = (command for command in COMMANDS if f"runs/{run}" in command)
    few = {"roll": ["--steps", "4096"], "swing": ["--steps", "800"]}[run]
    for command, more in ((train, few), (table, [])):
        program, *arguments = shlex.split(command)
        assert program == "coachable"
        cli.main([*arguments, *more])
    opened = co.open_run(folder / "runs" / run)
    assert len(opened.lanes) == 2
    assert len(opened.columns("evaluations")["return"]) >= 2
    policy = opened.policy(opened.lanes[0].setup, 0)
    assert policy.weights[0].shape[1] == {"roll": 2, "swing": 3}[run]


def test_a_form_of_ones_own_is_taken_by_a_plan(folder, monkeypatch, capsys):
    plan = folder / "roll.toml"
    form = 'reward_variant = { form = "explore:Explore", amount = 2.0 }'
    given = plan.read_text(encoding="utf-8").replace("[plant]", f"{form}\n\n[plant]", 1)
    plan.write_text(given, encoding="utf-8")
    cli.main(["train", "roll.toml", "--steps", "4096", "--seeds", "1", "--out", "runs/explore"])
    evaluations = co.open_run(folder / "runs" / "explore").columns("evaluations")
    assert set(evaluations["orthant"]) <= {0.0, 2.0, 4.0}


def one_after_another(works, num_workers, receive, watch):
    for index, work in enumerate(works):
        work.run(lambda progress, index=index: receive(index, progress))


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(((?!https:)[^)#]+)\)", GUIDE))))
def test_what_it_links_to_is_there(target):
    assert (ROOT / "docs" / target).exists()
