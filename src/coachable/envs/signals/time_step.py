"""How long a step of an environment lasts, by one rule for one environment and for many."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import gymnasium
import numpy as np

from coachable.envs.signals.pack import environment_name
from coachable.foundation.errors import ParameterError

_REAL = int | float | np.integer | np.floating


def time_step(env: Any) -> float | None:
    """The time between two steps [s] that an environment gives: its `dt`, or the time of a picture.

    A `dt` of a wrapper comes before that of what it is around. Where it is no number, or not before the first
    reset, the time is not known: that of a picture does not take its place. Of a vector environment that has
    no `dt`, the environments are asked; where they are in other processes, one more is made by the same
    function, asked and closed.

    **Raises:** `ParameterError`, with the candidates, if the environments of a vector environment differ.
    """
    own = _own_dt(env)
    if own is not None:
        return own[1]
    base = env.unwrapped
    if envs := getattr(base, "envs", None):
        return _agreed({time_step(one) for one in envs}, env)
    if isinstance(base, gymnasium.vector.AsyncVectorEnv):
        with closing(base.env_fns[0]()) as one:
            return time_step(one)
    pictures = (base.metadata or {}).get("render_fps")
    return 1 / float(pictures) if isinstance(pictures, _REAL) and pictures > 0 else None


@contextmanager
def one_step_counted(env: Any, dt: float | None) -> Iterator[None]:
    """Around a step of an environment whose `dt` nobody gave: a wrapper may take several for it.

    **Raises:** after the step, `ParameterError` with both candidates if it took several.
    """
    inner = _inner(env)
    if inner is None or dt is None:
        yield
        return
    step, count = inner.step, 0

    def counted(action: Any) -> Any:
        nonlocal count
        count += 1
        return step(action)

    own = vars(inner).get("step")
    inner.step = counted
    try:
        yield
    finally:
        if own is None:
            del inner.step
        else:
            inner.step = own
    if count > 1:
        raise repeated(inner, dt, count)


def require_single_steps(env: Any, dt: float | None) -> None:
    """The same for environments in other processes, tried with one more of them."""
    base = env.unwrapped
    if dt is None or not isinstance(base, gymnasium.vector.AsyncVectorEnv):
        return
    with closing(base.env_fns[0]()) as one:
        if _inner(one) is None:
            return
        one.reset(seed=0)
        with one_step_counted(one, dt):
            one.step(one.action_space.sample())


def repeated(env: Any, dt: float, count: int) -> ParameterError:
    """The error for a step that is several of the environment's own."""
    return ParameterError(
        f"a step takes {count} steps of {environment_name(env)}, whose dt is {dt:g} s: does it "
        f"last {dt:g} s or {count * dt:g} s? Give dt={dt:g} or dt={count * dt:g}"
    )


def _own_dt(env: Any) -> tuple[Any, float | None] | None:
    """The outermost layer that has a `dt`, and that; `None` in its place where it is no time."""
    for layer in _layers(env):
        try:
            if hasattr(layer, "dt") or hasattr(type(layer), "dt"):
                return layer, _time(layer.dt)
        except Exception:
            return layer, None
    return None


def _time(dt: Any) -> float | None:
    """The positive number that it is, be it in an array of no dimensions."""
    array = np.asarray(dt)
    if array.shape != () or array.dtype.kind not in "iuf":
        return None
    return float(array) if 0 < array < math.inf else None


def _inner(env: Any) -> Any:
    """The environment whose own steps last `dt`, if there are wrappers around it."""
    if envs := getattr(env.unwrapped, "envs", None):
        env = envs[0]
    found = _own_dt(env)
    inner = env.unwrapped if found is None else found[0]
    return None if inner is env or not hasattr(inner, "__dict__") else inner


def _layers(env: Any) -> Iterator[Any]:
    while env is not None:
        yield env
        env = vars(env).get("env") if isinstance(env, _WRAPPERS) else None


_WRAPPERS = (gymnasium.Wrapper, gymnasium.vector.VectorWrapper)


def _agreed(steps: set[float | None], env: Any) -> float | None:
    if len(steps) > 1:
        found = " and ".join("unknown" if dt is None else f"{dt:g} s" for dt in sorted(steps, key=str))
        raise ParameterError(f"the environments of {env} differ in how long a step lasts: {found}; give dt")
    return next(iter(steps))
