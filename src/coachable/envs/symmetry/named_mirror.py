"""A robot's mirror image that a plan names, for robots of which it cannot be derived."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from coachable.envs.symmetry.derived import RobotMirror
from coachable.envs.symmetry.signed_permutation import SignedPermutation
from coachable.foundation.errors import ParameterError


@dataclass(frozen=True)
class NamedImage:
    """Which numbers of a row change places in a mirror, and which change their sign; the others stay.

    Places count from 0. Whatever is named like this is its own inverse, as a mirror is.

    **Raises:** at construction `ParameterError` for a place that is negative or there twice, and a sign that
    only one of two numbers that change places has.
    """

    swap: tuple[tuple[int, int], ...] = ()
    """Pairs of places."""
    flip: tuple[int, ...] = ()
    """Places whose number changes its sign; of numbers that change places, both or neither."""

    def __post_init__(self) -> None:
        for key, places in (("swap", [place for pair in self.swap for place in pair]), ("flip", self.flip)):
            for place, count in Counter(places).items():
                if place < 0:
                    raise ParameterError(f"{key}: places count from 0, got {place}")
                if count > 1:
                    raise ParameterError(f"{key}: place {place} is there {count} times; name it once")
        for pair in self.swap:
            for one, other in (pair, pair[::-1]):
                if one in self.flip and other not in self.flip:
                    raise ParameterError(
                        f"flip: {one} changes its sign and {other}, with which it changes places, does not, "
                        "so the image of an image would be another robot; name both or neither"
                    )

    def of(self, size: int, key: str, what: str) -> SignedPermutation:
        """The map of a row of so many numbers.

        **Raises:** `ParameterError`, naming the key, for a place behind the row's end.
        """
        for name, places in (("swap", [place for pair in self.swap for place in pair]), ("flip", self.flip)):
            if beyond := [place for place in places if place >= size]:
                raise ParameterError(
                    f"{key}.{name}: there is no place {beyond[0]}; {what} has {size} numbers, 0 to {size - 1}"
                )
        sources = {place: place for place in range(size)}
        for one, other in self.swap:
            sources[one], sources[other] = other, one
        signs = (-1 if place in self.flip else 1 for place in range(size))
        return SignedPermutation(tuple(sources.values()), tuple(signs))

    def to_data(self) -> dict[str, Any]:
        """The plain data that stand for it."""
        data = {"swap": [[*pair] for pair in self.swap], "flip": [*self.flip]}
        return {key: places for key, places in data.items() if places}


@dataclass(frozen=True)
class NamedMirror:
    """The table `[mirror]` of a plan: what a robot observes and does, in a mirror."""

    observation: NamedImage
    """Of the robot's own row, flattened, without what is remembered."""
    action: NamedImage

    def of(self, size: int, env: gymnasium.Env) -> RobotMirror:
        """The mirror of a robot that observes so many numbers.

        **Raises:** `ParameterError`, naming the key, for a place that the robot does not have, actions that
        are no row of numbers, and an action whose image has other bounds.
        """
        name, space = env.spec.id if env.spec else "the robot", env.action_space
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise ParameterError(f"mirror.action: the actions of {name} are no row of numbers, but {space}")
        observation = self.observation.of(size, "mirror.observation", f"what {name} observes")
        action = self.action.of(space.shape[0], "mirror.action", f"an action of {name}")
        low, high = np.sort([action(space.low), action(space.high)], axis=0) + 0.0  # no −0
        if len(apart := np.flatnonzero((low != space.low) | (high != space.high))):
            place = int(apart[0])
            raise ParameterError(
                f"mirror.action: number {place} of an action lies in [{space.low[place]:g}, "
                f"{space.high[place]:g}], but its image in [{low[place]:g}, {high[place]:g}]; it is another's"
            )
        return RobotMirror(observation, action)

    def to_data(self) -> dict[str, Any]:
        """The plain data that stand for it."""
        return {"observation": self.observation.to_data(), "action": self.action.to_data()}
