"""The memory of a controller that observes more than the plant's state: where the expected run is, say."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from coachable.automata.classifier import array_library
from coachable.automata.tracker import Memory, Tracker
from coachable.behaviours.text.parser import parse
from coachable.envs.walking_task import WalkingTask
from coachable.rewards.forms import BoundForm, Step, form_from_data


class Remembered(NamedTuple):
    """What a controller remembers from one sample to the next, in any batch shape."""

    phase: Memory
    """Where the plant is."""
    form: tuple
    """What the reward form remembers."""


@dataclass(frozen=True)
class ControllerMemory:
    """How a memory begins, goes on from sample to sample, and is observed: the same in NumPy and JAX.

    It is the memory that the reward had in training, without what only pays: how long stays in phases
    lasted is left out where the form does not ask for it. So it comes again where the gait does.
    """

    tracker: Tracker
    form: BoundForm

    @staticmethod
    def of(controller: object) -> ControllerMemory | None:
        """The memory of a controller, `None` for a state feedback."""
        described = getattr(controller, "memory", "")
        return _described(described) if described else None

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
        """The numbers that the controller observes of it."""
        zero = _zero(signals)
        return array_library(zero).stack(
            self.form.observe(remembered.form, remembered.phase.location, zero), -1
        )


@lru_cache
def _described(description: str) -> ControllerMemory:
    data = json.loads(description)
    behaviour = parse(data["behaviour"])
    form = form_from_data(data["reward_variant"])
    bound = form.bind(behaviour, WalkingTask.control_dt)
    tracker = Tracker.of(behaviour, form.flicker)
    asks = bound.judges_dwells and bound.init(np.array(0), np.array(0.0)) != ()
    if not asks:
        tracker = replace(tracker, dwells=(None,) * len(tracker.dwells))
    return ControllerMemory(tracker, bound)


def _zero(signals: Float[Any, "*batch num_signals"]) -> Float[Any, "*batch"]:
    return array_library(signals).zeros_like(signals[..., 0])
