"""What every test runs under: checked shapes and types, float64 on request, no window, reproducible examples.

jaxtyping's import hook is switched on by `--jaxtyping-packages` in pyproject.toml, so the annotations of
`coachable` are checked with beartype here and cost users nothing.
"""

import ast
import os

import hypothesis
import pytest
from jaxtyping import _import_hook

os.environ["MPLBACKEND"] = "Agg"  # before anything imports matplotlib
# Torch's threads spin while they wait, and would take the cores from the tests that run beside them.
os.environ["OMP_NUM_THREADS"] = "1"

import jax

jax.config.update("jax_numpy_rank_promotion", "raise")


class NamedFunctions(_import_hook.JaxtypingTransformer):
    """Leaves functions within functions alone: wrapped anew at each call of the outer one, they took most of
    the time of whatever folds a syntax tree."""

    def visit_FunctionDef(self, node):
        if any(isinstance(parent, ast.FunctionDef) for parent in self._parents):
            return node
        return super().visit_FunctionDef(node)


_import_hook.JaxtypingTransformer = NamedFunctions

hypothesis.settings.register_profile("coachable", deadline=None, derandomize=True)
hypothesis.settings.load_profile("coachable")


@pytest.fixture
def x64():
    """The test runs in float64."""
    with jax.enable_x64(True):
        yield
