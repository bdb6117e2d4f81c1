"""`coachable check FILE`: what it prints, and how it exits."""

import json

import pytest

from coachable.cli import main

CLEAN = """behaviour "clean"
  Speeding up and slowing down.

signals
  pull  [N]

phases
  up "speeding up":      pull > 0 [N]
  down "slowing down":   pull <= 0 [N]

cycle
  up -> down -> up
"""
GAP = CLEAN.replace("pull <= 0", "pull < 0")
OVERLAP = CLEAN.replace("pull <= 0", "pull < 1")
BROKEN = CLEAN.replace("pull <= 0", "pul <= 0")


def run(tmp_path, capsys, text, *options):
    """The exit code, and what was printed."""
    path = tmp_path / "walk.behaviour"
    path.write_text(text, encoding="utf-8")
    try:
        main(["check", str(path), *options])
        code = 0
    except SystemExit as stop:
        code = stop.code
    return code, capsys.readouterr()


@pytest.mark.parametrize(
    ("text", "options", "code"),
    [
        (CLEAN, (), 0),
        (CLEAN, ("--strict",), 0),
        (GAP, (), 0),
        (GAP, ("--strict",), 1),
        (OVERLAP, (), 1),
        (OVERLAP, ("--json",), 1),
        (BROKEN, (), 2),
        (BROKEN, ("--json",), 2),
    ],
)
def test_the_exit_code_tells_whether_it_passed(tmp_path, capsys, text, options, code):
    assert run(tmp_path, capsys, text, *options)[0] == code


def test_a_clean_file_is_answered_with_what_was_proven(tmp_path, capsys):
    _, printed = run(tmp_path, capsys, CLEAN)
    assert "2 phases, pairwise disjoint, no state outside, cycle closed" in printed.out
    assert printed.out.endswith("0 errors, 0 warnings, 0 notes.\n")


def test_a_finding_names_the_line(tmp_path, capsys):
    _, printed = run(tmp_path, capsys, OVERLAP)
    assert "walk.behaviour:9 (phase down)" in printed.out
    _, printed = run(tmp_path, capsys, OVERLAP, "--json")
    overlap = json.loads(printed.out)["findings"][0]
    assert (overlap["kind"], overlap["subjects"][0]["line"]) == ("overlap", 9)


def test_a_file_that_cannot_be_read_is_a_message_and_not_a_report(tmp_path, capsys):
    code, printed = run(tmp_path, capsys, BROKEN, "--json")
    assert (code, printed.out) == (2, "")
    assert "pul" in printed.err
    with pytest.raises(SystemExit) as stop:
        main(["check", str(tmp_path / "missing.behaviour")])
    assert stop.value.code == 2


def test_the_help_has_examples(capsys):
    with pytest.raises(SystemExit):
        main(["check", "--help"])
    assert "coachable check walking.behaviour --strict" in capsys.readouterr().out
