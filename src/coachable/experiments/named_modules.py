"""The modules that files name as `module:name`, so that reading them imports and runs code."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from coachable.foundation.data import parse_json, parse_toml
from coachable.foundation.errors import PlanError
from coachable.foundation.files import read_text

_NAMES_NO_MODULE = ("name", "behaviour", "env_options")


def modules_named(data: Mapping[str, Any]) -> tuple[str, ...]:
    """The modules that a file's tables name as `module:name`, and that reading it may import."""
    found: dict[str, None] = {}

    def look(value: Any) -> None:
        if isinstance(value, Mapping):
            for each in value.values():
                look(each)
        elif isinstance(value, list | tuple):
            for each in value:
                look(each)
        elif isinstance(value, str) and (module := value.partition(":"))[1] and module[0]:
            found[module[0]] = None  # any name of a file may be a module's

    look({key: value for key, value in data.items() if key not in _NAMES_NO_MODULE})
    return tuple(name for name in found if name.partition(".")[0] != "coachable")


def modules_to_import(name_or_path: str | Path) -> tuple[str, ...]:
    """The modules that a plan's file, a run folder, or a counterexample's file names.

    None for what cannot be read, which is refused where it is used.
    """
    path, plan, named = Path(name_or_path), Path(name_or_path), ()
    if path.is_dir():
        plan = path / "plan.toml"
    elif path.suffix == ".json":
        counterexample = _tables(path, parse_json)
        named = modules_named({"plant": counterexample.get("plant_class")})
        if "environment" not in counterexample:
            return named
        plan = path.resolve().parent.parent / "plan.toml"  # of its run, in which it is simulated anew
    return modules_named(_tables(plan, parse_toml))


def _tables(path: Path, parse: Callable[..., dict[str, Any]]) -> dict[str, Any]:
    try:
        return parse(read_text(path, error=PlanError), str(path), PlanError)
    except PlanError:
        return {}


def require_trusted(
    name_or_path: str | Path, trusted: bool = False, known: Collection[str] = ()
) -> tuple[str, ...]:
    """The modules that would be imported for a plan's file, a run folder, or a counterexample's file.

    **Arguments:** `trusted`, whether it may import whatever it names; `known`, modules that are named
    elsewhere, too.

    **Raises:** `PlanError` for another one from outside of the current folder: importing them runs their
    code.
    """
    modules = tuple(name for name in modules_to_import(name_or_path) if name not in known)
    if modules and not trusted and not Path(name_or_path).resolve().is_relative_to(Path.cwd().resolve()):
        raise PlanError(
            f"{name_or_path} lies outside of the current folder and would run code of yours or of others: it "
            f"names {', '.join(modules)}. Read it, and give --trust if it may import that"
        )
    return modules
