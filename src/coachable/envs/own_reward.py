"""What an environment pays by itself, reported beside what its lane is paid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium

from coachable.foundation.errors import ParameterError

OWN = "environment"
"""The key of an info under which the environment's own reward stands."""


class OwnReward(gymnasium.Wrapper):
    """Reports the environment's own reward in the info, and may pay other weights of its terms.

    **Arguments:** `terms`, weights of numbers in the environment's info; if given, the reward is their
    weighted sum in place of the environment's own.

    **Raises:** from `step`, `ParameterError` for a term that the info does not have.
    """

    def __init__(self, env: gymnasium.Env, terms: Mapping[str, float]):
        super().__init__(env)
        self._terms = terms

    def step(self, action: Any) -> Any:
        """One step; its info has the environment's own reward under `OWN`."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        own = float(reward)
        if self._terms:
            if missing := [name for name in self._terms if name not in info]:
                raise ParameterError(f"the environment's info has no term {missing[0]!r}; it has {[*info]}")
            reward = sum(weight * float(info[name]) for name, weight in self._terms.items())
        return observation, reward, terminated, truncated, {**info, OWN: own}
