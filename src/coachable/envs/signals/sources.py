"""Where a behaviour's signals are found in an environment, as plain data that plans have.

| data | the signal is |
|---|---|
| `3` | column 3 of the observation |
| `"x_velocity"` | that entry of the info |
| `"my_robot:knee"` | what your function `knee` of (environment, observation, info) returns |
| `{observation = ["body", 3]}` | the entry on that path into a nested or `Dict` observation |
| `{info = ["place", "x"]}` | the entry on that path into the info |
| `{info = "x_velocity", at_reset = 0.0}` | likewise, and that number where the info lacks the entry |
| `{info = "speed", at_reset = "start_speed"}` | likewise, and that other entry of the info |

Many infos have an entry after a step and not after a reset; `at_reset` is for these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from coachable.envs.signals.infos import Infos, entry_of
from coachable.envs.signals.pack import SignalPack, signal_pack
from coachable.foundation.data import plain
from coachable.foundation.errors import ParameterError
from coachable.foundation.objects import object_named
from coachable.foundation.suggestion import suggestion

SignalFunction = Callable[[Any, Any, Mapping[str, Any]], Any]
"""From the unwrapped environment, an observation and its info to a number, or to one for each environment."""

Path = tuple[str | int, ...]
"""Keys and numbers of entries, from the outside in."""


@dataclass(frozen=True)
class ObservationEntry:
    """An entry of the observation; in an array, of its last axis, so that it may be a batch."""

    path: Path

    def __call__(self, env: Any, observation: Any, info: Mapping[str, Any]) -> Any:
        """The entry."""
        entry: Any = observation
        for part in self.path:
            entry = entry_of(entry, part, many=False) if isinstance(part, int) else entry[part]
        return entry

    def to_data(self) -> Any:
        """The plain data that stand for it."""
        only = self.path[0] if len(self.path) == 1 else None
        return only if isinstance(only, int) else {"observation": _path_to_data(self.path)}


@dataclass(frozen=True)
class InfoEntry:
    """An entry of the info."""

    path: Path
    at_reset: float | Path | None = None
    """A number or another entry, where the info lacks this one, as many do after a reset."""

    def __call__(self, env: Any, observation: Any, info: Mapping[str, Any]) -> Any:
        """The entry."""
        if self.at_reset is None:
            return _followed(info, self.path)
        if isinstance(info, Infos):
            return info.followed(self.path, self._otherwise(info))
        try:
            return _followed(info, self.path)
        except KeyError:
            return self._otherwise(info)

    def _otherwise(self, info: Mapping[str, Any]) -> Any:
        if not isinstance(self.at_reset, tuple):
            return self.at_reset
        return (
            info.followed(self.at_reset, np.nan)
            if isinstance(info, Infos)
            else _followed(info, self.at_reset)
        )

    def to_data(self) -> Any:
        """The plain data that stand for it."""
        if self.at_reset is None and len(self.path) == 1 and ":" not in str(self.path[0]):
            return self.path[0]
        data: dict[str, Any] = {"info": _path_to_data(self.path)}
        if self.at_reset is not None:
            reset = self.at_reset
            data["at_reset"] = _path_to_data(reset) if isinstance(reset, tuple) else reset
        return data


@dataclass(frozen=True)
class OwnFunction:
    """A function of yours, by the name `module:name`, which is looked up at construction.

    **Raises:** `ParameterError` if there is none of this name.
    """

    name: str
    function: SignalFunction = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        function = object_named(self.name)
        if not callable(function):
            raise ParameterError(f"{self.name!r} must be a function of (env, observation, info)")
        object.__setattr__(self, "function", function)

    def __call__(self, env: Any, observation: Any, info: Mapping[str, Any]) -> Any:
        """What the function returns."""
        return self.function(env, observation, info)

    def to_data(self) -> str:
        """Its name."""
        return self.name


SignalSource = ObservationEntry | InfoEntry | OwnFunction


@dataclass(frozen=True, eq=False)
class SignalSources(Mapping[str, SignalFunction]):
    """Signals by name that have a source of their own, and the pack that the others are read from."""

    sources: Mapping[str, SignalFunction]
    pack: SignalPack | None = None
    """By default the environment's own pack, if it has one."""

    def __reduce__(self):
        # A read-only view of a mapping cannot be sent to another process.
        return SignalSources, (dict(self.sources), self.pack)

    def __getitem__(self, name: str) -> SignalFunction:
        return self.sources[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.sources)

    def __len__(self) -> int:
        return len(self.sources)

    def to_data(self) -> dict[str, Any]:
        """The plain data that `signal_sources` takes, as far as the sources came from data.

        **Raises:** `ParameterError` for a function that was given as such.
        """
        data: dict[str, Any] = {} if self.pack is None else {"pack": self.pack.environment}
        for name, source in self.sources.items():
            if not isinstance(source, SignalSource):
                raise ParameterError(f"signal {name!r} is a function without a name in plans: {source!r}")
            data[name] = source.to_data()
        return data


Signals = Mapping[str, SignalFunction] | SignalPack | None
"""Functions by signals' names (the rest from the environment's pack), a pack, or the environment's pack."""


def signal_sources(data: Mapping[str, Any]) -> SignalSources | None:
    """The signals that a plan's table `signals` describes; `None` for an empty one, that is the pack's.

    **Arguments:** `data`: sources by the signals' names, as in the table above; `pack = "Hopper-v5"` for the
    pack that the other signals are read from, by default the environment's own.

    **Raises:** `ParameterError`, naming the key, for data that are no source, a function that does not exist,
    and an unknown pack.
    """
    if not data:
        return None
    data = plain(data)
    packs = {"pack": data["pack"]} if isinstance(data.get("pack"), str) else {}
    sources = {name: _source(source, f"signals.{name}") for name, source in data.items() if name not in packs}
    return SignalSources(MappingProxyType(sources), signal_pack(packs["pack"]) if packs else None)


def _source(data: Any, key: str) -> SignalSource:
    if isinstance(data, int) and not isinstance(data, bool):
        return ObservationEntry((data,))
    try:
        if isinstance(data, str):
            return OwnFunction(data) if ":" in data else InfoEntry((data,))
        if isinstance(data, Mapping):
            return _from_table(data, key)
    except ParameterError as error:
        raise error if str(error).startswith(key) else ParameterError(f"{key}: {error}") from None
    raise ParameterError(
        f"{key} must be a column of the observation, an entry of the info, module:function or a table, "
        f"got {data!r}"
    )


def _from_table(data: Mapping[str, Any], key: str) -> SignalSource:
    for name in data:
        if name not in ("observation", "info", "at_reset"):
            hint = suggestion(name, ("observation", "info", "at_reset"))
            raise ParameterError(f"{key}: unknown key {name!r}; {hint}")
    if ("observation" in data) == ("info" in data) or ("at_reset" in data and "info" not in data):
        raise ParameterError(f"{key} must have observation, or info and perhaps at_reset, got {dict(data)!r}")
    if "observation" in data:
        return ObservationEntry(_path(data["observation"], f"{key}.observation"))
    reset = data.get("at_reset")
    if isinstance(reset, int | float) and not isinstance(reset, bool):
        return InfoEntry(_path(data["info"], f"{key}.info"), float(reset))
    at_reset = None if reset is None else _path(reset, f"{key}.at_reset")
    return InfoEntry(_path(data["info"], f"{key}.info"), at_reset)


def _path(data: Any, key: str) -> Path:
    parts = data if isinstance(data, list | tuple) else [data]
    if not parts or any(isinstance(part, bool) or not isinstance(part, str | int) for part in parts):
        raise ParameterError(f"{key} must be a key or a list of keys and numbers, got {data!r}")
    return tuple(parts)


def _path_to_data(path: Path) -> Any:
    return path[0] if len(path) == 1 else [*path]


def _followed(value: Any, path: Path) -> Any:
    many = isinstance(value, Infos)
    for part in path:
        value = entry_of(value, part, many) if isinstance(part, int) else value[part]
    return value
