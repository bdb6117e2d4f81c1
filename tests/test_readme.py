"""What the README shows works: its Python runs, its plan is a plan, its files exist."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from coachable.experiments.plan import load_plan

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def test_the_python_runs_and_prints_what_its_comment_says(tmp_path):
    (code,) = blocks("python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 12
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    phase, distance, share = done.stdout.splitlines()
    assert phase == "O1"
    assert re.fullmatch(r"-?\d+\.\d\d m in \d+\.\d\d s", distance)
    assert re.fullmatch(r"\d+% of the time in a phase", share)


def test_the_plan_is_a_plan(tmp_path):
    (text,) = blocks("toml")
    path = tmp_path / "heavier-hip.toml"
    path.write_text(text, encoding="utf-8")
    plan = load_plan(path)
    assert [setup.name for setup in plan.setups] == ["orthant", "gentle"]
    assert plan.problem.plant.parameters.hip_mass == 2.0
    assert len(plan.lanes) == 16


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#]+)\)", README))))
def test_what_it_links_to_is_there(target):
    assert target.startswith("https://") or (ROOT / target).exists()
