"""What every test runs under: checked shapes and types, float64 on request, no window, reproducible examples.

jaxtyping's import hook is switched on by `--jaxtyping-packages` in pyproject.toml, so the annotations of
`coachable` are checked with beartype here and cost users nothing.
"""

import ast
import os
from pathlib import Path

import hypothesis
import pytest
from jaxtyping import _import_hook

os.environ["MPLBACKEND"] = "Agg"  # before anything imports matplotlib
# Torch's threads spin while they wait, and would take the cores from the tests that run beside them.
os.environ["OMP_NUM_THREADS"] = "1"
# Compiling is most of the time that tests take, and takes half as long without these. `XLA_FLAGS= make test`
# tests the programs as users have them compiled.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_use_fusion_emitters=false")

import jax

jax.config.update("jax_numpy_rank_promotion", "raise")


class ShapesOfNamedFunctions(_import_hook.JaxtypingTransformer):
    """Checks where there are shapes, in modules that import jaxtyping; the other ones are pyright's.

    Functions within functions are left alone, too: wrapped anew at each call of the outer one, they took most
    of the time of whatever folds a syntax tree.
    """

    def visit_Module(self, node):
        imported = {statement.module for statement in node.body if isinstance(statement, ast.ImportFrom)}
        return super().visit_Module(node) if "jaxtyping" in imported else node

    def visit_FunctionDef(self, node):
        if any(isinstance(parent, ast.FunctionDef) for parent in self._parents):
            return node
        return super().visit_FunctionDef(node)


_import_hook.JaxtypingTransformer = ShapesOfNamedFunctions


def pytest_configure(config):
    """Programs stay compiled between runs, for every worker and every process that a test starts.

    The folder is the one that training uses. Its size is bounded because JAX locks only such a folder.
    """
    os.environ["XDG_CACHE_HOME"] = str(config.cache.mkdir("programs"))
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(Path(os.environ["XDG_CACHE_HOME"], "coachable", "jax"))
    os.environ["JAX_COMPILATION_CACHE_MAX_SIZE"] = str(2**30)
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.2"
    jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
    jax.config.update("jax_compilation_cache_max_size", 2**30)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)


# Half of what is usual, and always the same; `make test ARGS='--hypothesis-profile=thorough'` takes more.
hypothesis.settings.register_profile("coachable", deadline=None, derandomize=True, max_examples=50)
hypothesis.settings.register_profile("thorough", deadline=None, max_examples=500)
hypothesis.settings.load_profile("coachable")


@pytest.fixture(scope="module", autouse=True)
def forgotten_programs():
    """What a module compiled leaves the memory with it; thousands of programs would take gigabytes."""
    yield
    jax.clear_caches()


@pytest.fixture
def x64():
    """The test runs in float64."""
    with jax.enable_x64(True):
        yield
