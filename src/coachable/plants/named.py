"""Plants by name, and their parameters from a table of numbers, as a plan gives them."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeGuard

from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.plant import Plant


def plant_names() -> list[str]:
    """Names of the plants that come with the package: the packages inside `coachable.plants`."""
    package = importlib.import_module("coachable.plants")
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__) if module.ispkg)


def plant_class(name: str) -> type[Plant]:
    """The class of a plant: `"compass"` for one that comes with the package, or `"package.module:Class"`.

    The package `coachable.plants.NAME` exports its plant's class as `PLANT`.

    **Raises:** `ParameterError` if there is none, with the nearest name.
    """
    module_name, colon, attribute = name.partition(":")
    if not colon:
        if name not in plant_names():
            hint = suggestion(name, plant_names())
            raise ParameterError(f"unknown plant {name!r}; {hint} — or give 'package.module:Class'.")
        return importlib.import_module(f"coachable.plants.{name}").PLANT
    try:
        module = importlib.import_module(module_name)
    except (ImportError, ValueError) as error:
        raise ParameterError(
            f"plant {name!r}: the module {module_name!r} cannot be imported: {error}"
        ) from None
    found = getattr(module, attribute, None)
    if not _is_plant(found):
        hint = suggestion(attribute, [key for key, value in vars(module).items() if _is_plant(value)])
        raise ParameterError(f"plant {name!r}: {module_name!r} has no plant class {attribute!r}; {hint}")
    return found


def _is_plant(value: Any) -> TypeGuard[type[Plant]]:
    return isinstance(value, type) and issubclass(value, Plant) and value is not Plant


def parameters_type(plant: type[Plant]) -> type[Any]:
    """The dataclass of a plant's parameters: the type of the default of its field `parameters`."""
    return type(plant.parameters)


def parameters_from(plant: type[Plant], numbers: Mapping[str, Any]) -> Any:
    """The parameters of a plant from a table of numbers; those that are not in it have their defaults.

    **Raises:** `ParameterError` for an unknown name, with the nearest, and what the dataclass raises.
    """
    kind = parameters_type(plant)
    known = [field.name for field in fields(kind)]
    for name in numbers:
        if name not in known:
            raise ParameterError(f"{plant.name} has no parameter {name!r}; {suggestion(name, known)}")
    return kind(**numbers)


def name_of(plant: type[Plant]) -> str:
    """The name by which `plant_class` finds a plant's class."""
    for name in plant_names():
        if plant_class(name) is plant:
            return name
    return f"{plant.__module__}:{plant.__qualname__}"


def make_plant(plant: Plant | str, parameters: Any = None) -> Plant:
    """A plant as it is, or the one of a name, with parameters if they are given.

    **Raises:** `ParameterError` for an unknown name and for parameters of another plant.
    """
    kind = plant_class(plant) if isinstance(plant, str) else type(plant)
    if parameters is None:
        return kind() if isinstance(plant, str) else plant
    if not isinstance(parameters, parameters_type(kind)):
        wanted = parameters_type(kind).__name__
        raise ParameterError(
            f"{kind.name} has parameters of the type {wanted}, not {type(parameters).__name__}"
        )
    return kind(parameters) if isinstance(plant, str) else replace(plant, parameters=parameters)
