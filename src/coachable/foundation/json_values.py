"""Frozen dataclasses as JSON and back, checked against their annotations."""

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from coachable.foundation.errors import RunFolderError

Value = TypeVar("Value")

_WORDS = {float: "a number", int: "a whole number", str: "text", bool: "true or false"}


def to_json(value: Any, derived: Mapping[type, tuple[str, ...]]) -> Any:
    """A value as JSON has it: NaN is null, a complex number a pair, a dataclass an object.

    Arguments: derived, for each dataclass the properties that are told beside its fields.
    """
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
        return {
            name: to_json(getattr(value, name), derived) for name in (*names, *derived.get(type(value), ()))
        }
    if isinstance(value, Mapping):
        return {key: to_json(item, derived) for key, item in value.items()}
    if isinstance(value, tuple):
        return [to_json(item, derived) for item in value]
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def from_json(kind: type[Value], data: Any, derived: Mapping[type, tuple[str, ...]]) -> Value:
    """The inverse of `to_json`; derived properties are left out.

    A field with a default may be missing, so that older files can be read.

    **Raises:** `RunFolderError` saying where a key is missing or unknown, or a value of another type.
    """
    return _read(kind, data, derived, "")


def _read(kind: Any, data: Any, derived: Mapping[type, tuple[str, ...]], where: str) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return _read_object(kind, data, derived, where)
    if origin in (typing.Union, types.UnionType):
        (inner,) = (argument for argument in arguments if argument is not type(None))
        return None if data is None else _read(inner, data, derived, where)
    if origin is typing.Literal:
        if data not in arguments:
            raise _wrong(where, f"one of {', '.join(map(repr, arguments))}", data)
        return data
    if origin is tuple:
        if not isinstance(data, list):
            raise _wrong(where, "a list", data)
        kinds = arguments[:1] * len(data) if arguments[1:] == (...,) else arguments
        if len(kinds) != len(data):
            raise _wrong(where, f"a list of {len(kinds)}", data)
        return tuple(
            _read(one, item, derived, f"{where}[{i}]")
            for i, (one, item) in enumerate(zip(kinds, data, strict=True))
        )
    if origin is Mapping or (origin is not None and issubclass(origin, Mapping)):
        if not isinstance(data, dict):
            raise _wrong(where, "an object", data)
        return {key: _read(arguments[1], item, derived, f"{where}.{key}") for key, item in data.items()}
    if kind is complex:
        return complex(*_read(tuple[float, float], data, derived, where))
    if kind is float:
        if data is None:
            return math.nan
        if isinstance(data, int | float) and not isinstance(data, bool):
            return float(data)
    elif type(data) is kind:
        return data
    raise _wrong(where, _WORDS[kind], data)


def _read_object(kind: type, data: Any, derived: Mapping[type, tuple[str, ...]], where: str) -> Any:
    if not isinstance(data, dict):
        raise _wrong(where, "an object", data)
    hints = typing.get_type_hints(kind)
    names = [field.name for field in dataclasses.fields(kind)]
    for field in dataclasses.fields(kind):
        if field.name not in data and field.default is dataclasses.MISSING:
            raise RunFolderError(f"{_at(where)}lacks {field.name!r}")
    if unknown := [key for key in data if key not in (*names, *derived.get(kind, ()))]:
        raise RunFolderError(f"{_at(where)}has an unknown key {unknown[0]!r}")
    return kind(
        **{
            name: _read(hints[name], data[name], derived, f"{where}.{name}".strip("."))
            for name in names
            if name in data
        }
    )


def _at(where: str) -> str:
    return f"{where} " if where else "it "


def _wrong(where: str, expected: str, data: Any) -> RunFolderError:
    return RunFolderError(f"{_at(where)}must be {expected}, but it is {str(data)[:60]!r}")
