"""What docs/environments.md shows works: its Python prints what its comments say."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import jaxtyping
import pytest

from coachable import cli
from coachable.behaviours.text.document import formatted_file
from coachable.experiments.trainers import environment_trainer, process_lane

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "environments.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+) ?(\S*)\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("guide")
    for kind, name, text in BLOCKS:
        if kind in ("behaviour", "toml"):
            (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", [name for kind, name, _ in BLOCKS if kind == "behaviour"])
def test_every_description_is_one_and_formatted(folder, name):
    text, formatted = formatted_file(folder / name)
    assert text == formatted


def test_the_python_prints_what_its_comments_say(folder):
    """All in one interpreter, for what takes long is loading JAX."""
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")
    codes = [text for kind, _, text in BLOCKS if kind == "python"]
    shown = " ".join(comment for code in codes for comment in re.findall(r"# ?(.*)", code))
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(codes)], cwd=folder, capture_output=True, text=True, encoding="utf-8"
    )
    assert (done.stdout + done.stderr).split() == shown.split()


def test_its_commands_run(folder, monkeypatch, capsys):
    """With fewer steps, fewer seeds and all in one process: what is trained here need not be good."""
    for module in ("mujoco", "onnx"):
        pytest.importorskip(module)
    monkeypatch.chdir(folder)
    monkeypatch.setattr(process_lane, "SECONDS_BETWEEN_CHECKPOINTS", 1e9)
    monkeypatch.setattr(environment_trainer, "run_lanes", one_after_another)
    commands = [line for kind, _, text in BLOCKS if kind == "sh" for line in text.splitlines()]
    assert len(commands) == 6
    for command in commands:
        program, *arguments = shlex.split(command)
        assert program == "coachable"
        few = ["--steps", "2048", "--seeds", "1"] if arguments[0] == "train" else []
        with monkeypatch.context() as patch:
            # The graph's arrays hold no numbers yet, and jaxtyping does not know of them.
            patch.setattr(jaxtyping.config, "jaxtyping_disable", arguments[0] == "export")
            cli.main([*arguments, *few])
    assert (folder / "hop.gif").stat().st_size > 1000
    assert (folder / "hop.onnx").stat().st_size > 1000
    for code in [text for kind, _, text in BLOCKS if kind == "py"]:  # what needs the runs
        exec(code, {})
    table = (folder / "runs" / "hops" / "table.md").read_text()
    assert all(f"| {setup} |" in table for setup in ("alone", "both", "described"))


def one_after_another(works, num_workers, received, watch):
    for index, work in enumerate(works):
        work.run(lambda progress, index=index: received(index, progress))


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(((?!https:)[^)#]+)\)", GUIDE))))
def test_what_it_links_to_is_there(target):
    assert (ROOT / "docs" / target).exists()
