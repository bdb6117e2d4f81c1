"""What `import coachable as co` and its packages offer: every name is there, documented, and one thing."""

import ast
import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest

import coachable as co

NOUNS = {
    "Behaviour",
    "RewardForm",
    "Stay",
    "Equation",
    "Released",
    "Potential",
    "Problem",
    "PlantProblem",
    "EnvironmentProblem",
    "Experiment",
    "Run",
    "Passport",
    "recheck",
    "load_counterexample",
    "survey",
    "write_report",
}
VERBS = {"train", "open_run", "check", "parse", "to_text", "verify", "Shaping", "SignalPack"}

ROOMS = sorted(module.name for module in pkgutil.iter_modules(co.__path__) if module.ispkg)
PACKAGES = [
    "coachable",
    *(f"coachable.{room}" for room in ROOMS if room != "cli"),
    "coachable.behaviours.checking",
    "coachable.behaviours.text",
    "coachable.envs.signals",
    "coachable.plants.compass",
    "coachable.rewards.forms",
    "coachable.verification.falsification",
    "coachable.verification.passport",
]
LAZY = [name for name in PACKAGES if hasattr(importlib.import_module(name), "_HOMES")]
EXPORTS = [(package, name) for package in PACKAGES for name in importlib.import_module(package).__all__]


def imported_for_type_checkers(package):
    source = Path(inspect.getfile(importlib.import_module(package))).read_text(encoding="utf-8")
    return {
        str(alias.asname): str(node.module)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("coachable.")
        for alias in node.names
        if alias.asname
    }


def test_the_public_face_is_whole():
    assert set(co.__all__) >= NOUNS | VERBS


@pytest.mark.parametrize("package", LAZY)
def test_type_checkers_see_the_names_that_are_loaded(package):
    homes = importlib.import_module(package)._HOMES
    assert imported_for_type_checkers(package) == {name: f"coachable.{home}" for name, home in homes.items()}


@pytest.mark.parametrize(("package", "name"), EXPORTS)
def test_an_exported_name_is_there_and_documented(package, name):
    module = importlib.import_module(package)
    value = getattr(module, name)
    assert name in dir(module)
    if inspect.isclass(value) or inspect.isfunction(value):
        text = value.__doc__ or ""
        assert text.strip(), f"{name} has no docstring"
        assert not text.startswith(f"{value.__name__}("), f"{name} has only the docstring of a dataclass"


@pytest.mark.parametrize("package", PACKAGES)
def test_the_list_of_a_package_names_everything_once(package):
    listed = importlib.import_module(package).__all__
    assert len(listed) == len(set(listed))


@pytest.mark.parametrize("name", co.__all__)
def test_a_name_of_the_public_face_is_that_of_its_package(name):
    """It is exported by the package that it comes from, unless a module there has the name already."""
    home = importlib.import_module(f"coachable.{co._HOMES[name]}")
    assert getattr(co, name) is getattr(home, name)
    if hasattr(home, "__all__"):
        assert name in home.__all__
    else:
        package = importlib.import_module(home.__name__.rpartition(".")[0])
        assert name in {module.name for module in pkgutil.iter_modules(package.__path__)}


def test_another_name_is_an_attribute_error():
    for module, name in ((co, "coachable"), (importlib.import_module("coachable.analysis"), "analysis")):
        with pytest.raises(AttributeError, match=f"{name}' has no attribute 'studdy'"):
            _ = module.studdy


def test_a_description_is_read_checked_and_written_in_three_lines():
    behaviour = co.load_behaviour("compass-walking")
    assert not [one for one in co.check(behaviour).findings if one.severity == "error"]
    assert co.parse(co.to_text(behaviour)) == behaviour


def test_a_controller_is_rolled_out_in_one_line():
    trajectory = co.rollout(co.ConstantTorque((-1.35, -0.18)), seconds=1.0)
    assert trajectory.time[-1] == pytest.approx(1.0)
    assert len(trajectory.theta_1) == len(trajectory.phase) == len(trajectory.terms["orthant"]) == 101
