"""Plans as they come from TOML: values of the types they should have, or a word about which one is not.

Every function raises `PlanError` naming the source and the key.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from coachable.foundation.errors import PlanError
from coachable.foundation.suggestion import suggestion


def text_of(path: Path) -> str:
    """The text of a plan's file."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise PlanError(f"{path} cannot be read: {why}") from None


def seeds(value: Any, source: str) -> dict[str, int]:
    """The table `seeds`: `first` and `count`."""
    return table(value, {"first": int, "count": int}, source, "seeds")


def types(kind: type) -> dict[str, type]:
    """The keys a table for this dataclass may have, with the type of each: that of its default."""
    return {field.name: type(field.default) for field in fields(kind) if field.name != "name"}


def table(value: Any, types: Mapping[str, type], source: str, key: str) -> dict[str, Any]:
    """A table whose keys have these types."""
    if not isinstance(value, Mapping):
        raise PlanError(f"{source}: {key} must be a table of {', '.join(types)}, got {value!r}")
    for name in value:
        if name not in types:
            raise PlanError(f"{source}: unknown key {f'{key}.{name}'!r}; {suggestion(name, types)}")
    return {name: typed(item, types[name], source, f"{key}.{name}") for name, item in value.items()}


def typed(value: Any, kind: type, source: str, key: str) -> Any:
    """A value that is of this type; a whole number will do where any number does, a list for a tuple."""
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if kind is tuple and isinstance(value, list | tuple):
        return tuple(value)
    if type(value) is kind:
        return value
    raise PlanError(f"{source}: {key} must be {_WORDS[kind]}, got {value!r}")


_WORDS = {
    bool: "true or false",
    float: "a number",
    int: "a whole number",
    str: "text",
    tuple: "a list",
    dict: "a table",
}
