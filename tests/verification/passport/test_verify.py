"""`coachable verify`: a walker gets its passport, one that falls is told so, and mistakes are sentences."""

import json

import pytest

from coachable import cli
from coachable.experiments.run_folder.reader import open_run
from coachable.verification.passport import verify as verify_module
from coachable.verification.passport.closed_loop import lane_subject
from coachable.verification.passport.passport import read_passport


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """A few starts, and no change to JAX's configuration for the tests that follow."""
    from coachable.experiments import runner

    monkeypatch.setattr(verify_module, "NUM_STARTS", {"quick": 20, "full": 20})
    monkeypatch.setattr(runner, "set_up_jax", lambda: None)


def run(capsys, *arguments):
    try:
        cli.main(["verify", *map(str, arguments)])
        status = 0
    except SystemExit as stopped:
        status = stopped.code
    out, err = capsys.readouterr()
    return out, err, status


def test_a_walker_gets_its_passport_and_the_run_stays_readable(capsys, run_folder):
    out, err, status = run(capsys, run_folder, "--seed", 0)
    assert (status, err.splitlines()[-1]) == (0, f"wrote {run_folder / 'passports'}")
    for words in ("orthant-0: walks", "stable", "O1 → O2", "multipliers", "20 starts", "residual"):
        assert words in out
    path = run_folder / "passports" / "orthant-0.json"
    passport = read_passport(path)
    assert passport.walks
    assert passport.gait.clock == "free"
    assert passport.stability.num_clipped[1] > 0
    assert {basin.starts: basin.reached.total for basin in passport.basins} == {"start": 20, "section": 20}
    assert path.with_name("orthant-0-automaton.svg").exists()
    assert open_run(run_folder).policy("orthant", 0).clock == "free"


def test_a_walker_that_falls_has_a_passport_that_says_so(capsys, run_folder, tmp_path):
    out, _, status = run(capsys, run_folder, "--seed", 1, "--out", tmp_path, "--json")
    data = json.loads(out)
    assert status == 0
    assert data["adherence"]["up"] is False
    assert data["orbits"]["free"]["kind"] == data["orbits"]["touchdown"]["kind"] == "none"
    assert data["stability"] is data["pushes"] is None
    assert data["basins"] == []
    assert read_passport(tmp_path / "orthant-1.json").verdict.startswith("does not walk: it fell after ")


def test_a_passport_is_kept_for_the_same_policy_and_a_proof_that_holds(
    capsys, run_folder, tmp_path, monkeypatch
):
    run(capsys, run_folder, "--seed", 1, "--out", tmp_path)
    subject = lane_subject(open_run(run_folder), "orthant", 1)
    assert verify_module.kept_passport(tmp_path, subject, "quick") is not None
    assert verify_module.kept_passport(tmp_path, subject, "full") is None
    path = tmp_path / "orthant-1.json"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(subject.walker.policy_sha256, "0" * 64), encoding="utf-8")
    assert verify_module.kept_passport(tmp_path, subject, "quick") is None
    forged = {"proven": True, "radius": 0.5, "reach": 0.1, "strides": 1, "reason": "proven", "file": None}
    path.write_text(json.dumps(json.loads(text) | {"certificate": forged}), encoding="utf-8")
    assert verify_module.kept_passport(tmp_path, subject, "quick", certify=True) is None
    monkeypatch.setattr(verify_module, "find_spec", lambda name: None)
    kept = verify_module.kept_passport(tmp_path, subject, "quick", certify=True)
    assert (kept.certificate.proven, "not re-checked" in kept.certificate.reason) == (False, True)
    path.write_text(text[:100], encoding="utf-8")
    assert verify_module.kept_passport(tmp_path, subject, "quick") is None


def test_all_walkers_are_told_in_one_table_and_not_verified_twice(capsys, two_walkers, monkeypatch):
    monkeypatch.setattr(verify_module, "GROUP", 1)
    out, err, status = run(capsys, two_walkers, "--all")
    assert status == 0
    assert "already" not in err
    (row,) = (line.split() for line in out.splitlines() if line.strip().startswith("orthant"))
    assert row[1:7] == ["2", "1", "1", "0", "0", "1"]  # walkers, up, every step, every 2 or 4, wander, stable
    path = two_walkers / "passports" / "orthant-0.json"
    before = path.stat().st_mtime_ns
    again, err, _ = run(capsys, two_walkers, "--all")
    assert "2 of 2 passports are there already" in err
    assert again == out
    assert path.stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--seed", 2], "orthant-2-last.json is not there yet: the run is running"),
        (["--seed", 3], "orthant-3-last.safetensors is damaged"),
        (["--seed", 9], "has no seed 9"),
        (["--setup", "orthnat"], "no setup 'orthnat'; did you mean 'orthant'?"),
        (["--all"], "is not there yet"),
        (["--all", "--seed", 1], "--all means every seed"),
        (["--level", "deep"], "--level"),
    ],
)
def test_a_mistake_is_a_sentence(capsys, run_folder, arguments, said):
    out, err, status = run(capsys, run_folder, *arguments)
    assert (out, status) == ("", 2)
    assert said in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["nowhere"], "nowhere is not a folder"), (["none", "--all"], "none is a baseline")],
)
def test_a_run_that_is_none_is_told(capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    _, err, status = run(capsys, *arguments)
    assert status == 2
    assert said in err
