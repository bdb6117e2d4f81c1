"""The return, the length and the end of every episode of an environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import gymnasium


@dataclass
class EndedEpisodes:
    """Episodes that have ended, from all of the environments that keep them here."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    num_steps: int = 0
    """Steps of all environments together."""


class EpisodeLog(gymnasium.Wrapper):
    """Keeps the return, the length and the end of every episode, and sums of numbers in its infos.

    Infos go no further: stable-baselines3 reads none of ours, but copies each of them deeply.

    **Arguments:** `ended`, where they are kept; `sums_of`: from an info to numbers by name, which are
    added up over an episode; `fell_key`, the key of an info that holds whether an episode that terminated
    was a fall, if not all are.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        ended: EndedEpisodes,
        sums_of: Callable[[Mapping[str, Any]], Mapping[str, float]],
        fell_key: str | None = None,
    ):
        super().__init__(env)
        self._fell_key = fell_key
        self._ended = ended
        self._sums_of = sums_of
        self._begin()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode; one that has not ended is dropped."""
        self._begin()
        observation, _ = self.env.reset(seed=seed, options=options)
        return observation, {}

    def step(self, action: Any) -> Any:
        """One step, counted."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.count(reward, terminated, truncated, info)
        return observation, reward, terminated, truncated, {}

    def count(self, reward: Any, terminated: bool, truncated: bool, info: Mapping[str, Any]) -> None:
        """Count a step of the environment."""
        self._ended.num_steps += 1
        self._length += 1
        self._return += float(reward)
        for name, number in self._sums_of(info).items():
            self._sums[name] = self._sums.get(name, 0.0) + number
        if terminated or truncated:
            fell = terminated if self._fell_key is None else info[self._fell_key]
            episode = {"end_step": self._ended.num_steps, "return": self._return, "length": self._length}
            self._ended.rows.append({**episode, "fell": bool(fell), **self._sums})

    def _begin(self) -> None:
        self._return, self._length = 0.0, 0
        self._sums: dict[str, float] = {}
