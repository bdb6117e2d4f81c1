"""Controllers for any plant that are written down, not learned, and the settings that they describe."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion


class ConstantTorque(eqx.Module):
    """Hold the same control u, whatever the state.

    **Raises:** `ParameterError` for a control that is not finite.
    """

    torque: tuple[float, ...] = eqx.field(static=True)

    def __check_init__(self) -> None:
        for number in self.torque:
            real_number(number, "torque", ParameterError)

    def __call__(self, x: Float[Array, " state"]) -> Float[Array, " control"]:
        """Return the control."""
        return jnp.asarray(self.torque, x.dtype)


class NoTorque(eqx.Module):
    """Apply no control."""

    size: int = eqx.field(static=True)
    """How many controls the plant has."""

    def __call__(self, x: Float[Array, " state"]) -> Float[Array, " control"]:
        """Return zeros."""
        return jnp.zeros((self.size,), x.dtype)


def settings_of(controller: Any) -> dict[str, float | tuple[float, ...]]:
    """The numbers that a controller can be given other values of, by name.

    They are its static fields that hold a float or a tuple of floats.
    """
    if not is_dataclass(controller):
        return {}
    values = {
        field.name: getattr(controller, field.name)
        for field in fields(controller)
        if field.metadata.get("static", False)
    }
    return {
        name: value
        for name, value in values.items()
        if isinstance(value, float)
        or (isinstance(value, tuple) and value and all(isinstance(number, float) for number in value))
    }


def with_settings(controller: Any, numbers: Mapping[str, Sequence[float]]) -> Any:
    """A controller with other values of some of its settings.

    **Arguments:** `numbers`, by the setting's name, one or as many as the setting has.

    **Raises:** `ParameterError` for a setting that the controller does not have, and for too many or too few
    numbers.
    """
    settings, given = settings_of(controller), {}
    for name, values in numbers.items():
        if name not in settings:
            raise ParameterError(
                f"{type(controller).__name__} has no setting {name!r}; {suggestion(name, settings)}"
            )
        before = settings[name]
        count = len(before) if isinstance(before, tuple) else 1
        if len(values) != count:
            raise ParameterError(
                f"{name} of {type(controller).__name__} takes {count} number{'s' * (count > 1)}, "
                f"got {len(values)}"
            )
        given[name] = tuple(map(float, values)) if isinstance(before, tuple) else float(values[0])
    return replace(controller, **given) if given else controller


def description_of(controller: Any) -> str:
    """What a controller does: the first line of its class's docstring; empty without one."""
    return (inspect.getdoc(type(controller)) or "").partition("\n")[0]
