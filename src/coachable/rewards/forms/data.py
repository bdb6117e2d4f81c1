"""Reward forms as plain data, as plans have them: a name, or a table of a name and the form's fields."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from coachable.foundation.errors import ParameterError
from coachable.foundation.objects import object_named
from coachable.foundation.suggestion import suggestion
from coachable.rewards.forms.form import RewardForm
from coachable.rewards.forms.potential import Potential
from coachable.rewards.forms.schedule import Schedule
from coachable.rewards.forms.tables import Equation, Released, Stay

FORMS: Mapping[str, type[RewardForm]] = MappingProxyType(
    {form.name: form for form in (Stay, Equation, Released, Schedule, Potential)}
)
"""The forms that ship, by name."""


def form_of(form: RewardForm | str) -> RewardForm:
    """A form, or the one of this name, with its defaults.

    **Raises:** `ParameterError` as `form_from_data`.
    """
    return form if isinstance(form, RewardForm) else form_from_data(form)


def form_from_data(data: object) -> RewardForm:
    """The form that plain data describe: `"stay"`, or `{"form": "potential", "discount": 0.99}`.

    A form of your own is named `module:Class`.

    **Raises:** `ParameterError` for an unknown form, a key that it does not have or that is missing, and a
    value of the wrong kind, with the key.
    """
    if isinstance(data, Mapping):
        if "form" not in data:
            raise ParameterError(f"form.form is missing; {suggestion('', FORMS)}")
        name, fields = data["form"], {key: value for key, value in data.items() if key != "form"}
    else:
        name, fields = data, {}
    if not isinstance(name, str):
        raise ParameterError(f"form must be a name or a table with a key 'form', got {name!r}")
    kind = _class_named(name)
    known = {each.name: each for each in dataclasses.fields(kind) if each.init}
    hints = get_type_hints(kind)
    for key, value in fields.items():
        if key not in known:
            raise ParameterError(f"form.{key}: {name!r} has no such key; {suggestion(key, known)}")
        _require(value, hints[key], f"form.{key}")
    for key, each in known.items():
        if key not in fields and _has_no_default(each):
            raise ParameterError(f"form.{key} is missing; {name!r} needs it")
    return kind(**fields)


def _class_named(name: str) -> Any:
    if name in FORMS:
        return FORMS[name]
    if ":" not in name:
        raise ParameterError(f"unknown reward form {name!r}; {suggestion(name, FORMS)}, or module:Class")
    kind = object_named(name)
    if not (isinstance(kind, type) and issubclass(kind, RewardForm) and dataclasses.is_dataclass(kind)):
        raise ParameterError(f"form {name!r} must be a dataclass that is a RewardForm, but it is {kind!r}")
    return kind


def _has_no_default(each: dataclasses.Field) -> bool:
    return each.default is dataclasses.MISSING and each.default_factory is dataclasses.MISSING


_WORDS: Mapping[Any, str] = MappingProxyType(
    {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
)


def _require(value: object, hint: Any, key: str) -> None:
    """Raise `ParameterError` for a value that is not of the field's type, as far as plain data are typed."""
    options = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    for option in options:
        if get_origin(option) is Mapping and isinstance(value, Mapping):
            for name, item in value.items():
                _require(item, get_args(option)[1], f"{key}.{name}")
            return
    simple = [option for option in options if option in _WORDS]
    tables = any(get_origin(option) is Mapping for option in options)
    if (not simple and not tables) or type(value) in simple or (float in simple and type(value) is int):
        return
    words = _WORDS[float if float in simple else simple[0]] if simple else "a table"
    raise ParameterError(f"{key} must be {words}, got {value!r}")
