"""What `import coachable as co` offers."""

import ast
import importlib
from pathlib import Path

import pytest

import coachable as co

SOURCE = ast.parse(Path(co.__file__).read_text(encoding="utf-8"))


def imported_for_type_checkers():
    return {
        str(alias.asname): str(node.module)
        for node in ast.walk(SOURCE)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("coachable.")
        for alias in node.names
    }


def test_type_checkers_see_the_names_that_are_loaded():
    assert imported_for_type_checkers() == {name: f"coachable.{home}" for name, home in co._HOMES.items()}


@pytest.mark.parametrize("name", co.__all__)
def test_every_name_is_its_homes(name):
    home = importlib.import_module(imported_for_type_checkers()[name])
    assert getattr(co, name) is getattr(home, name)
    assert name in dir(co)


def test_another_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'coachable' has no attribute 'studdy'"):
        _ = co.studdy


def test_a_controller_is_rolled_out_in_one_line():
    trajectory = co.rollout(co.ConstantTorque((-1.35, -0.18)), seconds=1.0)
    assert trajectory.time[-1] == pytest.approx(1.0)
    assert len(trajectory.theta_1) == len(trajectory.phase) == len(trajectory.terms["orthant"]) == 101
