"""A run folder has one writer at a time, and a lock ends with its holder."""

import os
import subprocess
import sys

import pytest

from coachable.experiments.run_folder.lock import locked
from coachable.foundation.errors import RunFolderError


def test_two_writers_cannot_hold_one_folder(tmp_path):
    with locked(tmp_path):
        with pytest.raises(RunFolderError, match=f"process {os.getpid()}"), locked(tmp_path):
            pass
        assert (tmp_path / "lock").exists()
    assert not (tmp_path / "lock").exists()
    with locked(tmp_path):
        pass


def test_the_holder_in_another_process_is_named(tmp_path):
    program = (
        "import sys, pathlib\nfrom coachable.experiments.run_folder.lock import locked\n"
        "with locked(pathlib.Path(sys.argv[1])):\n    print('held', flush=True)\n    sys.stdin.read()\n"
    )
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", program, str(tmp_path)]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        with (
            pytest.raises(RunFolderError, match=f"is being written by process {holder.pid};"),
            locked(tmp_path),
        ):
            pass
        holder.stdin.close()
    with locked(tmp_path):
        pass


@pytest.mark.parametrize("left", ["", f" {3_000_000_000:<11}\n", "123\n", "of some other program\n" * 9])
def test_a_file_that_was_left_behind_locks_nothing(tmp_path, left):
    (tmp_path / "lock").write_text(left)
    with locked(tmp_path), pytest.raises(RunFolderError, match=f"process {os.getpid()};"), locked(tmp_path):
        pass
    assert not (tmp_path / "lock").exists()


def test_a_lock_dies_with_its_holder(tmp_path):
    program = (
        "import os, sys, pathlib\nfrom coachable.experiments.run_folder.lock import locked\n"
        "with locked(pathlib.Path(sys.argv[1])):\n    os.kill(os.getpid(), 9)\n"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False)
    assert done.returncode == -9
    assert (tmp_path / "lock").exists()
    with locked(tmp_path):
        assert (tmp_path / "lock").read_text().split() == [str(os.getpid())]


def test_many_writers_take_turns(tmp_path):
    """However their files are opened and removed, at most one at a time is inside."""
    program = (
        "import os, sys, pathlib\n"
        "from coachable.experiments.run_folder.lock import locked\n"
        "from coachable.foundation.errors import RunFolderError\n"
        "folder, entered = pathlib.Path(sys.argv[1]), 0\n"
        "while entered < 100:\n"
        "    try:\n"
        "        with locked(folder):\n"
        "            os.close(os.open(folder / 'inside', os.O_CREAT | os.O_EXCL))\n"
        "            os.unlink(folder / 'inside')\n"
        "            entered += 1\n"
        "    except RunFolderError:\n"
        "        pass\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    writers = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    assert [writer.communicate(timeout=60)[1] for writer in writers] == [""] * 3
