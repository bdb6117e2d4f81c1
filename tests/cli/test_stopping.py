"""Ctrl-C and SIGTERM end a command wherever it is: one line, the exit code, no trace and no child."""

import os
import shlex
import signal
import subprocess
import sys
import time

import pytest

PROGRAM = """
import os, signal, sys
from coachable.cli import main

class Arguments(list):
    def __getitem__(self, which):  # the first thing that `main` does
        sys.argv = [*self]
        os.write(1, b"begins")
        return sys.argv[which]

signal.signal(signal.SIGINT, signal.default_int_handler)  # tests in the background ignore it
sys.argv = Arguments(sys.argv)
"""

DOES = """
import ctypes, multiprocessing, threading, time, types
from coachable.foundation.files import written_beside
from coachable.foundation.stopping import Interruptible

def run(arguments):
    os.write(1, b"runs")
    %s

sys.modules["coachable.cli.commands"] = types.SimpleNamespace(run=run)
"""
"""A program whose commands do something else, and which is quick to start."""


def stopped(arguments, *signals, program="", when=b"begins", delay=0.0, folder=None, pause=0.5):
    """The exit code, what it printed, and the seconds that it took to end, of a command that gets signals."""
    command = [sys.executable, "-c", f"{PROGRAM}\n{program}\nmain()", *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=folder) as process:
        try:
            printed = b""
            while when not in printed:
                one = os.read(process.stdout.fileno(), 1)
                assert one, process.communicate()[1].decode()
                printed += one
            time.sleep(delay)
            began = time.monotonic()
            for index, number in enumerate(signals):
                if index:
                    time.sleep(pause)
                process.send_signal(number)
            rest, said = process.communicate(timeout=30)
        finally:
            process.kill()
    return process.returncode, (printed + rest + said).decode(), time.monotonic() - began


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2, 0.5, 1.0, 2.0])
def test_ctrl_c_while_a_command_starts_ends_it_with_one_line(tmp_path, delay):
    arguments = ["train", "demo", "-o", tmp_path / "a run"]
    code, printed, _ = stopped(arguments, signal.SIGINT, delay=delay)
    assert code == 130
    goes_on = shlex.join(["coachable", *map(str, arguments)])
    assert f"Stopped. Nothing is lost; go on with: {goes_on}\n" in printed
    assert printed.count("Stopped") == 1
    assert "Traceback" not in printed
    assert "ignored" not in printed


LOCK = """lock, mutex = ctypes.CDLL(None).pthread_mutex_lock, ctypes.create_string_buffer(64)
    [lock(mutex) for _ in range(2)]
"""
FORK = "multiprocessing.get_context('fork').Process(target=time.sleep, args=(60,)).start()"


@pytest.mark.parametrize(
    ("hangs", "number", "code"),
    [
        ("while True: time.sleep(0.01)", signal.SIGINT, 130),
        ("while True: time.sleep(0.01)", signal.SIGTERM, 143),
        (LOCK, signal.SIGINT, 130),
        ("\n    while True:\n     try: time.sleep(9)\n     except BaseException: pass", signal.SIGINT, 130),
        ("threading.Thread(target=time.sleep, args=(60,)).start()", signal.SIGINT, 130),
        (f"{FORK}; os.write(1, b'forked'); time.sleep(60)", signal.SIGINT, 130),
    ],
    ids=["in Python", "SIGTERM", "in C", "where exceptions are swallowed", "in a thread", "in a child"],
)
def test_a_command_that_hangs_is_ended_at_once(hangs, number, code):
    when = b"forked" if "fork" in hangs else b"runs"
    ended, printed, seconds = stopped(["cite"], number, program=DOES % hangs, when=when, delay=0.1)
    assert (ended, printed.replace("forked", "")) == (code, "beginsrunsStopped.\n")
    assert seconds < 5


def test_a_solver_leaves_ctrl_c_to_the_program(tmp_path):
    """Z3 has a handler of its own, which would only end one of its answers."""
    hard = "\n".join(
        [
            "import z3",
            "    from coachable.behaviours.checking.solver import smt",
            "    solver = smt._limited(z3.SimpleSolver)",
            "    solver.set('rlimit', 0)",
            "    holes = [[z3.Bool(f'{p} {h}') for h in range(11)] for p in range(12)]",
            "    solver.add(*(z3.Or(*row) for row in holes))",
            "    pairs = ((a[h], b[h]) for h in range(11) for i, a in enumerate(holes) for b in holes[:i])",
            "    solver.add(*(z3.Not(z3.And(one, other)) for one, other in pairs))",
            "    os.write(1, b'solves')",
            "    solver.check()",
        ]
    )
    code, _, seconds = stopped(["cite"], signal.SIGINT, program=DOES % hard, when=b"solves", delay=0.3)
    assert code == 130
    assert seconds < 5


SAVES = """
    with Interruptible():
        try:
            time.sleep(60)
        except KeyboardInterrupt:
            os.write(1, b"saves")
            %s
            raise
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_what_has_something_to_save_saves_it(number, code):
    program = DOES % (SAVES % "time.sleep(0.3); os.write(1, b'saved')")
    for signals in ((number,), (number, number)):  # what runs it may send what the terminal has sent
        ended, printed, _ = stopped(["cite"], *signals, program=program, when=b"runs", delay=0.1, pause=0.01)
        assert (ended, printed) == (code, "beginsrunssavessavedStopped.\n")


def test_another_ctrl_c_does_not_wait_for_what_is_saved():
    program = DOES % (SAVES % "time.sleep(60)")
    signals = (signal.SIGINT, signal.SIGINT)
    code, printed, seconds = stopped(["cite"], *signals, program=program, when=b"runs", delay=0.1)
    assert (code, printed) == (130, "beginsrunssavesStopped.\n")
    assert seconds < 5


def test_a_file_that_is_being_written_is_not_left_beside_the_old_one(tmp_path):
    (tmp_path / "out").write_text("old")
    program = DOES % (
        "import pathlib\n    with written_beside(pathlib.Path('out')):\n"
        "        os.write(1, b'writes'); time.sleep(60)"
    )
    code, _, _ = stopped(["cite"], signal.SIGINT, program=program, when=b"writes", delay=0.1, folder=tmp_path)
    assert code == 130
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out").read_text() == "old"


def test_a_job_in_the_background_keeps_ignoring_ctrl_c():
    program = "signal.signal(signal.SIGINT, signal.SIG_IGN)\n" + DOES % "time.sleep(0.5)"
    code, printed, _ = stopped(["cite"], signal.SIGINT, program=program, when=b"runs")
    assert (code, printed) == (0, "beginsruns")
