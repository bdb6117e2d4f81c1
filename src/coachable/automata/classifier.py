"""From signals to the phase they are in: predicates as array code, for NumPy, JAX and torch."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, reduce
from operator import and_
from types import ModuleType
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.predicates import Predicate, decision


@dataclass(frozen=True)
class Classifier:
    """𝒪: which phase of a behaviour a state is in, for arrays of NumPy, JAX (traced ones, too) and torch.

    It is an immutable value that can be compared and hashed, so it can be a static field of a module. On
    arrays it runs `decision`, the same function as for plain floats: there is one operator table.
    """

    signals: tuple[str, ...]
    predicates: tuple[Predicate, ...]

    @staticmethod
    def of(behaviour: Behaviour) -> Classifier:
        """The classifier of a behaviour: its signals and its phases, in the behaviour's order."""
        return Classifier(behaviour.signal_names, tuple(phase.predicate for phase in behaviour.phases))

    @property
    def outside(self) -> int:
        """K, the location of a state in none of the K phases."""
        return len(self.predicates)

    def __call__(self, signals: Float[Any, "*batch num_signals"]) -> Int[Any, "*batch"]:
        """𝒪(x) = min {k : μ₂(O_k) holds at x}, or K where none holds (μ₂ of Harnack et al., eqs. 9 to 12).

        **Arguments:** `signals`: the signals in the order of `self.signals`, each in its own unit, along
        the last axis; fastest where each signal's numbers lie side by side.

        **Returns:** locations as `int32`, 0 … K. A state with a NaN in it is outside. Arithmetic is done
        in the dtype of the signals, to which bounds are rounded; division by zero gives infinities
        and NaN without a warning. XLA takes numbers below the smallest normal one for zero, and may round
        a product and a sum only once.

        **Raises:** `ValueError` if the last axis does not have one entry a signal (also while tracing).
        """
        return self.locate(self.by_name(signals))

    def by_name(self, signals: Float[Any, "*batch num_signals"]) -> dict[str, Float[Any, "*batch"]]:
        """The signals apart, by their names; raises as `__call__` does."""
        if signals.shape[-1:] != (len(self.signals),):
            raise ValueError(
                f"signals have shape {tuple(signals.shape)}, but their last axis must hold "
                f"the {len(self.signals)} signals {', '.join(self.signals)}"
            )
        return {name: signals[..., index] for index, name in enumerate(self.signals)}

    def locate(self, values: Mapping[str, Float[Any, "*batch"]]) -> Int[Any, "*batch"]:
        """The same for signals that come by their names, in arrays of one shape, dtype and library."""
        first = values[self.signals[0]]
        xp = array_library(first)
        known = self.known(values)
        location = xp.full_like(first, self.outside, dtype=xp.int32)
        # From the last phase to the first, so that the first one that holds is written last.
        for index, predicate in reversed(list(enumerate(self.predicates))):
            location = xp.where(known & holds_at(predicate, values), index, location)
        return location

    def known(self, values: Mapping[str, Float[Any, "*batch"]]) -> Any:
        """Whether no signal is NaN."""
        return reduce(and_, (values[name] == values[name] for name in self.signals))


def holds_at(predicate: Predicate, values: Mapping[str, Float[Any, "*batch"]]) -> Any:
    """`holds` for arrays of any of the libraries, without warnings."""
    like = next(iter(values.values()))
    xp = array_library(like)
    decide = decision(predicate, _Torch(xp, like)) if xp.__name__ == "torch" else _decision(predicate, xp)
    with np.errstate(all="ignore"):
        return decide(values)


_decision = lru_cache(maxsize=1_000)(decision)


def array_library(array: Any) -> ModuleType:
    """The library that an array belongs to: `numpy`, `jax.numpy` or `torch`.

    Torch is used only for a torch tensor, so it has been imported already.
    """
    if isinstance(array, np.ndarray | np.generic):
        return np
    if any(kind.__module__.partition(".")[0] == "torch" for kind in type(array).__mro__):
        return sys.modules["torch"]
    return array.__array_namespace__()


class _Torch:
    """Torch's functions; its minimum and maximum take no plain numbers, so these are made tensors first."""

    def __init__(self, torch: Any, like: Any):
        self.sin, self.cos, self.abs = torch.sin, torch.cos, torch.abs
        self.minimum = lambda x, y: torch.minimum(*_tensors(x, y, like))
        self.maximum = lambda x, y: torch.maximum(*_tensors(x, y, like))


def _tensors(x: Any, y: Any, like: Any) -> list[Any]:
    return [value if hasattr(value, "dtype") else like.new_tensor(value) for value in (x, y)]
