"""Names of a package that are loaded when they are first used, so that importing the package is quick."""

from collections.abc import Callable, Mapping
from importlib import import_module
from sys import modules
from typing import Any


def lazily(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The `__getattr__` and the `__dir__` of a package, as PEP 562 has them.

    **Arguments:** `package`, its name; `homes`, by name the module inside `coachable` that has it.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"coachable.{homes[name]}"), name)

    def names() -> list[str]:
        return sorted({*vars(modules[package]), *homes})

    return get, names
