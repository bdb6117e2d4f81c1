"""Stopped anywhere and begun again, a study ends with the same bits; what does not fit is refused."""

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from coachable.behaviours import load_behaviour
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.experiments.plan import load_plan, with_options
from coachable.experiments.run_folder.lock import locked
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.writer import RunFolder
from coachable.experiments.runner import run_experiment
from coachable.foundation.errors import RunFolderError

COMMAND_LINE_THAT_KILLS_ITSELF = """
import os, signal, sys
from coachable import cli
from coachable.cli import experiments as commands
from coachable.experiments import survival
from coachable.experiments.trainers import lane_batch

name, times, seconds_between_checkpoints, *arguments = sys.argv[1:]
lane_batch.SECONDS_BETWEEN_CHECKPOINTS = float(seconds_between_checkpoints)
survival.NUM_STARTS = 20
left = int(times)
signal.signal(signal.SIGINT, signal.default_int_handler)
really_replace = os.replace

def replace(source, target):
    global left
    left -= name in str(target)
    if left == 0 and name in str(target):
        os.kill(os.getpid(), 9)
    really_replace(source, target)

os.replace = replace
commands.show_table = lambda run, folder: None
sys.argv[1:] = arguments
cli.main()
"""


@pytest.fixture
def study(small_plan):
    """Start the small study; it kills itself when it writes a file of that name for that many times.

    A checkpoint is written at every turn. Programs are compiled once for all of these processes.
    """
    started = []

    def study(out, name="no such file", times=1, seconds_between_checkpoints=0.0):
        arguments = (name, times, seconds_between_checkpoints, "train", small_plan, "--out", out)
        command = [sys.executable, "-c", COMMAND_LINE_THAT_KILLS_ITSELF, *map(str, arguments)]
        started.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        return started[-1]

    yield study
    for process in started:
        process.kill()
        process.communicate()


def wait_for(path, process):
    deadline = time.monotonic() + 120
    while not path.exists():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.01)


def assert_same_bits(path, run):
    assert Run.open(path).manifest["files"] == run.manifest["files"]
    for name in run.manifest["files"]:
        assert (path / name).read_bytes() == (run.path / name).read_bytes()
    assert sorted(os.listdir(path)) == sorted(os.listdir(run.path))


def test_killed_at_any_moment_the_same_command_ends_with_the_same_bits(tmp_path, study, small_run):
    out = tmp_path / "run"

    def killed_before(name, times=1):
        process = study(out, name, times)
        _, said = process.communicate(timeout=200)
        assert process.returncode == -signal.SIGKILL, said

    killed_before("automaton.svg")
    assert not (out / "manifest.json").exists()

    in_training = study(out)
    wait_for(out / "checkpoints" / "batch-000.safetensors", in_training)
    in_training.kill()
    in_training.wait()
    assert Run.open(out).status == "running"

    killed_before("forward+orthant-3-best.safetensors")
    assert Run.open(out).status == "running"

    process = study(out)
    _, said = process.communicate(timeout=200)
    assert process.returncode == 0, said
    assert_same_bits(out, small_run)


def test_ctrl_c_saves_everything_and_says_how_to_go_on(tmp_path, study, small_run, small_plan):
    out = tmp_path / "run"
    process = study(out)
    wait_for(out / "checkpoints" / "batch-000.safetensors", process)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=200)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert shlex.join(["coachable", "train", str(small_plan), "--out", str(out)]) in said
    run = Run.open(out)
    assert run.status == "interrupted"
    assert set(run.columns("evaluations")["lane"]) <= {lane.name for lane in run.lanes}
    assert sorted(path.name for path in (out / "checkpoints").iterdir())

    damaged = shutil.copytree(out, tmp_path / "damaged")
    checkpoint = next((damaged / "checkpoints").iterdir())
    checkpoint.write_bytes(checkpoint.read_bytes()[:-9])
    process = study(damaged)
    _, said = process.communicate(timeout=200)
    assert process.returncode == 2
    assert "Traceback" not in said
    assert f"{checkpoint} is damaged" in said

    process = study(out)
    _, said = process.communicate(timeout=200)
    assert process.returncode == 0, said
    assert_same_bits(out, small_run)


def test_a_finished_run_is_checked_and_left_alone(small_run, small_plan):
    before = {path: path.stat().st_mtime_ns for path in small_run.path.rglob("*") if path.is_file()}
    again = run_experiment(load_plan(small_plan), small_run.path, progress=False)
    assert again.manifest == small_run.manifest
    assert before == {path: path.stat().st_mtime_ns for path in small_run.path.rglob("*") if path.is_file()}


def test_a_finished_run_with_a_damaged_file_is_not_called_finished(small_run, small_plan, tmp_path):
    copied = shutil.copytree(small_run.path, tmp_path / "run")
    policy = copied / "policies" / "sparse-4-best.safetensors"
    policy.write_bytes(policy.read_bytes()[::-1])
    with pytest.raises(RunFolderError, match=r"sparse-4-best\.safetensors is damaged"):
        run_experiment(load_plan(small_plan), copied, progress=False)


def test_a_folder_of_another_plan_is_refused_with_the_difference(small_run, small_plan):
    other = with_options(load_plan(small_plan), steps=2000, setups=["sparse"])
    with pytest.raises(RunFolderError) as error:
        run_experiment(other, small_run.path, progress=False)
    assert "steps: 1250 → 2000" in str(error.value)
    assert "setups.forward+orthant.orthant: 0.005 → 'absent'" in str(error.value)


def test_a_folder_of_something_else_is_left_alone(tmp_path, small_plan):
    (tmp_path / "thesis.tex").write_text("…")
    with pytest.raises(RunFolderError, match=r"thesis\.tex"):
        run_experiment(load_plan(small_plan), tmp_path, progress=False)
    assert os.listdir(tmp_path) == ["thesis.tex"]


def test_a_folder_that_is_being_written_is_refused(small_run, small_plan, tmp_path):
    with locked(tmp_path), pytest.raises(RunFolderError, match=f"process {os.getpid()}"):
        run_experiment(load_plan(small_plan), tmp_path, progress=False)


def test_other_versions_are_refused_or_recorded(small_run, small_plan, tmp_path):
    copied = shutil.copytree(small_run.path, tmp_path / "run")
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["status"], manifest["files"] = "running", {}
    manifest["versions"]["jaxlib"] = "0.0.1"
    (copied / "manifest.json").write_text(json.dumps(manifest))
    experiment = load_plan(small_plan)
    with pytest.raises(RunFolderError, match=r"jaxlib: 0\.0\.1 → .*(\n.*)*--allow-different-layout"):
        RunFolder.resume(Run.open(copied), experiment, allow_different_layout=False)
    RunFolder.resume(Run.open(copied), experiment, allow_different_layout=True)
    recorded = Run.open(copied).manifest["resumed_under"]
    assert [then["versions"]["jaxlib"] for then in recorded] == [small_run.manifest["versions"]["jaxlib"]]
    RunFolder.resume(Run.open(copied), experiment, allow_different_layout=False)


def test_another_description_under_the_same_name_is_refused(small_run, small_plan):
    experiment = load_plan(small_plan)
    released = replace(experiment.problem, behaviour=load_behaviour("compass-walking-released"))
    with pytest.raises(RunFolderError, match="another description of 'compass-walking'"):
        RunFolder.resume(small_run, replace(experiment, problem=released))


def test_the_text_of_the_description_counts_and_not_where_it_lies(small_run, small_plan, tmp_path):
    copied = shutil.copytree(small_run.path, tmp_path / "run")
    assert parse((copied / "behaviour.behaviour").read_text(encoding="utf-8")) == small_run.behaviour
    path = tmp_path / "walk.behaviour"
    path.write_text("# mine\n" + to_text(small_run.behaviour), encoding="utf-8")
    folder = RunFolder.resume(Run.open(copied), load_plan(small_plan, behaviour=str(path)))
    assert folder.manifest["status"] == "complete"
    path.write_text(
        to_text(small_run.behaviour).replace("swing leg comes back", "it comes"), encoding="utf-8"
    )
    with pytest.raises(RunFolderError, match=r"behaviour: 'compass-walking' → .*walk\.behaviour"):
        RunFolder.resume(Run.open(copied), load_plan(small_plan, behaviour=str(path)))
