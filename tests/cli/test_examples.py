"""Every command line that is shown as an example can be run: in help, README, guides and Makefile."""

import functools
import inspect
import re
import shlex
from pathlib import Path

import pytest

from coachable import cli

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "Makefile",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "experiments").rglob("*.md")),
]
ELLIPSIS = ("…", "...")


def commands_in(text):
    """Command lines that begin a line, stand in backquotes, or follow a pipe or a `do`, without comments."""
    text = text.replace("\\\n", " ")
    lines = re.findall(r"^[\s#@$>-]*(?:\S*/|\$\(BIN\)/)?coachable (.*)$", text, re.MULTILINE)
    lines += re.findall(r"(?:;|&&|\bdo|\|)\s*(?:\S*/)?coachable (.*)$", text, re.MULTILINE)
    lines += [" ".join(line.split()) for line in re.findall(r"`coachable ([^`]*)`", text)]
    for line in lines:
        line = re.split(r"\s{2,}[a-z]|;|\|\||\||&&|>", line.split("`")[0])[0]
        line = re.sub(r"\$\([^()]*(\([^()]*\))?[^()]*\)", "", line)  # what make expands
        words = shlex.split(line, comments=True)
        # A command's name alone is a mention of it.
        if len(words) > 1 and words[0] in cli.COMMANDS and not set(words) & {*ELLIPSIS, "COMMAND"}:
            yield tuple(words)


def examples(command):
    """The examples in a command's help text: its lines that begin with the program's name."""
    return [
        shlex.split(line.split(">>")[0])[1:]
        for line in (inspect.getdoc(command) or "").splitlines()
        if line.strip().startswith("coachable ")
    ]


SHOWN_IN_HELP = [
    pytest.param(words, id=" ".join(words))
    for command in cli.COMMANDS.values()
    for words in examples(command)
]
SHOWN_IN_PAGES = sorted({words for page in PAGES for words in commands_in(page.read_text(encoding="utf-8"))})


@pytest.fixture
def parsed(monkeypatch):
    """What reaches the commands, which do nothing else."""
    calls = []

    def only_parsed(command):
        @functools.wraps(command)
        def record(*positional, **options):
            calls.append(inspect.signature(command).bind(*positional, **options).arguments)

        return record

    for name, command in cli.COMMANDS.items():
        monkeypatch.setitem(cli.COMMANDS, name, only_parsed(command))
    return calls


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_shows_an_example_of_its_own(name):
    shown = examples(cli.COMMANDS[name])
    assert shown
    assert {words[0] for words in shown} <= {name, "explain"}


@pytest.mark.parametrize("words", SHOWN_IN_HELP)
def test_an_example_in_a_help_text_is_understood(parsed, words):
    cli.main(words)
    assert len(parsed) == 1


def test_the_examples_in_the_overview_are_understood(parsed, capsys):
    cli.main(["--help"])
    shown = list(commands_in(capsys.readouterr().out))
    assert len(shown) >= 5
    for words in shown:
        cli.main(words)
    assert len(parsed) == len(shown)


@pytest.mark.parametrize("words", SHOWN_IN_PAGES, ids=" ".join)
def test_a_command_in_a_page_is_understood(parsed, words):
    cli.main(["0" if word == "N" else word for word in words])
    assert len(parsed) == 1


def test_a_wrong_example_would_be_noticed(parsed):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["table", "runs/paper", "--format", "md"])
    assert not parsed


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_an_output_is_the_same_option_in_every_command(name, capsys):
    """Whatever is written has both forms; whatever may be printed as JSON has the same flag."""
    with pytest.raises(SystemExit, match="0"):
        cli.main([name, "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    parameters = inspect.signature(cli.COMMANDS[name]).parameters
    assert ("-o" in shown and "--out" in shown) == ("out" in parameters)
    assert ("--json" in shown) == ("json" in parameters)
    assert "--format" not in shown
    if "run" in parameters:
        assert next(iter(parameters)) == "run", "a run is the first argument"


def test_commands_that_print_numbers_print_json_too():
    printing = {
        "table",
        "compare",
        "gait",
        "baseline",
        "verify",
        "check",
        "diff",
        "explain",
        "limits",
        "audit",
        "symmetry",
    }
    assert printing == {
        name for name, command in cli.COMMANDS.items() if "json" in inspect.signature(command).parameters
    }
