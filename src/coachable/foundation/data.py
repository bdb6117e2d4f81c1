"""Typed data across the boundary: TOML and JSON become values of declared types, and values become text.

A dataclass is a table (an object in JSON). Kinds are strict: `true` and `"3"` are no numbers and `3.0` is no
whole number, but a whole number is accepted where any number is. NumPy's numbers are numbers, and whole ones
have 64 bits at most; `whole_number` and `real_number` hold them within bounds. In JSON `NaN` is `null` and a
complex number is a pair.
"""

from __future__ import annotations

import dataclasses
import json
import math
import numbers
import tomllib
import types
import typing
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, TypeVar

import tomli_w
from cattrs import BaseValidationError, Converter
from cattrs.cols import homogenous_tuple_structure_factory, mapping_structure_factory
from cattrs.errors import AttributeValidationNote, IterableValidationNote
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, make_hetero_tuple_structure_fn

from coachable.foundation.errors import CoachableError, Raises
from coachable.foundation.suggestion import suggestion

Value = TypeVar("Value")
Derived = Mapping[type, tuple[str, ...]]
"""For a dataclass, the properties that are written after its fields and ignored when it is read."""


def parse_toml(text: str, source: str, error: Raises) -> dict[str, Any]:
    """The tables of a TOML document.

    **Arguments:** `source`, the document's name in messages; `error`, the class to raise.

    **Raises:** `error` if the text is not TOML.
    """
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as failure:
        raise error(f"{source} is not TOML: {failure}") from None


def parse_json(text: str | bytes, source: str, error: Raises) -> dict[str, Any]:
    """The object in a JSON document; bytes are UTF-8.

    **Arguments:** as in `parse_toml`.

    **Raises:** `error` if the text is not a JSON object.
    """
    try:
        data = json.loads(text if isinstance(text, str) else text.decode())
    except (ValueError, RecursionError) as failure:
        raise error(f"{source} is damaged: {failure}") from None
    if not isinstance(data, dict):
        raise error(f"{source} is damaged: it holds no object")
    return data


def toml_text(data: Mapping[str, Any]) -> str:
    """Plain data as a TOML document; `parse_toml` of it gives equal data, with tuples as lists."""
    return tomli_w.dumps(data)


def json_text(data: Any, indent: int | None = 2) -> str:
    """Plain data as a JSON document without the last newline; a number that is not finite becomes `null`."""
    return json.dumps(unstructure(data), indent=indent, ensure_ascii=False, allow_nan=False)


def structure(
    kind: type[Value] | Any,
    data: Any,
    source: str,
    error: Raises,
    key: str = "",
    derived: Derived = types.MappingProxyType({}),
) -> Value:
    """A value of a declared type from plain data, as TOML or JSON give it.

    `kind` is made of dataclasses, `bool`, `int`, `float`, `complex`, `str`, `Literal`, tuples, mappings from
    `str`, unions and `Any`. A field with a default may be missing.

    **Arguments:**

    - `source`: the beginning of messages, such as the file's name.
    - `error`: the class to raise.
    - `key`: where in the source the data lies, such as `setups.mine`; empty for the whole.
    - `derived`: as it was given to `unstructure`.

    **Raises:** `error` naming the source and the key of a value of another kind, a missing key, or an unknown
    one with the nearest that is known; and for a `CoachableError` that a constructor raises.
    """
    converter = _converter(tuple(derived.items()))
    try:
        return converter.structure(data, kind)
    except RecursionError:
        raise error(f"{source}: {key or 'it'} is nested too deeply") from None
    except (_Misfit, BaseValidationError, CoachableError) as failure:
        where, reason = _innermost(failure, key)
        if isinstance(reason, _Misfit):
            raise error(f"{source}: {reason.at(where)}") from None
        if isinstance(reason, CoachableError):
            raise error(f"{source}: {where}{': ' if where else ''}{reason}") from None
        raise


def structure_given(
    kind: type,
    data: Any,
    source: str,
    error: Raises,
    key: str = "",
    without: tuple[str, ...] = (),
) -> dict[str, Any]:
    """The fields of a dataclass that a table gives, by name: for tables that are still to be merged.

    **Arguments:** as in `structure`; `without`, fields that the table must not give.

    **Raises:** as `structure`, but not for a missing key.
    """
    fields = [field.name for field in dataclasses.fields(kind) if field.name not in without]
    try:
        data = plain(data)
    except RecursionError:
        raise error(f"{source}: {key or 'it'} is nested too deeply") from None
    if not isinstance(data, Mapping):
        raise error(f"{source}: {_WrongKind('a table of ' + ', '.join(fields), data).at(key)}")
    for name in data:
        if name not in fields:
            raise error(f"{source}: {_UnknownKey(name, fields).at(key)}")
    hints = typing.get_type_hints(kind)
    return {
        name: structure(hints[name], value, source, error, _join(key, name)) for name, value in data.items()
    }


def unstructure(value: Any, derived: Derived = types.MappingProxyType({})) -> Any:
    """The inverse of `structure`: a value as the plain data that JSON has."""
    return _converter(tuple(derived.items())).unstructure(value)


def whole_number(value: Any, name: str, error: Raises, least: int = 0, most: int = 10**9) -> int:
    """A whole number within bounds, NumPy's among them.

    **Raises:** `error` naming it and its bounds.
    """
    number = _whole(value)
    if number is None:
        raise error(f"{name} must be a whole number, at least {least:,}, got {shown(value)}")
    if number < least:
        raise error(f"{name} must be at least {least:,}, got {shown(value)}")
    if number > most:
        raise error(f"{name} must be at most {most:,}, got {shown(value)}")
    return number


def real_number(
    value: Any,
    name: str,
    error: Raises,
    least: float = -math.inf,
    most: float = math.inf,
    above: float = -math.inf,
) -> float:
    """A finite number within bounds, NumPy's among them.

    **Arguments:** `least` and `most`, which it may be; `above`, which it must exceed.

    **Raises:** `error` naming it and what it must be.
    """
    number = real(value)
    if number is None or not math.isfinite(number):
        raise error(f"{name} must be a finite number, got {shown(value)}")
    if number <= above:
        raise error(
            f"{name} must be greater than {'zero' if above == 0 else f'{above:g}'}, got {shown(value)}"
        )
    if not least <= number <= most:
        raise error(f"{name} must be from {least:g} to {most:g}, got {shown(value)}")
    return number


def real(value: Any) -> float | None:
    """The number, NumPy's among them, if it is one that a float can hold."""
    if not isinstance(value, numbers.Real) or isinstance(value, bool):
        return None
    try:
        return float(value)
    except OverflowError:
        return None


def plain(data: Any) -> Any:
    """Data with Python's own numbers and lists in place of NumPy's, however deep they lie."""
    if hasattr(data, "tolist"):
        return data.tolist()
    if isinstance(data, Mapping):
        return {key: plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return type(data)(map(plain, data)) if type(data) in (list, tuple) else data
    return data


class _Misfit(Exception):
    """Data that does not fit its declared type: what is wrong with it, without its key."""

    def at(self, where: str) -> str:
        """The message for data at this key."""
        return f"{where or 'it'} {self}"


class _WrongKind(_Misfit):
    def __init__(self, expected: str, data: Any):
        self.expected = expected
        super().__init__(f"must be {expected}, got {shown(data)}")


class _MissingKey(_Misfit):
    def __init__(self, name: str):
        super().__init__(f"lacks {name!r}")


class _UnknownKey(_Misfit):
    def __init__(self, name: str, known: list[str]):
        self.name, self.known = name, known

    def at(self, where: str) -> str:
        return f"unknown key {_join(where, str(self.name))!r}; {suggestion(str(self.name), self.known)}"


def _innermost(failure: Exception, where: str) -> tuple[str, Exception]:
    """The first of the failures in a group of groups, and the key at which it happened."""
    while isinstance(failure, BaseValidationError):
        failure = failure.exceptions[0]
        for note in getattr(failure, "__notes__", ()):
            if isinstance(note, AttributeValidationNote):
                where = _join(where, note.name)
            elif isinstance(note, IterableValidationNote):
                index = note.index
                where = f"{where}[{index}]" if isinstance(index, int) else _join(where, index)
    return where, failure


def _join(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name


@cache
def _converter(derived: tuple[tuple[type, tuple[str, ...]], ...]) -> Converter:
    properties = dict(derived)
    converter = Converter(detailed_validation=True, unstruct_collection_overrides={tuple: list})
    for kind in (bool, str):
        converter.register_structure_hook(kind, _same)
    converter.register_structure_hook(int, _integer)
    converter.register_structure_hook(float, _number)
    converter.register_structure_hook(
        complex, lambda data, _: complex(*converter.structure(data, tuple[float, float]))
    )
    converter.register_structure_hook_func(_is(typing.Literal), _choice)
    converter.register_structure_hook_factory(_is(tuple), _tuple_reader)
    converter.register_structure_hook_factory(_is(Mapping, dict), _mapping_reader)
    converter.register_structure_hook_factory(_is(typing.Union, types.UnionType), _union_reader)

    @converter.register_structure_hook_factory(_is_dataclass)
    def dataclass_reader(kind: type, converter: Converter) -> Callable[[Any, Any], Any]:
        return _dataclass_reader(kind, converter, properties.get(kind, ()))

    @converter.register_unstructure_hook_factory(_is_dataclass)
    def dataclass_writer(kind: type, converter: Converter) -> Callable[[Any], dict[str, Any]]:
        fields = make_dict_unstructure_fn(kind, converter)
        names = properties.get(kind, ())
        return lambda value: fields(value) | {n: converter.unstructure(getattr(value, n)) for n in names}

    converter.register_unstructure_hook(float, lambda value: value if math.isfinite(value) else None)
    converter.register_unstructure_hook(complex, lambda value: [value.real, value.imag])
    return converter


_WORDS = {bool: "true or false", float: "a number", int: "a whole number", str: "text"}


def _is(*origins: Any) -> Callable[[Any], bool]:
    return lambda kind: typing.get_origin(kind) in origins


def _is_dataclass(kind: Any) -> bool:
    return isinstance(kind, type) and dataclasses.is_dataclass(kind)


def _same(data: Any, kind: type) -> Any:
    if type(data) is not kind:
        raise _WrongKind(_WORDS[kind], data)
    return data


def _number(data: Any, kind: type) -> float:
    if data is None:
        return math.nan
    if (number := real(data)) is None:
        raise _WrongKind(_WORDS[kind], data)
    return number


def _integer(data: Any, kind: type) -> int:
    if (number := _whole(data)) is None:
        raise _WrongKind(_WORDS[kind], data)
    if not -(2**63) <= number < 2**63:
        raise _WrongKind(f"{_WORDS[kind]} of 64 bits", data)
    return number


def _whole(value: Any) -> int | None:
    """The number, if it is one of a whole kind; `True` is none."""
    return int(value) if isinstance(value, numbers.Integral) and not isinstance(value, bool) else None


def shown(value: Any) -> str:
    """A value as it stands in a message, shortened."""
    if isinstance(value, int) and value.bit_length() > 256:
        return f"one of some {round(value.bit_length() * math.log10(2)):,} digits"
    try:
        shown = repr(value)
    except (ValueError, RecursionError):  # huge numbers in a list, or lists in lists
        return f"a {type(value).__name__} too large to show"
    return shown if len(shown) < 80 else f"{shown[:77]}…"


def _choice(data: Any, kind: Any) -> Any:
    choices = typing.get_args(kind)
    if not any(type(data) is type(choice) and data == choice for choice in choices):
        raise _WrongKind(f"one of {', '.join(map(repr, choices))}", data)
    return data


def _table(data: Any) -> Mapping:
    if not isinstance(data, Mapping):
        raise _WrongKind("a table", data)
    return data


def _mapping_reader(kind: Any, converter: Converter) -> Callable[[Any, Any], Any]:
    inner = mapping_structure_factory(kind, converter)
    return lambda data, _: inner(_table(data), kind)


def _tuple_reader(kind: Any, converter: Converter) -> Callable[[Any, Any], Any]:
    members = typing.get_args(kind)
    any_length = members[1:] == (...,)
    if any_length:
        expected, inner = "a list", homogenous_tuple_structure_factory(kind, converter)
    else:
        expected, inner = f"a list of {len(members)}", make_hetero_tuple_structure_fn(kind, converter)

    def read(data: Any, _: Any) -> Any:
        if not isinstance(data, list | tuple) or not (any_length or len(data) == len(members)):
            raise _WrongKind(expected, data)
        return inner(data, kind)

    return read


def _union_reader(kind: Any, converter: Converter) -> Callable[[Any, Any], Any]:
    members = [member for member in typing.get_args(kind) if member is not type(None)]
    optional = len(members) < len(typing.get_args(kind))
    hooks = [(member, converter.get_structure_hook(member)) for member in members]

    def read(data: Any, _: Any) -> Any:
        if optional and data is None:
            return None
        failures = []
        for member, hook in hooks:
            try:
                return hook(data, member)
            except (_Misfit, BaseValidationError) as failure:
                failures.append(failure)
        # What is wrong inside a member of the right kind explains more than that the others do not fit.
        for failure in failures:
            if not isinstance(failure, _WrongKind):
                raise failure
        expected = dict.fromkeys(failure.expected for failure in failures)
        if _WORDS[float] in expected:
            expected.pop(_WORDS[int], None)
        raise _WrongKind(" or ".join(expected), data)

    return read


def _dataclass_reader(
    kind: type, converter: Converter, ignored: tuple[str, ...]
) -> Callable[[Any, Any], Any]:
    inner = make_dict_structure_fn(kind, converter)
    fields = [field for field in dataclasses.fields(kind) if field.init]
    names = [field.name for field in fields]
    missing = dataclasses.MISSING
    required = [f.name for f in fields if f.default is missing and f.default_factory is missing]

    def read(data: Any, _: Any) -> Any:
        table = {name: value for name, value in _table(data).items() if name not in ignored}
        for name in table:
            if name not in names:
                raise _UnknownKey(name, names)
        for name in required:
            if name not in table:
                raise _MissingKey(name)
        return inner(table, kind)

    return read
