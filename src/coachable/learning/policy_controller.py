"""A policy with what it remembers and its mirror: what runs it from sample to sample, on a robot say."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from coachable.automata.classifier import array_library
from coachable.envs.symmetry.phase_mirror import PhaseMirror
from coachable.foundation.errors import ParameterError
from coachable.learning.policy import Policy
from coachable.rewards.controller_memory import ControllerMemory, Remembered


@dataclass(frozen=True)
class PolicyController:
    """A policy, run from sample to sample without an environment.

        controller = co.PolicyController(run.policy("described", seed=0))
        action, memory = controller.begin(observation, signals)
        action, memory = controller.step(memory, observation, signals, elapsed=0.008)

    It is what evaluations and `watch` do in an environment: the memory of the reward form goes on with the
    signals, the policy observes what the form shows of it, if it was trained so, and while the expected phase
    lies in the mirrored half of the description it gets the mirror image, and its action is mirrored back.
    There is no other state than the memory, so all functions can be compiled and mapped; they take arrays of
    NumPy or JAX for one robot. Any policy is run like this: where it neither remembers nor is mirrored,
    signals are not read.

    **Arguments:** `policy`, of a run or a file.
    """

    policy: Policy

    def begin(
        self,
        observation: Float[Any, " observed"] | Sequence[float],
        signals: Float[Any, " num_signals"] | Sequence[float] = (),
    ) -> tuple[Float[Any, " controls"], Remembered | None]:
        """The action at the first sample, and the memory after it.

        **Arguments:** `observation`, of the robot, without the numbers of the memory; `signals`, what the
        behaviour is written in, in the order of `signal_names` and the behaviour's units.

        **Raises:** `ParameterError` for another number of observed numbers or of signals.
        """
        now = _array(signals)
        for what, given, expected in (
            ("observation", np.shape(observation), self.policy.weights[0].shape[1] - self.num_shown),
            ("signals", now.shape, len(self.signal_names)),
        ):
            # Of a policy that goes by no signals, nobody need leave them out.
            if expected and given != (expected,):
                names = f": {', '.join(self.signal_names)}" if what == "signals" else ""
                raise ParameterError(f"{what} must be {expected} numbers{names}; got shape {given}")
        memory = None if self.memory is None else self.memory.begun(now)
        return self._action(memory, _array(observation), now), memory

    def step(
        self,
        memory: Remembered | None,
        observation: Float[Any, " observed"] | Sequence[float],
        signals: Float[Any, " num_signals"] | Sequence[float] = (),
        elapsed: Float[Any, ""] | float = 0.0,
    ) -> tuple[Float[Any, " controls"], Remembered | None]:
        """The action at a later sample, and the memory after it.

        **Arguments:** `memory`, from the sample before; `observation` and `signals` as in `begin`; `elapsed`,
        the time since the sample before [s].

        **Raises:** `ParameterError` where a memory is needed and `None` is given.
        """
        now = _array(signals)
        if self.memory is not None:
            if memory is None:
                raise ParameterError("there is no memory yet; call begin at the first sample")
            memory = self.memory.after(memory, now, elapsed)
        return self._action(memory, _array(observation), now), memory

    @property
    def signal_names(self) -> tuple[str, ...]:
        """The signals that it goes by, in their order; none for a policy of observations alone."""
        return () if self.memory is None else self.memory.signal_names

    @cached_property
    def memory(self) -> ControllerMemory | None:
        """How the memory goes on; `None` if there is nothing to remember.

        A mirrored policy has one even where it does not observe it.
        """
        if self.mirror is not None:
            return ControllerMemory.from_json(json.dumps(json.loads(self.policy.mirror)["memory"]))
        return ControllerMemory.of(self.policy)

    @cached_property
    def mirror(self) -> PhaseMirror | None:
        """How it is mirrored by phase; `None` if it is not."""
        return PhaseMirror.from_json(self.policy.mirror)

    @property
    def place(self) -> int:
        """Where among the numbers of the robot's observation those of the memory begin: behind them, or where
        the entry of a `Dict` lies that was flattened."""
        size = self.policy.weights[0].shape[1] - self.num_shown
        return json.loads(self.policy.memory or "{}").get("place", size)

    @property
    def num_shown(self) -> int:
        """How many numbers of the memory the policy observes."""
        return len(self.memory.form.observation_names) if self.memory and self.policy.memory else 0

    def seen(
        self,
        memory: Remembered,
        observation: Float[Any, "*batch observed"],
        signals: Float[Any, "*batch num_signals"],
    ) -> tuple[Float[Any, "*batch inputs"], Bool[Any, "*batch"] | None]:
        """What the network is given, and whether it is the mirror image; `None` if it never is.

        **Arguments:** `memory`, after this sample. Arrays are of one library.
        """
        assert self.memory is not None
        xp, seen = array_library(observation), observation
        if self.num_shown:
            place, shown = self.place, self.memory.shown(memory, signals)
            seen = xp.concat([seen[..., :place], shown, seen[..., place:]], axis=-1)
        if self.mirror is None:
            return seen, None
        mirrored = self.mirror.is_mirrored(self.memory.expected(memory))
        return xp.where(mirrored[..., None], self.mirror.observation(seen), seen), mirrored

    def _action(self, memory: Remembered | None, observation: Any, signals: Any) -> Float[Any, " controls"]:
        if memory is None:
            return self.policy(jnp.asarray(observation))
        seen, mirrored = self.seen(memory, observation, signals)
        action = self.policy(jnp.asarray(seen))
        if self.mirror is None or mirrored is None:
            return action
        return array_library(action).where(mirrored, self.mirror.action(action), action)


def _array(numbers: Any) -> Any:
    """Numbers as an array, in NumPy where they are none yet."""
    return numbers if hasattr(numbers, "dtype") else np.asarray(numbers, float)
