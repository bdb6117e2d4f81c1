"""What a behaviour reads of an environment, checked: each signal a number, and none missing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import gymnasium
import numpy as np
from jaxtyping import Bool, Float

from coachable.envs.signals.pack import SIGNAL_PACKS, SignalPack, signal_pack
from coachable.envs.signals.sources import SignalFunction, Signals, SignalSources
from coachable.foundation.errors import ParameterError, SignalError
from coachable.foundation.suggestion import suggestion

OnNaN = Literal["raise", "outside"]

ReadAll = Callable[[Any, Mapping[str, Any]], Sequence[Any]]
"""From an observation and its info to the signals in a row, in the order in which they were named."""


def require_signals(names: tuple[str, ...], signals: Signals, environment: str | None) -> None:
    """Check that signals can be found before an environment is made.

    **Arguments:** `environment`: its id, by which its pack is known; `module:id` is taken as `id`.

    **Raises:** `ParameterError` for the first of the names that is not there, and if there is no pack.
    """
    if environment is not None:
        environment = environment.rpartition(":")[2]
    if isinstance(signals, Mapping):
        pack = signals.pack if isinstance(signals, SignalSources) else None
        own, pack = signals, pack or SIGNAL_PACKS.get(environment or "")
    else:
        own, pack = {}, signals or signal_pack(environment or "")
    for name in names:
        if name in own:
            if not callable(own[name]):
                raise ParameterError(
                    f"signal {name!r} must be a function of (env, observation, info), but it is {own[name]!r}"
                )
        elif pack is None:
            raise ParameterError(f"signal {name!r} is missing in signals; {suggestion(name, own)}")
        elif name not in (known := [signal.name for signal in pack.signals]):
            also = "" if not own else ", and signals do not have it either"
            raise ParameterError(
                f"{pack.environment} has no signal {name!r}{also}; {suggestion(name, [*own, *known])}"
            )


def reader_of_one(env: gymnasium.Env, names: tuple[str, ...], signals: Signals) -> ReadAll:
    """Reads the named signals of an environment: by functions, and those without one by the pack.

    **Raises:** `ParameterError` if there is no pack, or a signal is neither in it nor in the mapping.
    """
    signals = signal_pack(env) if signals is None else signals
    spec = env.unwrapped.spec
    require_signals(names, signals, None if spec is None else spec.id)
    if isinstance(signals, SignalPack):
        return signals.row_reader(env, names)
    own, others = _parted(names, signals)
    read_own = _by_functions(env, own, signals)
    if not others:
        return read_own
    return _joined(names, own, read_own, others, _pack_of(signals, env).row_reader(env, others))


def reader_of_many(
    env: gymnasium.vector.VectorEnv, names: tuple[str, ...], signals: Signals, ends_unseen: bool
) -> ReadAll:
    """The same for a vector environment; a pack reads its environments one by one.

    **Arguments:** `ends_unseen`, whether episodes begin anew in the step that ends them, so that no one can
    look at the last state in a simulator.

    **Raises:** as `reader_of_one`, and if a pack would have to look where it cannot.
    """
    own, others = _parted(names, signals if isinstance(signals, Mapping) else {})
    envs, read_own = getattr(env.unwrapped, "envs", None), None
    if isinstance(signals, Mapping):
        spec = envs[0].unwrapped.spec if envs else env.unwrapped.spec
        require_signals(names, signals, None if spec is None else spec.id)
        read_own = _by_functions(env, own, signals)
        if not others:
            return read_own
    if envs is None or ends_unseen:
        why = (
            f"{env} does not show its environments"
            if envs is None
            else "in the same-step autoreset mode the last state of an episode is gone"
        )
        raise ParameterError(
            f"a signal pack reads simulators, and {why}; give signals as functions of observations and "
            "infos, or put a BehaviourReward around each environment"
        )
    if isinstance(signals, Mapping):
        readers = [_pack_of(signals, one).row_reader(one, others) for one in envs]
    else:
        readers = [reader_of_one(one, names, signals) for one in envs]

    def read(observations: Any, infos: Mapping[str, Any]) -> list[np.ndarray]:
        return list(np.array([one(None, {}) for one in readers]).T)

    return read if read_own is None else _joined(names, own, read_own, others, read)


def _parted(
    names: tuple[str, ...], signals: Mapping[str, SignalFunction]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names that have a function, and those that have none."""
    return tuple(name for name in names if name in signals), tuple(
        name for name in names if name not in signals
    )


def _pack_of(signals: Mapping[str, SignalFunction], env: gymnasium.Env) -> SignalPack:
    pack = signals.pack if isinstance(signals, SignalSources) else None
    return pack or signal_pack(env)


def _joined(
    names: tuple[str, ...], own: tuple[str, ...], read_own: ReadAll, others: tuple[str, ...], read: ReadAll
) -> ReadAll:
    """Reads some signals in one way and the others in another, in the order of all names."""
    places = [(0, own.index(name)) if name in own else (1, others.index(name)) for name in names]

    def read_both(observation: Any, info: Mapping[str, Any]) -> list[Any]:
        values = read_own(observation, info), read(observation, info)
        return [values[which][place] for which, place in places]

    return read_both


def numbers_of_one(
    names: tuple[str, ...], values: Sequence[Any], on_nan: OnNaN, steps: int
) -> Sequence[float]:
    """The signals as numbers, so many steps after the reset.

    **Raises:** `SignalError`, naming the signal, for what is no single number, and for NaN if so wished.
    """
    for value in values:
        if type(value) is not float or value != value:
            return _checked(names, values, on_nan, f"after step {steps}" if steps else "after the reset")
    return values


def _checked(names: tuple[str, ...], values: Sequence[Any], on_nan: OnNaN, when: str) -> list[float]:
    numbers = []
    for name, value in zip(names, values, strict=True):
        number = float(_array(name, value, (), when))
        if number != number and on_nan == "raise":
            raise SignalError(f"signal {name!r} is NaN {when}; {_ON_NAN}")
        numbers.append(number)
    return numbers


def numbers_of_many(
    names: tuple[str, ...],
    values: Sequence[Any],
    on_nan: OnNaN,
    when: str,
    chosen: Bool[np.ndarray, " envs"],
) -> Float[np.ndarray, "envs num_signals"]:
    """The signals as numbers; NaN matters where an environment is chosen."""
    columns = []
    for name, value in zip(names, values, strict=True):
        column = _array(name, value, chosen.shape, when)
        if on_nan == "raise" and (lost := np.isnan(column) & chosen).any():
            where = ", ".join(map(str, np.flatnonzero(lost)))
            raise SignalError(f"signal {name!r} is NaN {when} in environment {where}; {_ON_NAN}")
        columns.append(column)
    return np.stack(columns).T


def time_step(env: Any) -> float | None:
    """The time between two steps [s] that an environment gives: its `dt`, or the time of a picture."""
    base = env.unwrapped
    dt = getattr(base, "dt", None)
    if isinstance(dt, _REAL) and dt > 0:
        return float(dt)
    if getattr(base, "envs", None):
        return time_step(base.envs[0])
    pictures = (base.metadata or {}).get("render_fps")
    return 1 / float(pictures) if isinstance(pictures, _REAL) and pictures > 0 else None


_REAL = int | float | np.floating

_ON_NAN = 'mend it, or take on_nan="outside" to count such a state as outside of all phases'


def _by_functions(env: Any, names: tuple[str, ...], signals: Mapping[str, SignalFunction]) -> ReadAll:
    functions, base = [signals[name] for name in names], env.unwrapped

    def read(observation: Any, info: Mapping[str, Any]) -> list[Any]:
        values: list[Any] = []
        try:
            for function in functions:
                values.append(function(base, observation, info))
        except Exception as error:
            error.add_note(f"This happened while the signal {names[len(values)]!r} was read.")
            raise
        return values

    return read


def _array(name: str, value: Any, shape: tuple[int, ...], when: str) -> np.ndarray:
    wanted = f"{shape[0]} numbers, one an environment" if shape else "one number"
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise SignalError(f"signal {name!r} must be {wanted}, but {when} it is {value!r}") from None
    if value is None or array.shape != shape:
        raise SignalError(f"signal {name!r} must be {wanted}, but {when} its shape is {array.shape}")
    return array
