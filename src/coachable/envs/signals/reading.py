"""What a behaviour reads of an environment, checked: each signal a number, and none missing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import gymnasium
import numpy as np
from jaxtyping import Float

from coachable.envs.signals.infos import AbsentEntry, Envs, Info, Infos
from coachable.envs.signals.pack import SIGNAL_PACKS, RowReader, SignalPack, environment_name, signal_pack
from coachable.envs.signals.sources import SignalFunction, Signals, SignalSources
from coachable.foundation.data import shown
from coachable.foundation.errors import ParameterError, SignalError
from coachable.foundation.suggestion import suggestion

OnNaN = Literal["raise", "outside"]


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


@dataclass(frozen=True, eq=False)
class SignalReader:
    """Reads named signals of one environment, each a number; it keeps nothing of the environment."""

    names: tuple[str, ...]
    own: Mapping[str, SignalFunction]
    """The functions of those that have one."""
    others: tuple[str, ...]
    """The names that a pack reads."""
    read_others: RowReader | None
    on_nan: OnNaN

    def __call__(
        self, env: gymnasium.Env, observation: Any, info: Mapping[str, Any], steps: int
    ) -> Sequence[float]:
        """The signals in the order of their names, so many steps after the reset.

        **Raises:** `SignalError`, naming the signal and the step, for a function that fails, what is no
        single number, and for NaN if so wished; an entry that the info lacks is NaN.
        """
        row = () if self.read_others is None else self.read_others(env)
        # A sum with a NaN in it is NaN. Infinities can make it that, too; then each number is looked at.
        if not self.own and (total := sum(row)) == total:
            return row
        values: dict[str, Any] = dict(zip(self.others, row, strict=True))
        absent: dict[str, str] = {}
        info = Info(info)
        for name, function in self.own.items():
            try:
                values[name] = function(env.unwrapped, observation, info)
            except AbsentEntry as error:
                values[name], absent[name] = math.nan, repr(error.args[0])
            except Exception as error:
                raise SignalError(_failed(name, after(steps), error)) from error
        numbers = []
        for name in self.names:
            value = values[name]
            number = value if type(value) is float else float(_array(name, value, (), after(steps)))
            if number != number and self.on_nan == "raise":
                raise SignalError(_is_nan(name, after(steps), absent.get(name, "")))
            numbers.append(number)
        return numbers


def reader_of_one(
    env: gymnasium.Env, names: tuple[str, ...], signals: Signals, on_nan: OnNaN
) -> SignalReader:
    """Reads the named signals of an environment: by functions, and those without one by the pack.

    **Raises:** `ParameterError` if there is no pack, or a signal is neither in it nor in the mapping, nor in
    the environment's model.
    """
    signals = signal_pack(env) if signals is None else signals
    spec = env.unwrapped.spec
    require_signals(names, signals, None if spec is None else spec.id)
    own = {name: signals[name] for name in names if name in signals} if isinstance(signals, Mapping) else {}
    others = tuple(name for name in names if name not in own)
    if not others:
        return SignalReader(names, own, (), None, on_nan)
    pack = signals if isinstance(signals, SignalPack) else _pack_of(signals, env)
    read_others = pack.row_reader(others)
    read_others.look_up(env)
    return SignalReader(names, own, others, read_others, on_nan)


@dataclass(frozen=True, eq=False)
class VectorSignalReader:
    """The same for many environments; a pack reads them one by one."""

    names: tuple[str, ...]
    own: Mapping[str, SignalFunction]
    others: tuple[str, ...]
    read_others: tuple[RowReader, ...]
    """One for each environment."""
    on_nan: OnNaN

    def __call__(
        self,
        env: gymnasium.vector.VectorEnv,
        observations: Any,
        infos: Mapping[str, Any],
        when: str,
        chosen: Envs,
    ) -> Float[np.ndarray, "envs num_signals"]:
        """The signals in columns; what is NaN, or fails, matters where an environment is chosen.

        **Raises:** as `SignalReader`, naming the environments.
        """
        base: Any = env.unwrapped
        values: dict[str, Any] = {}
        absent: dict[str, str] = {}
        if self.read_others:
            rows = [read(one) for read, one in zip(self.read_others, base.envs, strict=True)]
            values.update(zip(self.others, np.array(rows).T, strict=True))
        noticing = Infos(infos, len(chosen))
        for name, function in self.own.items():
            noticing.forget()
            try:
                value, (keys, lacking) = function(base, observations, noticing), noticing.absent()
            except AbsentEntry as error:
                value, keys, lacking = None, repr(error.args[0]), np.ones(len(chosen), bool)
            except Exception as error:
                raise SignalError(_failed(name, when, error)) from error
            if lacking.all():
                value = np.full(len(chosen), math.nan)
            elif lacking.any():
                value = _array(name, value, chosen.shape, when, lacking | ~chosen)
                value = np.where(lacking, math.nan, value)
            values[name], absent[name] = value, keys
        columns = []
        for name in self.names:
            column = _array(name, values[name], chosen.shape, when, ~chosen)
            if self.on_nan == "raise" and (lost := np.isnan(column) & chosen).any():
                where = ", ".join(map(str, np.flatnonzero(lost)))
                raise SignalError(_is_nan(name, f"{when} in environment {where}", absent.get(name, "")))
            columns.append(column)
        return np.stack(columns).T


def reader_of_many(
    env: gymnasium.vector.VectorEnv,
    names: tuple[str, ...],
    signals: Signals,
    on_nan: OnNaN,
    ends_unseen: bool,
) -> VectorSignalReader:
    """The reader for a vector environment.

    **Arguments:** `ends_unseen`, whether episodes begin anew in the step that ends them, so that no one can
    look at the last state in a simulator.

    **Raises:** as `reader_of_one`, and if a pack would have to look where it cannot.
    """
    envs: Sequence[gymnasium.Env] | None = getattr(env.unwrapped, "envs", None)
    own: dict[str, SignalFunction] = {}
    if isinstance(signals, Mapping):
        spec = envs[0].unwrapped.spec if envs else env.unwrapped.spec
        require_signals(names, signals, None if spec is None else spec.id)
        own = {name: signals[name] for name in names if name in signals}
        if len(own) == len(names):
            return VectorSignalReader(names, own, (), (), on_nan)
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
    readers = [reader_of_one(one, names, signals, on_nan) for one in envs]
    rows = tuple(reader.read_others for reader in readers if reader.read_others is not None)
    return VectorSignalReader(names, own, readers[0].others, rows, on_nan)


def _pack_of(signals: Mapping[str, SignalFunction], env: gymnasium.Env) -> SignalPack:
    pack = signals.pack if isinstance(signals, SignalSources) else None
    return pack or signal_pack(env)


def after(steps: int) -> str:
    """So many steps after a reset, in words."""
    return f"after step {steps}" if steps else "after the reset"


def reward_number(reward: Any, env: Any, steps: int, term: str = "") -> float:
    """What an environment pays so many steps after the reset, or a term of that in its info, as a number.

    **Raises:** `SignalError`, naming the environment and the step, for what is no single finite number.
    """
    if isinstance(reward, float) and math.isfinite(reward):  # NumPy's float64 is one
        return float(reward)
    number = _number(reward)
    if number is None or not math.isfinite(number):
        what = f"term {term!r} of the reward" if term else "reward"
        raise SignalError(
            f"the {what} of {environment_name(env)} must be one finite number, "
            f"but {after(steps)} it is {shown(reward)}"
        )
    return number


def reward_numbers(rewards: Any, env: gymnasium.vector.VectorEnv, steps: int) -> Float[np.ndarray, " envs"]:
    """What the environments of a vector environment pay, as they return it.

    **Raises:** as `reward_number`, naming the environments.
    """
    array = np.asarray(rewards)
    if array.dtype.kind not in "biuf" or array.shape != (env.num_envs,):
        raise SignalError(
            f"the rewards of {env} must be {env.num_envs} numbers, one an environment, but "
            f"{after(steps)} they are {shown(rewards)}"
        )
    if not (finite := np.isfinite(array)).all():
        where = ", ".join(map(str, np.flatnonzero(~finite)))
        raise SignalError(
            f"the reward must be a finite number, but {after(steps)} in environment {where} it is "
            f"{array[~finite][0]}: {env}"
        )
    return array


def require_info(info: Any, env: Any, steps: int) -> None:
    """**Raises:** `SignalError`, naming the environment and the step, for an info that is no dict."""
    if type(info) is not dict and not isinstance(info, Mapping):  # the former takes a fifth of the time
        raise SignalError(
            f"the info of {environment_name(env)} must be a dict, but {after(steps)} it is {shown(info)}"
        )


def _is_nan(name: str, when: str, absent: str) -> str:
    if absent:
        return (
            f"signal {name!r} is NaN {when}, for the info has no entry {absent} there; say what it is there "
            '(at_reset in plans), or take on_nan="outside" to count such a state as outside of all phases'
        )
    return (
        f'signal {name!r} is NaN {when}; mend it, or take on_nan="outside" to count such a state as '
        "outside of all phases"
    )


def _failed(name: str, when: str, error: Exception) -> str:
    return f"signal {name!r} cannot be read {when}: its function fails with {type(error).__name__}: {error}"


def _number(value: Any) -> float | None:
    """The one number that a value is; `None` for another. A masked number is NaN."""
    if value is np.ma.masked:
        return math.nan
    try:
        array = np.asarray(value)
        return float(array) if array.shape == () and _is_real(array) else None
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return None


def _is_real(array: np.ndarray) -> bool:
    return array.dtype.kind in "biuf" or (
        array.dtype == object and not any(isinstance(one, str | bytes | complex | None) for one in array.flat)
    )


def _array(
    name: str, value: Any, shape: tuple[int, ...], when: str, ignored: Envs | None = None
) -> np.ndarray:
    """A signal as numbers of this shape, whatever it is in ignored environments."""
    wanted = f"{shape[0]} numbers, one an environment" if shape else "one number"
    if value is np.ma.masked:
        value = math.nan
    if isinstance(value, np.ma.MaskedArray):
        value = np.ma.filled(value.astype(np.float64), math.nan)
    try:
        array = np.asarray(value)
        if array.dtype == object and ignored is not None and array.shape == ignored.shape:
            array = np.where(ignored, 0.0, array)
        real = _is_real(array)
        numbers = array.astype(np.float64) if real else array
    except (TypeError, ValueError, OverflowError, RuntimeError):
        raise SignalError(f"signal {name!r} must be {wanted}, but {when} it is {shown(value)}") from None
    if numbers.shape != shape:
        raise SignalError(f"signal {name!r} must be {wanted}, but {when} its shape is {numbers.shape}")
    if not real:
        raise SignalError(f"signal {name!r} must be {wanted}, but {when} it is {shown(value)}")
    return numbers
