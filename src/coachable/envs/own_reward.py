"""What an environment pays by itself, reported beside what its lane is paid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from coachable.envs.signals.pack import environment_name
from coachable.envs.signals.reading import after, require_info, reward_number
from coachable.foundation.errors import CoachableError, ParameterError, SignalError

OWN = "environment"
"""The key of an info under which the environment's own reward stands."""

ALIVE = "alive"
"""The term that any environment has: 1 for a step, 0 for one that terminates the episode."""


class OwnReward(gymnasium.Wrapper):
    """Reports the environment's own reward in the info, and may pay other weights of its terms.

    **Arguments:** `terms`, weights of numbers in the environment's info, or of `alive`; if given, the reward
    is their weighted sum in place of the environment's own.

    **Raises:** from `reset` and `step`, `SignalError` with the environment's name and the step for whatever
    the environment raises, an info that is no dict, an observation with NaN, and a reward that is no finite
    number; from `step`, `ParameterError` for a term that the info does not have.
    """

    def __init__(self, env: gymnasium.Env, terms: Mapping[str, float]):
        super().__init__(env)
        self._terms = terms
        self._steps = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode."""
        self._steps = 0
        try:
            observation, info = self.env.reset(seed=seed, options=options)
        except Exception as error:
            raise self._failed("reset", error) from error
        require_info(info, self.env, 0)
        self._require_numbers(observation)
        return observation, info

    def step(self, action: Any) -> Any:
        """One step; its info has the environment's own reward under `OWN`."""
        try:
            observation, reward, terminated, truncated, info = self.env.step(action)
        except Exception as error:
            raise self._failed(f"step {self._steps + 1}", error) from error
        reward, info = self.paid(observation, reward, terminated, info)
        return observation, reward, terminated, truncated, info

    def paid(
        self, observation: Any, reward: Any, terminated: bool, info: dict[str, Any]
    ) -> tuple[float, dict[str, Any]]:
        """What a step of the environment is paid, and its info.

        **Arguments:** what the environment says of its step, which is the next one of the episode.
        """
        self._steps += 1
        require_info(info, self.env, self._steps)
        self._require_numbers(observation)
        reward = own = reward_number(reward, self.env, self._steps)
        if self._terms:
            reward = sum(weight * self._term(name, terminated, info) for name, weight in self._terms.items())
        return reward, {**info, OWN: own}

    def _term(self, name: str, terminated: bool, info: Mapping[str, Any]) -> float:
        if name in info:
            return reward_number(info[name], self.env, self._steps, name)
        if name == ALIVE:
            return float(not terminated)
        raise ParameterError(
            f"the environment's info has no term {name!r}; there are {ALIVE!r} and {[*info]}"
        )

    def _require_numbers(self, observation: Any) -> None:
        if not isinstance(observation, np.ndarray) or observation.dtype.kind != "f":
            return
        # A sum of squares is NaN just where one of them is, and quicker to have for a row of numbers.
        is_row = observation.ndim == 1
        if np.isnan(observation.dot(observation)) if is_row else np.isnan(observation).any():
            raise SignalError(
                f"the observation of {environment_name(self.env)} has NaN {after(self._steps)}: {observation}"
            )

    def _failed(self, where: str, error: Exception) -> CoachableError:
        if isinstance(error, CoachableError):
            return error
        name, kind = environment_name(self.env), type(error).__name__
        return SignalError(f"the environment {name} fails in {where} with {kind}: {error}")
