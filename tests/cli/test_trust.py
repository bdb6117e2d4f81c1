"""What comes from elsewhere imports no module without being trusted, whichever command reads it."""

import sys

import pytest

from coachable.cli import main

OF_A_RUN = [
    ["table"],
    ["compare", "here"],
    ["report"],
    ["watch", "-o", "x.gif"],
    ["record", "-o", "x.csv"],
    ["gait"],
    ["verify"],
    ["explain"],
    ["export", "-o", "x.onnx"],
]


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder outside of the current one, whose files name a module that notes when it is imported."""
    here, elsewhere = tmp_path / "here", tmp_path / "elsewhere"
    for folder in (here, elsewhere):
        folder.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(sys, "path", [*sys.path, str(elsewhere)])
    (elsewhere / "foreign.py").write_text("open('imported', 'w').close()")
    (elsewhere / "manifest.json").write_text("{}")
    (elsewhere / "plan.toml").write_text('name = "x"\n[plant]\nkind = "foreign:Hopper"\n')
    (elsewhere / "fall.json").write_text('{"format_version": 1, "plant_class": "foreign:Hopper"}')
    return elsewhere


@pytest.mark.parametrize("command", OF_A_RUN, ids=lambda words: words[0])
def test_a_run_from_elsewhere_is_not_read(elsewhere, capsys, command):
    name, *options = command
    with pytest.raises(SystemExit, match="2"):
        main([name, str(elsewhere), *options])
    said = capsys.readouterr().err
    assert "names foreign" in said
    assert "--trust" in said
    assert not list(elsewhere.parent.rglob("imported"))


@pytest.mark.parametrize("words", [["train", "plan.toml"], ["watch", "fall.json", "-o", "x.gif"]])
def test_what_is_trusted_is_imported_and_named_first(elsewhere, capsys, monkeypatch, words):
    name, file, *options = words
    command = [name, str(elsewhere / file), *options]
    with pytest.raises(SystemExit, match="2"):
        main(command)
    assert "names foreign" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--trust"])  # it is imported, and has no such plant
    said = capsys.readouterr().err
    assert said.startswith("coachable: importing foreign, as ")
    sys.modules.pop("foreign", None)
