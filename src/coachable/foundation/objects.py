"""Objects of your own modules, named in plans as `module:name`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion


def object_named(name: str) -> Any:
    """The object that `module:name` stands for; the module is imported.

    **Raises:** `ParameterError` if the module cannot be imported or has no such name.
    """
    module_name, _, attribute = name.partition(":")
    try:
        module = import_module(module_name)
    # Whatever a module raises while it is imported, the name in the plan is where to look.
    except Exception as error:
        raise ParameterError(f"{name!r}: {type(error).__name__}: {error}") from error
    value = module
    for part in attribute.split("."):
        if not hasattr(value, part):
            raise ParameterError(f"{name!r}: {module_name} has no {part!r}; {suggestion(part, vars(value))}")
        value = getattr(value, part)
    return value
