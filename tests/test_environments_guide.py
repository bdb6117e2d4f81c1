"""What docs/environments.md shows works: its Python prints what its comments say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from coachable.behaviours.text.document import formatted_file

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "environments.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+) ?(\S*)\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("guide")
    for kind, name, text in BLOCKS:
        if kind == "behaviour":
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


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(((?!https:)[^)#]+)\)", GUIDE))))
def test_what_it_links_to_is_there(target):
    assert (ROOT / "docs" / target).exists()
