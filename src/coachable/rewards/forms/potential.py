"""Potential-based shaping: the form that changes no optimal policy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float, Int

from coachable.automata.classifier import array_library
from coachable.behaviours.behaviour import Behaviour
from coachable.foundation.data import plain, real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.rewards.forms.form import BoundForm, Payment, RewardForm, Step
from coachable.rewards.forms.tables import BoundTable, Stay


@dataclass(frozen=True)
class Potential(RewardForm):
    """γ Φ(phase after) − Φ(phase before), which changes no optimal policy.

    Ng, Harada and Russell, ICML 1999. Φ is 0 after a step that terminates the episode, and is what it is
    after one that truncates it. A step *follows* the behaviour as in the form `Stay`.

    **Arguments:** `discount`, γ of the trainer; `potential`, Φ by the names of phases, 0 for those that are
    left out and outside all phases. By default Φ is how far the phase is along the behaviour's first cycle:
    1/n for the first of its n phases, 1 for the last.

    **Raises:** `ParameterError` for a discount that is not in [0, 1], or a potential that is not finite.
    """

    name: ClassVar[str] = "potential"

    discount: int | float
    potential: Mapping[str, int | float] | None = field(default=None, hash=False)

    def __post_init__(self):
        real_number(self.discount, "discount", ParameterError, least=0.0, most=1.0)
        object.__setattr__(self, "discount", plain(self.discount))
        if self.potential is not None:
            object.__setattr__(self, "potential", MappingProxyType(plain(dict(self.potential))))
            for name, value in self.potential.items():
                real_number(value, f"the potential of phase {name!r}", ParameterError)

    def __reduce__(self):
        # A read-only view of a mapping cannot be sent to another process.
        return Potential, (self.discount, None if self.potential is None else dict(self.potential))

    def bind(self, behaviour: Behaviour, dt: int | float | None) -> BoundPotential:
        """Φ of the behaviour's phases.

        **Raises:** `ParameterError` for a potential of no phase, and a default without a cycle.
        """
        bound = BoundPotential(self, behaviour, dt)
        _ = bound.potential
        return bound

    def paid_by(self, behaviour: Behaviour) -> Mapping[str, object]:
        """γ and Φ."""
        potential = self.bind(behaviour, None).potential.tolist()
        return {"discount": repr(self.discount + 0.0), "potential": [*map(repr, potential)]}


@dataclass(frozen=True, eq=False)
class BoundPotential(BoundForm):
    """Shaping by the potential of a behaviour's phases."""

    form: Potential

    @cached_property
    def potential(self) -> Float[np.ndarray, " locations"]:
        """Φ of the locations 0 … K."""
        names, given = self.behaviour.phase_names, self.form.potential
        if given is None:
            if not self.behaviour.cycles:
                raise ParameterError(
                    f"behaviour {self.behaviour.name!r} has no cycle to make progress along; give the "
                    "potential of its phases"
                )
            cycle = tuple(dict.fromkeys(edge.source for edge in self.behaviour.cycles[0]))
            given = {name: (index + 1) / len(cycle) for index, name in enumerate(cycle)}
        potential = np.zeros(len(names) + 1)
        for name, value in given.items():
            if name not in names:
                raise ParameterError(f"potential of an unknown phase {name!r}; {suggestion(name, names)}")
            potential[names.index(name)] = value
        return potential

    @cached_property
    def _stay(self) -> BoundTable:
        return Stay().bind(self.behaviour, self.dt)

    def pay(self, memory: tuple, step: Step) -> tuple[tuple, Payment]:
        """γ Φ(after) − Φ(before), as the term `shaping`."""
        move, zero = step.move, step.zero
        before, after = (self._at(place, zero) for place in (move.previous, move.location))
        no = move.location != move.location
        after = array_library(zero).where(no | step.terminated, zero, after)
        terms = {"shaping": self.form.discount * after - before}
        return memory, Payment(terms, self._stay.r_or(move) > 0)

    def _at(self, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]) -> Float[Any, "*batch"]:
        xp = array_library(zero)
        return sum(
            (xp.where(location == k, zero + phi, zero) for k, phi in enumerate(self.potential.tolist())),
            zero,
        )


Shaping = Potential
"""The form by its name in the literature: Ng, Harada and Russell, ICML 1999."""
