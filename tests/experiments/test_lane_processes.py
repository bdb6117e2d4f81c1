"""Lanes in processes: all are run, progress is received, and a failure stops everything in good order."""

import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pytest

from coachable.experiments.trainers.lane_processes import Progress, run_lanes
from coachable.foundation.errors import PlanError, RunFolderError


@dataclass(frozen=True)
class Count:
    """Counts to ten in a file, and goes on from there."""

    path: Path
    ends: str = "well"

    @property
    def name(self):
        return self.path.name

    def finished(self):
        done = self.path.exists() and self.path.read_text() == "10"
        return Progress(10, {}, True) if done else None

    def run(self, report):
        start = int(self.path.read_text()) if self.path.exists() else 0
        for number in range(start, 10):
            try:
                report(Progress(number, {}, False))
            except KeyboardInterrupt:
                self.path.write_text(str(number))
                raise
            if self.ends == "hangs":
                self.path.with_suffix(".hangs").touch()
                while True:
                    pass
            if self.ends == "waits":
                time.sleep(0.05)
            if number == 5:
                if self.ends == "mistake":
                    raise PlanError("no such thing")
                if self.ends == "full disk":
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                if self.ends == "bug":
                    raise ZeroDivisionError("a bug")
                if self.ends == "killed":
                    os.kill(os.getpid(), signal.SIGKILL)
                if self.ends == "told to stop":
                    os.kill(os.getpid(), signal.SIGTERM)
        self.path.write_text("10")
        report(Progress(10, {}, True))


def nothing():
    pass


def test_every_lane_is_run_and_its_end_is_received(tmp_path):
    works = [Count(tmp_path / str(i)) for i in range(3)]
    received = {}
    run_lanes(works, 2, received.__setitem__, nothing)
    assert {index: progress.done for index, progress in received.items()} == {0: True, 1: True, 2: True}
    assert [work.path.read_text() for work in works] == ["10", "10", "10"]


@pytest.mark.parametrize(
    ("ends", "error", "message"),
    [
        ("mistake", PlanError, "no such thing"),
        ("bug", RuntimeError, "ZeroDivisionError: a bug"),
        ("full disk", OSError, "No space left"),
        ("killed", RunFolderError, "ended from outside"),
        ("told to stop", RunFolderError, "ended from outside"),
    ],
)
def test_what_goes_wrong_in_a_lane_is_raised_and_stops_the_others(tmp_path, ends, error, message):
    works = [Count(tmp_path / "bad", ends), Count(tmp_path / "other", "waits")]
    with pytest.raises(error, match=message):
        run_lanes(works, 2, lambda index, progress: None, nothing)
    assert multiprocessing.active_children() == []


def test_ctrl_c_lets_every_lane_save_and_the_next_run_goes_on(tmp_path):
    works = [Count(tmp_path / str(i), "waits") for i in range(2)]

    def interrupt(index, progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_lanes(works, 2, interrupt, nothing)
    assert any(work.path.exists() for work in works)
    assert all(int(work.path.read_text()) < 10 for work in works if work.path.exists())
    run_lanes(works, 2, lambda index, progress: None, nothing)
    assert [work.path.read_text() for work in works] == ["10", "10"]


def test_a_lane_that_hangs_in_a_step_is_ended(tmp_path):
    work, began = Count(tmp_path / "0", "hangs"), []

    def interrupt():
        if (tmp_path / "0.hangs").exists():
            began.append(time.monotonic())
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_lanes([work], 1, lambda index, progress: None, interrupt)
    assert time.monotonic() - began[0] < 10
    assert multiprocessing.active_children() == []


def test_a_lane_that_hangs_ends_when_its_parent_is_killed(tmp_path):
    program = (
        "import os, pathlib, sys\n"
        "from coachable.experiments.trainers.lane_processes import run_lanes\n"
        "from tests.experiments.test_lane_processes import Count, nothing\n"
        "path = pathlib.Path(sys.argv[1])\n"
        "work = Count(path, 'hangs')\n"
        "def watch():\n"
        "    import multiprocessing\n"
        "    if path.with_suffix('.hangs').exists():\n"
        "        print(multiprocessing.active_children()[0].pid, flush=True)\n"
        "        os.kill(os.getpid(), 9)\n"
        "if __name__ == '__main__':\n"
        "    run_lanes([work], 1, lambda index, progress: None, watch)\n"
    )
    (tmp_path / "program.py").write_text(program)
    root = str(Path(__file__).parents[2])
    command = [sys.executable, str(tmp_path / "program.py"), str(tmp_path / "0")]
    environ = os.environ | {"PYTHONPATH": os.pathsep.join([os.environ.get("PYTHONPATH", ""), root])}
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=120, env=environ)
    assert done.returncode == -signal.SIGKILL
    child = int(done.stdout)
    for _ in range(600):
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            return
        if Path(f"/proc/{child}/stat").read_text().split()[2] == "Z":
            return  # ended; nobody has asked for its end
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    raise AssertionError("the lane goes on without its parent")


def test_processes_that_are_just_beginning_leave_ctrl_c_to_the_one_that_started_them(tmp_path):
    """In a terminal it reaches all of them, wherever they are; only the parent decides."""
    works = [Count(tmp_path / str(i)) for i in range(2)]
    hit = set()

    def ctrl_c():
        for process in multiprocessing.active_children():
            if process.pid not in hit:
                hit.add(process.pid)
                os.kill(process.pid, signal.SIGINT)

    run_lanes(works, 2, lambda index, progress: None, ctrl_c)
    assert len(hit) == 2
    assert [work.path.read_text() for work in works] == ["10", "10"]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.parametrize("masks", [True, False])
def test_a_ctrl_c_while_a_process_is_starting_waits_until_that_can_be_stopped(
    tmp_path, monkeypatch, request, masks
):
    if not masks:  # as on Windows
        monkeypatch.delattr(signal, "pthread_sigmask")
    # A shell that starts the tests in its background has Ctrl-C ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    start, started = SpawnProcess.start, []

    def interrupted(process):
        os.kill(os.getpid(), signal.SIGINT)
        start(process)
        started.append(process)

    monkeypatch.setattr(SpawnProcess, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_lanes([Count(tmp_path / "0", "waits")], 1, lambda index, progress: None, nothing)
    assert len(started) == 1
    assert not started[0].is_alive()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_lane_saves_and_ends_when_its_parent_is_killed(tmp_path):
    program = (
        "import os, pathlib, sys\n"
        "from coachable.experiments.trainers.lane_processes import run_lanes\n"
        "from tests.experiments.test_lane_processes import Count, nothing\n"
        "work = Count(pathlib.Path(sys.argv[1]), 'waits')\n"
        "run_lanes([work], 1, lambda index, progress: os.kill(os.getpid(), 9), nothing)\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "0")]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=60)
    assert done.returncode == -signal.SIGKILL, done.stderr
    for _ in range(600):
        if (tmp_path / "0").exists():
            break
        time.sleep(0.05)
    assert int((tmp_path / "0").read_text()) < 10


def test_a_lane_that_is_done_is_received_of_without_a_process(tmp_path):
    (tmp_path / "done").write_text("10")
    received = {}
    works = [Count(tmp_path / "done", "bug"), Count(tmp_path / "other")]
    run_lanes(works, 1, received.__setitem__, nothing)
    assert received[0] == Progress(10, {}, True)
    assert received[1].done
