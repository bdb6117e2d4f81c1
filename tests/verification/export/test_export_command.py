from pathlib import Path

import pytest

from coachable.cli import main
from tests.verification.export.archive import Archive
from tests.verification.export.composition import Composition

GOLDEN = Path(__file__).parent / "golden"


@pytest.mark.parametrize(
    ("arguments", "name"),
    [(["compass-walking"], "bare"), (["--baseline", "virtual-gravity"], "gravity")],
)
@pytest.mark.parametrize("suffix", [".kyx", ".xml"])
def test_a_behaviour_is_exported_bare_or_with_a_baseline(capsys, tmp_path, arguments, name, suffix):
    out = tmp_path / f"model{suffix}"
    main(["export", *arguments, "-o", str(out)])
    assert out.read_bytes() == (GOLDEN / f"{name}{suffix}").read_bytes()
    assert str(out) in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "model.doc"], ["model.doc", ".kyx, .xml, .py"]),
        (["compass-wakling", "-o", "model.kyx"], ["compass-walking"]),
        (["compass-walking", "--seed", "3", "-o", "model.kyx"], ["--seed", "compass-walking"]),
        (["hop", "-o", "model.kyx"], ["no signal"]),
        (["--clock", "touchdown", "-o", "model.kyx"], ["--clock", "--baseline"]),
        (["run", "--clock", "free", "-o", "model.onnx"], ["a policy alone", "--clock"]),
        (["run", "--baseline", "none", "-o", "model.onnx"], ["a policy alone", "--baseline"]),
        (["-o", "nowhere/model.kyx"], ["nowhere/model.kyx: No such file"]),
    ],
)
def test_a_mistake_is_one_clear_message(capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as exit:
        main(["export", *arguments])
    assert exit.value.code == 2
    assert not list(tmp_path.iterdir())
    message = capsys.readouterr().err
    assert all(words in message for words in said)


def test_readers_read_what_is_golden():
    for path in GOLDEN.glob("*.kyx"):
        Archive(path.read_text(encoding="utf-8"))
    for path in GOLDEN.glob("*.xml"):
        Composition(path.read_text(encoding="utf-8"))
