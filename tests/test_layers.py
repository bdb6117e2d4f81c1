"""The house rules of src/coachable, read from its syntax trees: who imports whom, and what nobody uses."""

import ast
import subprocess
import sys
from pathlib import Path

import jax.numpy as jnp
import jaxtyping
import pytest

from coachable.plants.compass import CompassWalker

PACKAGE = Path(__file__).parents[1] / "src" / "coachable"
MODULES = {
    ".".join(("coachable", *path.relative_to(PACKAGE).with_suffix("").parts)): path
    for path in sorted(PACKAGE.rglob("*.py"))
}

FLOORS = [
    {"foundation"},
    {"behaviours", "plants"},
    {"automata", "drawing"},
    {"diagram"},
    {"rewards"},
    {"envs"},
    {"learning"},
    {"experiments"},
    {"gaits"},
    {"verification"},
    {"cli"},
]
FLOOR_OF = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
READERS = {"viewing", "analysis"}
READERS_MAY_USE = (
    "coachable.foundation",
    "coachable.plants",
    "coachable.behaviours",
    "coachable.drawing",
    "coachable.diagram.draw",
    "coachable.experiments.experiment",
    "coachable.experiments.run_folder.reader",
    "coachable.experiments.run_folder.schemas",
)

LANGUAGE = {"lark", "z3", "rich"}
"""What a description is read with, checked and talked about."""

PURE = ("errors", "suggestion")
"""What the ground floor gives to descriptions."""

ONLY_IN_SB3 = {"stable_baselines3", "torch"}
UNSAFE = {"pickle", "cPickle", "cloudpickle", "dill", "marshal", "shelve"}
WITH_INTERVALS = "coachable.behaviours.checking.solver.kinematics"
"""Branch and bound over many boxes at once: crival's intervals hold NumPy's arrays."""
LONGEST_FILE = 550
"""The certificate's checker, which is to be one file to read and doubt."""


def imported_names(module: str, tree: ast.Module) -> list[str]:
    """Every imported thing by its full dotted name, wherever in the file the import stands."""
    package = module.removesuffix(".__init__") if module.endswith(".__init__") else module.rpartition(".")[0]
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")
            base = parents[: len(parents) + 1 - node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            names += [f"{source}.{alias.name}" for alias in node.names]
    return names


def may_import(room: str, name: str) -> bool:
    """Whether a file in this room may import this name of our own package."""
    if name == "coachable":
        return room == "cli"
    other = name.split(".")[1]
    if room in ("__init__", other):
        return True
    if room in READERS:
        return any(name == allowed or name.startswith(f"{allowed}.") for allowed in READERS_MAY_USE)
    if other in READERS:
        return room == "cli"
    return other in FLOOR_OF and FLOOR_OF[other] < FLOOR_OF[room]


def violations(module: str, source: str) -> list[str]:
    """Every house rule that a module of this name with this source breaks, as sentences."""
    room = module.split(".")[1]
    if room not in {"__init__", *FLOOR_OF, *READERS}:
        return [f"{module} is in no room of the house"]
    tree = ast.parse(source)
    found = []
    for name in imported_names(module, tree):
        top = name.split(".")[0]
        if top == "coachable" and not may_import(room, name):
            found.append(f"{module} imports {name}")
        if top in ONLY_IN_SB3 and module != "coachable.learning.sb3":
            found.append(f"{module} imports {top}, which only coachable.learning.sb3 may")
        if top in UNSAFE:
            found.append(f"{module} imports {top}")
        pure = (room == "behaviours" and module != WITH_INTERVALS) or module in {
            f"coachable.foundation.{name}" for name in PURE
        }
        if pure and top not in {"coachable", *LANGUAGE, *sys.stdlib_module_names}:
            found.append(f"{module} imports {top}, but descriptions are pure Python")
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            if isinstance(node.func, ast.Name) and node.func.id in {"eval", "exec"}:
                found.append(f"{module} calls {node.func.id} in line {node.lineno}")
            if any(keyword.arg == "allow_pickle" for keyword in node.keywords):
                found.append(f"{module} asks for pickles in line {node.lineno}")
    if (lines := len(source.splitlines())) > LONGEST_FILE:
        found.append(f"{module} has {lines} lines, more than {LONGEST_FILE}")
    return found


@pytest.mark.parametrize("module", MODULES)
def test_a_module_keeps_the_house_rules(module):
    assert violations(module, MODULES[module].read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("coachable.behaviours.predicates", "import coachable.plants.compass"),
        ("coachable.plants.compass", "from coachable.behaviours import Behaviour"),
        ("coachable.plants.compass", "from ..automata.hybrid import HybridAutomaton"),
        ("coachable.rewards.terms", "def later():\n    from coachable.envs import walking_task"),
        ("coachable.learning.ppo", "from coachable.experiments.run_folder.reader import Run"),
        ("coachable.learning.__init__", "from ..studies import store"),
        ("coachable.experiments.runner", "from coachable.analysis import table"),
        ("coachable.experiments.runner", "from coachable import cli"),
        ("coachable.foundation.errors", "import coachable"),
        ("coachable.analysis.figures", "from coachable.learning import policy"),
        ("coachable.analysis.figures", "from coachable.experiments.runner import run_experiment"),
        ("coachable.analysis.figures", "from coachable.automata.hybrid import HybridAutomaton"),
        ("coachable.viewing.strobe", "from coachable.analysis import figures"),
        ("coachable.behaviours.behaviour", "import numpy as np"),
        ("coachable.behaviours.library", "from jax import numpy"),
        ("coachable.learning.ppo", "import torch.nn"),
        ("coachable.experiments.runner", "from stable_baselines3 import PPO"),
        ("coachable.experiments.run_folder.reader", "import pickle"),
        ("coachable.experiments.run_folder.reader", "np.load(path, allow_pickle=True)"),
        ("coachable.behaviours.library", "eval('1')"),
        ("coachable.cli", "exec('1')"),
        ("coachable.plants.compass", "\n" * (LONGEST_FILE + 1)),
        ("coachable.utils", ""),
    ],
)
def test_a_planted_violation_is_found(module, source):
    assert violations(module, source)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("coachable.__init__", "from coachable.experiments.runner import run_experiment"),
        (
            "coachable.automata.hybrid",
            "from ..behaviours.behaviour import Behaviour\nfrom ..plants import compass",
        ),
        ("coachable.plants.__init__", "from .compass import CompassWalker"),
        ("coachable.learning.sb3", "import torch\nfrom stable_baselines3 import PPO"),
        (
            "coachable.analysis.figures",
            "from coachable.experiments.run_folder.reader import Run\nimport matplotlib",
        ),
        ("coachable.viewing.strobe", "from coachable.plants.compass import CompassWalker"),
        ("coachable.cli", "import coachable\n\n\ndef main():\n    from coachable.viewing.strobe import draw"),
        ("coachable.learning.policy", "network.eval()"),
        ("coachable.plants.compass", "\n" * LONGEST_FILE),
    ],
)
def test_a_module_within_the_rules_is_left_alone(module, source):
    assert violations(module, source) == []


def run_python(program: str) -> None:
    """Run a program in a fresh interpreter, warnings as errors; a failed assertion there fails here."""
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("statement", "heavy"),
    [
        ("import coachable", {"jax", "torch", "stable_baselines3", "matplotlib", "scipy"}),
        ("import coachable.cli", {"jax", "torch", "stable_baselines3", "matplotlib", "scipy"}),
        ("import coachable.behaviours", {"jax", "numpy", "z3", "rich"}),
    ],
)
def test_importing_is_light(statement, heavy):
    run_python(f"import sys\n{statement}\nloaded = {heavy} & set(sys.modules)\nassert not loaded, loaded")


def test_importing_everything_sets_no_jax_config():
    modules = [name.removesuffix(".__init__") for name in MODULES if name != "coachable.learning.sb3"]
    imports = "\n".join(f"import {name}" for name in modules if not name.endswith("__main__"))
    run_python(
        f"import jax\nbefore = dict(jax.config.values)\n{imports}\n"
        "changed = {k for k, v in jax.config.values.items() if before.get(k, v) != v}\n"
        "assert not changed, changed"
    )


def test_shapes_are_checked_in_tests_and_cost_users_nothing():
    walker = CompassWalker()
    with pytest.raises(jaxtyping.TypeCheckError):
        walker.flow(jnp.zeros(3), jnp.zeros(2))
    run_python("import sys, coachable.plants\nassert 'beartype' not in sys.modules")
