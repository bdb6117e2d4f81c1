"""Copies of an environment, stepped side by side by rows of actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from jaxtyping import Bool, Float

from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.episode_log import EpisodeLog
from coachable.envs.own_reward import OwnReward
from coachable.envs.side_by_side.mujoco_robots import Robots, robots_of
from coachable.envs.symmetry.phase_mirror import MirroredEnv

LONGEST_REPLAY = 10_000
"""An interrupted episode that is longer is begun anew, not replayed."""

Steps = tuple[
    Float[np.ndarray, "envs observations"],
    Float[np.ndarray, " envs"],
    Bool[np.ndarray, " envs"],
    Bool[np.ndarray, " envs"],
]
"""Observations, rewards, who terminated and who was cut off."""


class Copies:
    """Several copies of one environment, whose episodes begin and end by themselves.

    A described robot of Gymnasium's is stepped by layers: the simulators of all copies, what each of them is
    paid, and what is observed of all. Others are stepped one after the other. What comes out is the same to
    the bit.

    **Arguments:** `make_env`, called for each copy; `seeds`, for each one the seed of all of its episodes.
    """

    def __init__(self, make_env: Callable[[], gymnasium.Env], seeds: list[tuple[int, ...]]):
        self.envs = [make_env() for _ in seeds]
        self._copies = [_Copy(env, seed) for env, seed in zip(self.envs, seeds, strict=True)]
        self._layers = _Layers.of(self.envs)

    def begin(self, index: int) -> Any:
        """The first observation of another episode of a copy."""
        return self._copies[index].begin()

    def step(self, actions: Float[np.ndarray, "envs actions"]) -> Steps:
        """One step of every copy, in the episode that is under way."""
        for copy, action in zip(self._copies, actions, strict=True):
            copy.note(action)
        if self._layers is not None and self._layers.are_tried:
            return self._layers.step(actions, [copy.length for copy in self._copies])
        steps = [env.step(action)[:4] for env, action in zip(self.envs, actions, strict=True)]
        observations, rewards, *ends = zip(*steps, strict=True)
        terminated, truncated = (np.array(end, bool) for end in ends)
        return np.array(observations), np.array(rewards, np.float64), terminated, truncated

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()

    def arrays(self) -> dict[str, np.ndarray]:
        """What leads to where the copies are."""
        return {
            f"copy_{index}.{name}": array
            for index, copy in enumerate(self._copies)
            for name, array in copy.arrays().items()
        }

    def replay(self, index: int, arrays: Mapping[str, np.ndarray]) -> Any:
        """The observation of a copy where its episode in `arrays` stood; `None` if it does not get there."""
        prefix = f"copy_{index}."
        mine = {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}
        return self._copies[index].replay(mine)


class _Copy:
    """One of the environments, and what leads to where it is: its episode's seed, the actions since."""

    def __init__(self, env: gymnasium.Env, seeds: tuple[int, ...]):
        self.env = env
        self.length = 0
        """Steps of the episode so far."""
        self._seeds = seeds
        self._episode = 0
        self._actions: list[np.ndarray] = []

    def begin(self) -> Any:
        """The first observation of another episode."""
        self._episode += 1
        self.length, self._actions = 0, []
        return self._reset()

    def note(self, action: np.ndarray) -> None:
        """A step is made."""
        self.length += 1
        if self.length <= LONGEST_REPLAY + 1:
            self._actions.append(action)

    def arrays(self) -> dict[str, np.ndarray]:
        """The episode under way."""
        size = self.env.action_space.shape or ()
        actions = np.array(self._actions, np.float32).reshape(len(self._actions), *size)
        return {"episode": np.array(self._episode), "actions": actions}

    def replay(self, arrays: Mapping[str, np.ndarray]) -> Any:
        """The observation where the episode of these `arrays` stood; `None` if it does not get there."""
        self._episode, self._actions = int(arrays["episode"]), [*arrays["actions"]]
        self.length = len(self._actions)
        observation, ended = self._reset(), self.length > LONGEST_REPLAY
        for action in self._actions:
            if ended:
                return None
            observation, _, terminated, truncated, _ = self.env.step(action)
            ended = bool(terminated or truncated)
        return None if ended else observation

    def _reset(self) -> Any:
        # Above 2³⁰, where no evaluation begins.
        drawn = np.random.SeedSequence((*self._seeds, self._episode)).generate_state(1)[0]
        return self.env.reset(seed=2**30 + int(drawn) % 2**30)[0]


class _Layers(NamedTuple):
    """The wrappers of copies of a described robot, and the robots in them."""

    logs: list[EpisodeLog]
    mirrored: list[MirroredEnv]
    """None at all if they are not mirrored."""
    described: list[BehaviourReward]
    own: list[OwnReward]
    robots: Robots
    most_steps: float
    """After which an episode is cut off."""

    @staticmethod
    def of(envs: list[gymnasium.Env]) -> _Layers | None:
        """The layers, where wrappers and robots are those that this knows; else `None`."""
        logs, mirrored, described, own, inner = [], [], [], [], []
        for env in envs:
            for kind, found in (
                (EpisodeLog, logs),
                (MirroredEnv, mirrored),
                (BehaviourReward, described),
                (OwnReward, own),
            ):
                if type(env) is kind:
                    found.append(env)
                    env = env.env
                elif kind is not MirroredEnv:
                    return None
            inner.append(env)
        robots = robots_of(inner)
        if robots is None or len(mirrored) not in (0, len(envs)):
            return None
        return _Layers(logs, mirrored, described, own, robots, _most_steps(inner[0]))

    @property
    def are_tried(self) -> bool:
        """Whether every copy made a step by itself, if that is to show how long one lasts."""
        return all(each.is_tried for each in self.described)

    def step(self, actions: Float[np.ndarray, "envs actions"], lengths: list[int]) -> Steps:
        """One step of every copy; `lengths`, of their episodes with it."""
        was_mirrored = np.array([each.is_mirrored for each in self.mirrored], bool)
        if was_mirrored.any():
            actions = actions.copy()
            actions[was_mirrored] = self.mirrored[0].mirror.action(actions[was_mirrored])
        observations, own_rewards, terminated, infos = self.robots.step(actions)
        truncated = [length >= self.most_steps for length in lengths]
        rewards, numbers = [], []
        for index, info in enumerate(infos):
            observation, ended = observations[index], terminated[index]
            reward, info = self.own[index].paid(observation, own_rewards[index], ended, info)
            reward, seen, info = self.described[index].paid(observation, reward, ended, info)
            self.logs[index].count(reward, ended, truncated[index], info)
            rewards.append(reward)
            numbers.append(seen)
        observer = self.described[0].observer
        if observer is not None:
            observations = observer.append(observations, np.array(numbers))
        if self.mirrored:
            for mirrored, described in zip(self.mirrored, self.described, strict=True):
                mirrored.expect(described.expected_phase)
            is_mirrored = np.array([each.is_mirrored for each in self.mirrored])
            observations[is_mirrored] = self.mirrored[0].mirror.observation(observations[is_mirrored])
        return observations, np.array(rewards), np.array(terminated), np.array(truncated)


def _most_steps(env: gymnasium.Env) -> float:
    """The least of the time limits around an environment."""
    most = float("inf")
    while isinstance(env, gymnasium.Wrapper):
        if isinstance(env, gymnasium.wrappers.TimeLimit):
            most = min(most, float(env._max_episode_steps))
        env = env.env
    return most
