"""The memory of a controller that observes more than the robot: where the expected run is, say."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.automata.classifier import array_library
from coachable.automata.tracker import Memory, Tracker
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import BoundForm, Step, form_from_data


class Remembered(NamedTuple):
    """What a controller remembers from one sample to the next, in any batch shape."""

    phase: Memory
    """Where the robot is."""
    form: tuple
    """What the reward form remembers."""


@dataclass(frozen=True)
class ControllerMemory:
    """How a memory begins, goes on from sample to sample, and is observed, in any array library.

    It is the memory that the reward had in training, without what only pays: how long stays in phases
    lasted is left out where the form does not ask for it. So it comes again where the gait does.
    """

    tracker: Tracker
    form: BoundForm

    @staticmethod
    def of(controller: object) -> ControllerMemory | None:
        """The memory of what a controller observes, `None` for a state feedback."""
        described = getattr(controller, "memory", "")
        return ControllerMemory.from_json(described) if described else None

    @staticmethod
    def from_json(description: str) -> ControllerMemory:
        """The inverse of `memory_data`, as JSON."""
        return _described(description)

    @property
    def signal_names(self) -> tuple[str, ...]:
        """The signals that it goes by, in their order."""
        return self.tracker.classifier.signals

    def begun(self, signals: Float[Any, "*batch num_signals"]) -> Remembered:
        """The memory of a walk that begins with these signals."""
        phase = self.tracker.start(signals)
        return Remembered(phase, self.form.init(phase.location, _zero(signals)))

    def after(
        self,
        remembered: Remembered,
        signals: Float[Any, "*batch num_signals"],
        elapsed: Float[Any, "..."] | float,
    ) -> Remembered:
        """The memory after one more sample, taken so many seconds after the last one."""
        phase, move = self.tracker.advance(remembered.phase, signals, elapsed)
        form, _ = self.form.pay(remembered.form, Step(move, elapsed, False, _zero(signals)))
        return Remembered(phase, form)

    def shown(
        self, remembered: Remembered, signals: Float[Any, "*batch num_signals"]
    ) -> Float[Any, "*batch numbers"]:
        """The numbers that the controller observes of it, behind its observation of the robot."""
        zero = _zero(signals)
        return array_library(zero).stack(
            self.form.observe(remembered.form, remembered.phase.location, zero), axis=-1
        )

    def expected(self, remembered: Remembered) -> Int[Any, "*batch"]:
        """The phase 0 … K−1 that is expected now, or K if none: by it policies are mirrored."""
        return self.form.expected(remembered.form, remembered.phase.location)

    def numbers(self, remembered: Remembered, like: Float[Any, "..."]) -> Float[Any, "*batch memory"]:
        """All that is remembered as a row of numbers, in the library and dtype of `like`."""
        xp = array_library(like)
        leaves = [xp.astype(xp.asarray(leaf), like.dtype) for leaf in jax.tree.leaves(remembered)]
        return xp.stack(leaves, axis=-1)

    def recalled(self, numbers: Float[Any, "*batch memory"]) -> Remembered:
        """The inverse of `numbers`: what is whole or true or false is rounded to it."""
        xp = array_library(numbers)
        leaves, structure = self._kinds
        columns = [numbers[..., k] for k in range(len(leaves))]
        given = [
            column if kind == "f" else column > 0.5 if kind == "b" else xp.astype(xp.round(column), xp.int32)
            for column, kind in zip(columns, leaves, strict=True)
        ]
        return jax.tree.unflatten(structure, given)

    @property
    def real(self) -> Bool[np.ndarray, " memory"]:
        """Which of the numbers are real; the others are phases, or true or false."""
        return np.array([kind == "f" for kind in self._kinds[0]])

    @cached_property
    def _kinds(self) -> tuple[list[str], Any]:
        remembered = self.begun(np.zeros(len(self.signal_names)))
        leaves, structure = jax.tree.flatten(remembered)
        return [np.asarray(leaf).dtype.kind for leaf in leaves], structure


def memory_data(reward: DescribedReward) -> dict[str, Any]:
    """A controller's memory as plain data, for its description: `behaviour`, `reward_variant`, `dt`."""
    return {
        "behaviour": to_text(reward.behaviour),
        "reward_variant": reward.bound_form.form.to_data(),
        "dt": reward.dt,
    }


@lru_cache
def _described(description: str) -> ControllerMemory:
    data = json.loads(description)
    behaviour = parse(data["behaviour"])
    form = form_from_data(data["reward_variant"])
    # Without dt it is a plant's, which the file did not need to say before there were others.
    bound = form.bind(behaviour, data.get("dt", 0.01))
    tracker = Tracker.of(behaviour, form.flicker)
    asks = bound.judges_dwells and bound.init(np.array(0), np.array(0.0)) != ()
    return ControllerMemory(
        tracker if asks else replace(tracker, dwells=(None,) * len(tracker.dwells)), bound
    )


def _zero(signals: Float[Any, "*batch num_signals"]) -> Float[Any, "*batch"]:
    return array_library(signals).zeros_like(signals[..., 0])
