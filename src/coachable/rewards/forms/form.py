"""What a reward form is: how a behaviour pays, as a value, and bound to a behaviour as functions."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.classifier import array_library
from coachable.automata.cycle_progress import pairs
from coachable.automata.tracker import Move
from coachable.behaviours.behaviour import Behaviour

OUTSIDE = "outside"
"""What the location outside all phases is called."""


class Step(NamedTuple):
    """One step of a run, as a form sees it."""

    move: Move
    """Where the run was and where it is, and which dwell times the step violates."""
    elapsed: Float[Any, "..."] | float
    """How long the step lasted [s]; 0 where no time is known."""
    terminated: Bool[Any, "*batch"] | bool
    """Whether the step ends the episode for good."""
    zero: Float[Any, "*batch"]
    """Zeros in the shape, dtype and library of the reward."""


class Payment(NamedTuple):
    """What a form pays for a step."""

    terms: dict[str, Float[Any, "*batch"]]
    """Parts of the reward by name; they add up to it."""
    follows: Bool[Any, "*batch"]
    """Whether the step is as the form wants it."""
    info: dict[str, Any] = {}  # noqa: RUF012  nobody changes it
    """What else there is to know about the step, by name: arrays in the shape of the reward."""


class RewardForm(abc.ABC):
    """How a behaviour pays: a value, that is a frozen dataclass whose fields are plain.

    A new form is a subclass of this with a `BoundForm`, and nothing else: the pure functions, the wrappers
    and plans take it as it is.
    """

    name: ClassVar[str] = ""
    """What plans call a form that ships; one of your own is called `module:Class`."""

    @property
    def flicker(self) -> float | None:
        """The absence from a phase through which its time counts on; see `Tracker`. By default 0, none."""
        return 0.0

    @property
    def judges_dwells(self) -> bool:
        """Whether the pay depends on the phases' dwell times, if there are any. By default it does."""
        return True

    @abc.abstractmethod
    def bind(self, behaviour: Behaviour, dt: int | float | None) -> BoundForm:
        """The form for a behaviour.

        **Arguments:** `dt`: the nominal time between two steps [s], if it is known.

        **Raises:** `ParameterError` for a behaviour that cannot be paid like this, or a `dt` that is needed.
        """

    def to_data(self) -> str | dict[str, Any]:
        """The form as plain data: its name, or a table of `form`, the name, and its fields.

        `form_from_data` of them gives an equal form.
        """
        kind = type(self)
        name = kind.name or f"{kind.__module__}:{kind.__qualname__}"
        given: dict[str, Any] = {}
        for each in fields(kind):  # pyright: ignore[reportArgumentType]
            value = getattr(self, each.name)
            if value is not None:
                given[each.name] = dict(value) if isinstance(value, Mapping) else value
        return {"form": name, **given} if given else name

    def paid_by(self, behaviour: Behaviour) -> Mapping[str, object]:
        """What determines the pay, besides predicates and dwell times of the phases, in values that JSON has.

        Equal values pay alike. By default all of the form, and the behaviour's edges and cycles.
        """
        return {
            "form": self.to_data(),
            "edges": pairs(behaviour, behaviour.edges),
            "cycles": [pairs(behaviour, cycle) for cycle in behaviour.cycles],
        }


@dataclass(frozen=True, eq=False)
class BoundForm(abc.ABC):
    """A form bound to a behaviour: functions on arrays of NumPy, JAX or torch, in any batch shape.

    They have no state and branch on no array, so they can be compiled and mapped. What a form remembers is
    a memory of its own: a tuple, perhaps nested, of arrays in the batch shape; `()` if it remembers nothing.
    It depends on locations and times, not on the signals: for one run in plain floats each combination of
    memory and step is computed once and looked up afterwards.
    """

    judges_dwells: ClassVar[bool] = True
    """Whether the pay depends on `too_short` and `too_long` of a move."""

    form: RewardForm
    behaviour: Behaviour
    dt: int | float | None = field(default=None)

    def init(self, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]) -> tuple:
        """The memory of runs that begin at these locations: 0 … K−1, K outside, K+1 if nothing was seen."""
        return ()

    @abc.abstractmethod
    def pay(self, memory: tuple, step: Step) -> tuple[tuple, Payment]:
        """The memory after a step, and what the step pays."""

    @property
    def least_pay(self) -> float | None:
        """What no step pays less than; by default `None`, which says nothing."""
        return None

    def expected(self, memory: tuple, location: Int[Any, "*batch"]) -> Int[Any, "*batch"]:
        """The phase that a run should be in, or K if none; by default the one that it is in."""
        return location

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the numbers that a policy may observe of the run; by default one for each location."""
        return (*self.behaviour.phase_names, OUTSIDE)

    def observe(
        self, memory: tuple, location: Int[Any, "*batch"], zero: Float[Any, "*batch"]
    ) -> tuple[Float[Any, "*batch"], ...]:
        """Those numbers, each in [0, 1]; by default 1 for the location, 0 for the others."""
        where = array_library(zero).where
        return tuple(where(location == k, zero + 1, zero) for k in range(len(self.behaviour.phases) + 1))


def entry(table: np.ndarray, *at: Int[Any, "*batch"], dtype: Any = None) -> Any:
    """The entries of a table at indices, one for each axis, in their library, and in torch on their device.

    **Arguments:** `dtype`: of that library, by default the table's own.
    """
    xp = array_library(at[0])
    if xp is np:
        return (table if dtype is None else table.astype(dtype))[at]
    where = {"device": at[0].device} if xp.__name__ == "torch" else {}
    if xp.__name__ in ("torch", "jax.numpy"):
        return xp.asarray(table, dtype=dtype, **where)[at]
    # Not all that keep the array API standard look up by arrays of indices, but all of them take.
    flat = at[0]
    for size, index in zip(table.shape[1:], at[1:], strict=True):
        flat = flat * size + index
    return xp.take(xp.asarray(table.ravel(), dtype=dtype), xp.astype(flat, xp.int64), axis=0)
