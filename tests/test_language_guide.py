"""What docs/language.md shows works: descriptions are read, commands and Python say what it says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from coachable.behaviours.text.document import formatted_file
from coachable.behaviours.text.parser import parse
from coachable.foundation.errors import BehaviourError

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "language.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)(!?) ?(\S*)\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("guide")
    for kind, _, name, text in BLOCKS:
        if kind == "behaviour":
            (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize(("wrong", "name"), [block[1:3] for block in BLOCKS if block[0] == "behaviour"])
def test_every_description_is_one_and_formatted_unless_it_shows_a_mistake(folder, wrong, name):
    if wrong:
        with pytest.raises(BehaviourError):
            formatted_file(folder / name)
    else:
        text, formatted = formatted_file(folder / name)
        assert text == formatted


def run(folder, *arguments):
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        encoding="utf-8",
    )
    return done.stdout + done.stderr


@pytest.mark.parametrize("session", [block[3] for block in BLOCKS if block[0] == "console"])
def test_every_command_says_what_is_shown(folder, session):
    for command, shown in re.findall(r"^\$ coachable (.*)\n((?:(?!\$ ).*\n)*)", session, re.MULTILINE):
        said = run(folder, "-m", "coachable.cli", *command.split())
        assert [line.rstrip() for line in said.splitlines()] == shown.splitlines()


def test_its_picture_is_the_one_that_the_command_draws(folder):
    run(folder, "-m", "coachable.cli", "draw", "squats.behaviour", "-o", "squats.svg")
    assert (folder / "squats.svg").read_text("utf-8") == (ROOT / "docs/squats.svg").read_text("utf-8")


@pytest.mark.parametrize("code", [block[3] for block in BLOCKS if block[0] == "python"])
def test_the_python_prints_what_its_comment_says(folder, code):
    shown = " ".join(re.findall(r"# ?(.*)", code))
    assert run(folder, "-c", code).split() == shown.split()


TABLES = GUIDE.partition("**What holds**")[2]


@pytest.mark.parametrize("predicate", re.findall(r"^\| `([^`]+)` \| ", TABLES, re.MULTILINE))
def test_every_predicate_in_the_tables_is_read(predicate):
    names = "signals\n  x\n  y\n  z\nvocabulary\n  knee bends means x > 0\n"
    parse(f'behaviour ""\n{names}phases\n  p: {predicate}')


def test_every_line_in_the_table_of_sections_is_read():
    rows = re.findall(r"^\| `([^`]+)` \| (?:`([^`]+)`|any text)? ?\| ", GUIDE, re.MULTILINE)
    shown = [(header, line) for header, line in rows if line or re.match("behaviour|outside", header)]
    text = "".join(f"{header}\n" + (f"  {line}\n" if line else "") for header, line in shown)
    more = "signals\n  height\n  load\nphases\n  air: load < 0\n  fall: load < -1\n"
    assert parse(text + more).name == "NAME"


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#]+)\)", GUIDE))))
def test_what_it_links_to_is_there(target):
    assert (ROOT / "docs" / target).exists()
