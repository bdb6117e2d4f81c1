"""From signals to the phase they are in: predicates as array code."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Array, Float, Int

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.predicates import Predicate, holds


@dataclass(frozen=True)
class Classifier:
    """𝒪: which phase of a behaviour a state is in, for NumPy arrays and for (traced) JAX arrays.

    It is an immutable value that can be compared and hashed, so it can be a static field of a module. The
    code it runs on arrays is `holds`, the very function that decides for plain floats: there is one
    operator table, and nothing to keep in step.
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

    def __call__(
        self, signals: Float[np.ndarray | Array, "*batch num_signals"]
    ) -> Int[np.ndarray | Array, "*batch"]:
        """𝒪(x) = min {k : μ₂(O_k) holds at x}, or K where none holds (μ₂ of Harnack et al., eqs. 9 to 12).

        **Arguments:** `signals`: the signals in the order of `self.signals`, each in its own unit, along
        the last axis.

        **Returns:** locations as `int32`, 0 … K. A state with a NaN in it is outside. Bounds are rounded
        to the dtype of the signals before they are compared; XLA moreover takes numbers below the
        smallest normal one for zero.

        **Raises:** `ValueError` if the last axis does not have one entry a signal (also while tracing).
        """
        if signals.shape[-1:] != (len(self.signals),):
            raise ValueError(
                f"signals have shape {signals.shape}, but their last axis must hold "
                f"the {len(self.signals)} signals {', '.join(self.signals)}"
            )
        xp = np if isinstance(signals, np.ndarray) else signals.__array_namespace__()
        values = {name: signals[..., index] for index, name in enumerate(self.signals)}
        known = ~xp.any(xp.isnan(signals), axis=-1)
        location = xp.full(signals.shape[:-1], self.outside, dtype=xp.int32)
        # From the last phase to the first, so that the first one that holds has the last word.
        for index, predicate in reversed(list(enumerate(self.predicates))):
            location = xp.where(known & holds(predicate, values, xp), xp.int32(index), location)
        return location
