"""The command line: quick help with examples, a clear message for a mistake, what the commands print."""

import csv
import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from coachable import cli
from coachable.behaviours import load_behaviour
from coachable.cli.descriptions import warn_of_errors

ROLLING = Path(__file__).parents[1] / "plants" / "rolling.behaviour"


def run(capsys, *arguments):
    """What a command prints, on stdout and stderr, and its exit status."""
    try:
        cli.main([str(argument) for argument in arguments])
        status = 0
    except SystemExit as stopped:
        status = stopped.code
    out, err = capsys.readouterr()
    return out, err, status


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_letters_that_a_terminal_cannot_show_are_replaced(encoding, tmp_path):
    trace = tmp_path / "walk.csv"
    trace.write_text("t,theta_1,theta_2,dtheta_1,dtheta_2\n0,0.1,-0.1,-1,1\n0.1,-0.1,0.1,-1,1\n")
    command = [sys.executable, "-m", "coachable.cli", "explain", "compass-walking", trace]
    done = subprocess.run(
        command, capture_output=True, env={**os.environ, "PYTHONIOENCODING": encoding}, check=False
    )
    assert (done.returncode, done.stderr) == (1, b"")
    assert b"O1 ? O3 is not an edge" in done.stdout


@pytest.fixture
def copied_run(small_run, tmp_path):
    return shutil.copytree(small_run.path, tmp_path / "run")


def test_help_is_quick():
    program = (
        "import sys, time\nbegan = time.process_time()\nfrom coachable import cli\n"
        "cli.main(['--help'])\n"
        "try:\n    cli.main(['train', '--help'])\nexcept SystemExit:\n    pass\n"
        "took = time.process_time() - began\n"
        "assert not {'jax', 'numpy', 'matplotlib'} & set(sys.modules)\nassert took < 0.5, took\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_no_command_and_help_list_all_commands(capsys):
    for arguments in ([], ["--help"]):
        out, _, status = run(capsys, *arguments)
        assert status == 0
        assert all(f"  {name} " in out for name in cli.COMMANDS)


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_has_help_with_an_example(capsys, name):
    out, _, status = run(capsys, name, "--help")
    assert status == 0
    assert f"    coachable {name}" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["trian"], ["'trian'", "'train'"]),
        (["train", "papr"], ["'papr'", "'paper'"]),
        (["train", "paper", "--setups", "orthant", "sprase"], ["'sprase'", "'sparse'"]),
        (["train", "paper", "--semantics", "papr"], ["--semantics", "paper", "released-code"]),
        (["train", "paper", "--steps", "many"], ["--steps"]),
        (["train", "paper", "--steps", "0"], ["steps must be at least 1"]),
        (["train", "paper", "--behaviour", "compas-walking"], ["'compas-walking'", "'compass-walking'"]),
        (["train", "paper", "--behaviour", "hop"], ["the compass walker has no signal 'feet_down'"]),
        (["format"], ["name at least one file"]),
        (["format", "nowhere.behaviour"], ["nowhere.behaviour", "No such file"]),
        (["table", "nowhere"], ["nowhere is not a folder"]),
        (["watch", "nowhere", "-o", "gait.png"], ["nowhere is not a folder"]),
        (["watch", "none", "-o", "gait.doc"], ["gait.doc", ".gif"]),
        (["watch", "none", "--seed", "3", "-o", "gait.gif"], ["--seed", "none is given"]),
        (["watch", "fall.json", "--setup", "orthant", "-o", "gait.gif"], ["--setup", "fall.json is given"]),
        (["watch", "nowhere", "--seconds", "0", "-o", "gait.png"], ["seconds must be greater than zero"]),
        (["record", "nowhere", "--episode", "-1", "-o", "walk.csv"], ["counted from 0"]),
        (["watch", "nowhere", "--seconds", "1e308", "-o", "gait.png"], ["seconds must be from"]),
        (["record", "nowhere", "--episode", str(10**30), "-o", "walk.csv"], ["at most 1,000,000"]),
        (["gait", "nowhere", "--episodes", str(10**12)], ["episodes must be at most"]),
        (["explain", "compass-walking", "nowhere.csv", "--limit", "-5"], ["limit must be at least 0"]),
        (["train", "demo", "--steps", str(10**30)], ["steps must be"]),
        (["train", "demo", "--seeds", "2000000000"], ["setups times seeds"]),
        (["gait", "nowhere", "--speed", "nan"], ["speed must be a finite number"]),
        (["gait", "nowhere", "-o", "gaits.md"], ["gaits.md", "give a folder"]),
        (["table", "nowhere", "-o", "table.md"], ["table.md", "give a folder"]),
        (["table", "nowhere", "-o", "folder", "--json"], ["--json", "leave out"]),
        (["compare", "nowhere", "nowhere", "-o", "both.html"], ["both.html", "give a folder"]),
        (["verify", "nowhere", "-o", "passport.json"], ["passport.json", "give a folder"]),
        (["verify", "runs/paper", "--recheck", "c.json"], ["leave out runs/paper"]),
        (["record", "nowhere", "-o", "walk.txt"], ["walk.txt", ".csv, .csv.gz or .parquet"]),
        (["draw", "compass-walking", "-o", "x.jpg"], ["x.jpg", ".svg, .png, .dot, .mmd"]),
        (["export", "nowhere", "-o", "x.doc"], ["x.doc", ".onnx, .kyx, .xml, .py"]),
        (["explain", "compass-walking", "nowhere.csv", "-o", "x.txt"], ["x.txt", ".csv"]),
        (["report"], ["RUN"]),
        (["report", "nowhere", "-o", "x.html"], ["nowhere is not a folder"]),
        (["report", "[/red]", "-o", "x.html"], ["[/red] is not a folder"]),
        (["verify", "[/red]"], ["[/red] is not a folder"]),
        (["report", "nowhere", "-o", "x.pdf"], ["x.pdf", ".html, .md", "folder"]),
        (["baseline", "gravity"], ["the compass walker has no baseline 'gravity'", "'virtual-gravity'"]),
        (["baseline", "virtual-gravity:slop=1"], ["no setting 'slop'", "'slope'"]),
        (["baseline", "virtual-gravity:slope=steep"], ["slope=-0.05"]),
        (["baseline", "constant-torque:torque=1"], ["takes 2 numbers, got 1"]),
        (["baseline", "--plant", "compas"], ["unknown plant 'compas'", "'compass'"]),
        (["watch", "none", "--plant", "nowhere:Robot", "-o", "x.gif"], ["'nowhere'", "cannot be imported"]),
        (["check", "compass-walking", "--plant", "compas"], ["unknown plant 'compas'"]),
    ],
)
def test_a_mistake_is_one_clear_message_and_status_2(capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    out, err, status = run(capsys, *arguments)
    assert status == 2
    assert out == ""
    assert "Traceback" not in err
    assert all(words in err for words in said)
    assert not list(tmp_path.rglob("*.toml"))


def test_a_file_that_cannot_be_written_is_named(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    _, err, status = run(capsys, "train", "demo", "--out", tmp_path / "file" / "run")
    assert status == 2
    assert str(tmp_path / "file") in err


def test_a_full_disk_is_a_message_and_no_traceback(capsys, monkeypatch):
    def full_disk(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setitem(cli.COMMANDS, "cite", full_disk)
    _, err, status = run(capsys, "cite")
    assert status == 2
    assert err == f"coachable: {os.strerror(errno.ENOSPC)}\n"


def test_a_reader_who_has_enough_is_not_told_so():
    reading, writing = os.pipe()
    os.close(reading)
    program = "from coachable import cli; cli.main(['cite'])"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert done.returncode == 1
    assert done.stderr == ""


def test_a_description_with_errors_is_said_to_have_them_before_it_is_trained(capsys, tmp_path):
    wrong = tmp_path / "wrong.behaviour"
    wrong.write_text(
        'behaviour "wrong"\nsignals\n  x [m]\nphases\n  a: x > 1, x < 0\n  b: x > 2\ncycle\n  a -> b -> a\n'
    )
    warn_of_errors(load_behaviour(wrong), str(wrong))
    said = capsys.readouterr().err
    assert "has 1 error" in said
    assert f"coachable check {wrong}" in said
    warn_of_errors(load_behaviour("compass-walking"), "compass-walking")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("command", [["train", "plan.toml"], ["train", "demo", "--settings", "plan.toml"]])
def test_a_plan_that_is_no_text_is_refused(capsys, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.toml").write_bytes(b"\xff\xfe")
    _, err, status = run(capsys, *command)
    assert status == 2
    assert "plan.toml is damaged: it is not text in UTF-8" in err


def test_options_reach_the_plan(capsys, small_run, small_plan):
    options = ["--steps", "7", "--setups", "orthant", "--seeds", "1", "--clock", "touchdown"]
    released = ["--semantics", "released-code", "--reward-variant", "stay"]
    _, err, status = run(capsys, "train", small_plan, "--out", small_run.path, *options, *released)
    assert status == 2
    for line in ("steps: 1250 → 7", "seeds.count: 2 → 1", "clock: 'free' → 'touchdown'"):
        assert line in err
    assert "semantics: 'paper' → 'released-code'" in err
    assert "behaviour: 'compass-walking' → 'compass-walking-released'" in err
    assert "reward_variant" not in err
    assert "setups.orthant.orthant: 'absent' → 0.01" in err


def test_a_finished_experiment_prints_its_table_and_draws_its_figures(capsys, copied_run, small_plan):
    for arguments in (["train", small_plan, "--out", copied_run], ["table", copied_run]):
        out, err, status = run(capsys, *arguments)
        assert (status, err) == (0, "")
        assert "forward+orthant" in out
        for name in ("learning_curves", "walking_distance"):
            for suffix in ("svg", "png"):
                assert f"{name}.{suffix}" in out
                (copied_run / f"{name}.{suffix}").unlink()
        assert "| forward+orthant |" in (copied_run / "table.md").read_text(encoding="utf-8")


def test_baselines_are_the_papers(capsys):
    out, _, status = run(capsys, "baseline", "--json")
    numbers = json.loads(out)
    assert status == 0
    assert numbers["hip_x"] == pytest.approx(7.8334, abs=5e-5)
    assert numbers["touchdowns"] == 13
    assert numbers["rewards"]["orthant"] == pytest.approx(17.332, abs=5e-4)
    out, _, _ = run(capsys, "baseline", "--semantics", "released-code")
    assert "8.2157 m" in out
    out, _, _ = run(capsys, "baseline", "none", "--json")
    assert json.loads(out)["fell"] is True
    assert json.loads(out)["period"] is None
    out, _, _ = run(capsys, "baseline", "none")
    period, touchdowns = (
        next(line for line in out.splitlines() if w in line) for w in ("period", "touchdowns")
    )
    assert "nan" not in out
    assert period.endswith("–")
    assert len(period) == len(touchdowns)


def test_a_baseline_describes_its_settings_and_takes_others(capsys):
    out, _, _ = run(capsys, "baseline")
    assert "virtual-gravity:slope=-0.07\n      Walk on the flat as if down a slope" in out
    assert "constant-torque:torque=-1.35,-0.18\n" in out
    out, _, _ = run(capsys, "baseline", "virtual-gravity:slope=-0.07", "--json")
    assert json.loads(out)["hip_x"] == pytest.approx(7.8334, abs=5e-5)
    out, _, _ = run(capsys, "baseline", "virtual-gravity:slope=-0.01", "--json")
    other = json.loads(out)
    assert other["settings"] == {"slope": -0.01}
    assert other["hip_x"] < 4


def test_a_plant_of_ones_own_has_baselines(capsys, tmp_path):
    wheel = ("--plant", "tests.plants.rimless_wheel:RimlessWheel")
    behaviour = ("--behaviour", ROLLING)
    out, _, status = run(capsys, "baseline", "none", *wheel, *behaviour, "--json")
    assert status == 0
    assert json.loads(out)["plant"] == "the rimless wheel"
    assert json.loads(out)["touchdowns"] > 10
    _, err, status = run(capsys, "baseline", *wheel)
    assert (status, "no behaviour ships for the rimless wheel" in err) == (2, True)
    out, _, status = run(
        capsys, "watch", "none", *wheel, *behaviour, "--seconds", "1", "-o", tmp_path / "roll.png"
    )
    assert (status, (tmp_path / "roll.png").exists()) == (0, True)
    _, err, status = run(capsys, "check", "compass-walking", *wheel)
    assert status == 2
    assert "the rimless wheel gives none" in err


def test_numbers_are_printed_as_one_json_document_and_nothing_is_written(capsys, copied_run):
    before = sorted(copied_run.rglob("*"))
    out, err, status = run(capsys, "table", copied_run, "--json")
    numbers = json.loads(out)
    assert (status, err) == (0, "")
    assert [setup["name"] for setup in numbers["setups"]] == ["sparse", "forward+orthant"]
    final = numbers["setups"][0]["final_mean"]
    assert final["low"] <= final["value"] <= final["high"]
    assert {claim["name"] for claim in numbers["claims"]} == {f"C{number}" for number in range(1, 7)}
    out, err, status = run(capsys, "compare", copied_run, copied_run, "--json")
    numbers = json.loads(out)
    assert (status, err) == (0, "")
    assert len(numbers["setups"]) == 2
    for setup in numbers["setups"]:
        for measure in setup["measures"]:
            assert measure["first"] == measure["second"]
            assert measure["difference"]["value"] == 0
    assert sorted(copied_run.rglob("*")) == before


def test_a_lane_and_a_baseline_can_be_watched(capsys, small_run, tmp_path):
    lane, best, baseline = tmp_path / "lane.png", tmp_path / "best.gif", tmp_path / "baseline.svg"
    out, _, status = run(capsys, "watch", small_run.path, "--setup", "sparse", "--seed", "4", "-o", lane)
    assert (status, out) == (0, f"{lane}: sparse, seed 4, last policy\n")
    out, _, status = run(capsys, "watch", small_run.path, "--which", "best", "--seconds", "12", "-o", best)
    assert (status, out) == (0, f"{best}: sparse, seed 3, best policy\n")
    out, _, status = run(capsys, "watch", "constant-torque", "--seconds", "2", "-o", baseline)
    assert status == 0
    assert lane.read_bytes().startswith(b"\x89PNG")
    assert best.read_bytes().startswith(b"GIF")
    assert b"<svg" in baseline.read_bytes()


def test_a_lane_is_exported_with_its_policy(capsys, small_run, tmp_path):
    lane = ("--setup", "sparse", "--seed", "4", "-o")
    out, _, status = run(capsys, "export", small_run.path, *lane, tmp_path / "walker.py")
    assert status == 0
    assert "last policy of sparse-4" in out
    walked = subprocess.run([sys.executable, "-I", tmp_path / "walker.py"], capture_output=True, text=True)
    *_, last = csv.DictReader(walked.stdout.splitlines())
    stored = small_run.trajectory("sparse", 4)
    assert float(last["t"]) == pytest.approx(stored["t"][-1], abs=1e-3)
    assert float(last["theta_2"]) == pytest.approx(stored["theta_2"][-1], abs=1e-2)
    for path, wrong in ((small_run.path, ("--baseline", "none")), (tmp_path, ())):
        _, err, status = run(capsys, "export", path, *wrong, "-o", tmp_path / "walker.kyx")
        assert status == 2
        assert "--baseline" in err or "manifest.json" in err


def test_several_seeds_are_watched_side_by_side(capsys, small_run, tmp_path):
    film, picture = tmp_path / "both.gif", tmp_path / "both.png"
    for out in (film, picture):
        arguments = ("--setup", "sparse", "--seed", "3", "4", "--seconds", "0.5", "-o", out)
        said, _, status = run(capsys, "watch", small_run.path, *arguments)
        assert (status, said) == (0, f"{out}: sparse, seeds 3, 4, last policy\n")
    with Image.open(film) as frames:
        assert frames.size == (1280, 360)
    _, err, status = run(capsys, "watch", small_run.path, "--seed", "3", "9", "-o", film)
    assert status == 2
    assert "has no seed 9" in err


def test_a_report_is_written_in_every_format(capsys, copied_run, tmp_path):
    out, err, status = run(capsys, "report", copied_run)
    assert (status, out, err) == (0, f"wrote {copied_run / 'report.html'}\n", "")
    page = (copied_run / "report.html").read_text(encoding="utf-8")
    assert "harnack2023deriving" in page
    assert "small: 2 setups × 2 seeds × 1,250 steps" in page
    out, err, status = run(capsys, "report", copied_run, tmp_path / "nowhere", "-o", tmp_path / "r.md")
    assert status == 0
    assert "not in the report" in err
    assert "nowhere" in err
    assert "| forward+orthant |" in (tmp_path / "r.md").read_text(encoding="utf-8")
    out, _, status = run(capsys, "report", copied_run, "-o", tmp_path / "figures")
    assert status == 0
    assert out.count("wrote") == len(list((tmp_path / "figures").iterdir())) >= 2


def test_what_to_cite_is_bibtex(capsys):
    out, _, status = run(capsys, "cite")
    assert status == 0
    assert out.count("{") == out.count("}")
    assert out.count("\n@") + 1 == 3
    assert "Symbolic Behaviour Descriptions" in " ".join(out.split())


UGLY = 'behaviour "a"  # mine\nphases\n  A : true\n'
PRETTY = 'behaviour "a"  # mine\n\nphases\n  A:  true\n'


def test_format_lays_out_in_place_and_leaves_what_has_mistakes(capsys, tmp_path):
    ugly, link, broken = (tmp_path / name for name in ("a.behaviour", "link.behaviour", "b.behaviour"))
    ugly.write_text(UGLY)
    ugly.chmod(0o640)
    link.symlink_to(ugly)
    broken.write_text(UGLY + "  A: false\n")
    out, _, status = run(capsys, "format", "--check", link)
    assert (out, status, ugly.read_text()) == (f"{link}: not formatted\n", 1, UGLY)
    out, err, status = run(capsys, "format", broken, link)
    assert (out, status) == (f"{link}: formatted\n", 2)
    assert f"{broken}:4:3: phase A is given twice" in err
    assert broken.read_text() == UGLY + "  A: false\n"
    assert (ugly.read_text(), link.is_symlink(), ugly.stat().st_mode & 0o777) == (PRETTY, True, 0o640)
    assert run(capsys, "format", "--check", ugly) == ("", "", 0)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "a.behaviour",
        "b.behaviour",
        "link.behaviour",
    ]


def test_a_description_is_not_drawn_over_itself(capsys, tmp_path):
    file = tmp_path / "mine.svg"
    file.write_text(PRETTY)
    _, err, status = run(capsys, "draw", file, "-o", file)
    assert (status, "give another file" in err, file.read_text()) == (2, True, PRETTY)


def test_a_program_whose_output_is_closed_ends_without_a_traceback(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    cli.main(["cite"])
    sys.stdout.close()


def test_modules_of_the_current_folder_are_found_but_hide_no_others(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry])
    run(capsys, "cite")
    assert sys.path[-1] == str(tmp_path)


def test_what_is_nested_too_deeply_is_a_sentence(capsys, monkeypatch):
    def deep():
        raise RecursionError

    monkeypatch.setitem(cli.COMMANDS, "cite", deep)
    _, err, status = run(capsys, "cite")
    assert (status, err) == (2, "coachable: something that was given is nested too deeply to be read\n")
