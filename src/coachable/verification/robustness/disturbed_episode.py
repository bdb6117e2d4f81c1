"""An episode in a Gymnasium environment that is disturbed: actions pushed or late, velocities kicked."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float

from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.own_reward import OWN
from coachable.envs.problem import EnvironmentProblem
from coachable.experiments.assessment import actor
from coachable.experiments.experiment import EVALUATION_SEED, Which
from coachable.experiments.recorded_episodes import step_seconds
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.errors import ParameterError
from coachable.learning.policy import Policy


@dataclass(frozen=True, eq=False)
class EpisodeDisturbance:
    """What is other than in an evaluation; by default nothing."""

    begin: int = 0
    """Before which step of the episode the push and the kick come, counted from 0."""
    push: Float[np.ndarray, "steps actions"] = field(default_factory=lambda: np.zeros((0, 0)))
    """Added to the actions, a row a step, in halves of each action's range; the sum is cut to the range."""
    kick: Float[np.ndarray, " velocities"] | None = None
    """Added to the velocities of a MuJoCo robot [m/s, rad/s]."""
    delay: bool = False
    """Whether each action is applied one step late; the first is applied twice."""


class DisturbedEnv(gymnasium.Wrapper):
    """An environment with a disturbance in every episode.

    The policy gets the observation from before a kick: it comes between that and the action.

    **Raises:** `ParameterError` for a push or a kick that is not of the robot's size.
    """

    def __init__(self, env: gymnasium.Env, disturbance: EpisodeDisturbance):
        super().__init__(env)
        for what, given, expected in (
            ("push", disturbance.push.shape[1] if len(disturbance.push) else None, num_actions(env)),
            ("kick", None if disturbance.kick is None else len(disturbance.kick), num_velocities(env)),
        ):
            if given is not None and given != expected:
                raise ParameterError(
                    f"the {what} has {given} numbers, but the robot takes {expected}; it is another's"
                )
        self._disturbance = disturbance
        self._low, self._high, self._half = _action_range(env)
        self._count, self._before = 0, None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode, as yet undisturbed."""
        self._count, self._before = 0, None
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> Any:
        """One step with the disturbance that is due."""
        one, row = self._disturbance, self._count - self._disturbance.begin
        if one.kick is not None and row == 0:
            base: Any = self.env.unwrapped
            base.set_state(base.data.qpos.copy(), base.data.qvel + one.kick)
        applied = self._before if one.delay and self._before is not None else action
        self._before = action
        if 0 <= row < len(one.push):
            pushed = applied + self._half * one.push[row].reshape(self._half.shape)
            applied = np.clip(pushed, self._low, self._high).astype(np.asarray(action).dtype)
        self._count += 1
        return self.env.step(applied)


@dataclass(frozen=True)
class EpisodeEnd:
    """How an episode went."""

    steps: int
    seconds: float
    fell: bool
    """Whether it terminated."""
    own_return: float
    """What the environment itself paid."""


@dataclass(frozen=True, eq=False)
class EpisodeLoop:
    """A policy in its Gymnasium environment: a closed loop of which episodes are all that can be seen."""

    env: gymnasium.Env
    """It reports its own reward in the info."""
    policy: Policy
    dt: float
    """Time between two steps [s]."""

    @staticmethod
    def of(run: Run, setup: str, seed: int, which: Which = "last") -> EpisodeLoop:
        """A lane of a run in an environment that is made anew.

        **Raises:** `RunFolderError` if the run has no such lane, `ParameterError` if neither the plan nor the
        environment says how long a step lasts.
        """
        problem, policy = run.experiment.problem, run.policy(setup, seed, which)
        assert isinstance(problem, EnvironmentProblem)  # a plant's loop is a `ClosedLoop`
        described = run.experiment.setup(setup)
        env = problem.environment(described)
        dt = step_seconds(problem, env)
        # What the policy does not see of the behaviour's reward need not be computed.
        if isinstance(env, BehaviourReward) and described.observe == "nothing" and not policy.mirror:
            return EpisodeLoop(env.env, policy, dt)
        return EpisodeLoop(env, policy, dt)

    @property
    def num_actions(self) -> int:
        """How many numbers an action has."""
        return num_actions(self.env)

    @property
    def num_velocities(self) -> int:
        """How many velocities can be kicked; 0 where the robot is not MuJoCo's."""
        return num_velocities(self.env)

    def num_steps(self, seconds: float) -> int:
        """Steps that take so long, at least one, and no more than the environment gives an episode."""
        spec = self.env.spec
        limit = None if spec is None else spec.max_episode_steps
        return max(min(round(seconds / self.dt), limit or sys.maxsize), 1)

    def run(self, episode: int, disturbance: EpisodeDisturbance, seconds: float) -> EpisodeEnd:
        """An episode of the evaluations with a disturbance, for at most so many seconds."""
        env = DisturbedEnv(self.env, disturbance)
        act = actor(self.policy, env)
        observation, _ = env.reset(seed=EVALUATION_SEED + episode)
        count, own, fell, over = 0, 0.0, False, False
        while not over and count < self.num_steps(seconds):
            observation, _, fell, truncated, info = env.step(act(observation))
            count, own, over = count + 1, own + info[OWN], fell or truncated
        return EpisodeEnd(count, count * self.dt, bool(fell), own)


def num_actions(env: gymnasium.Env) -> int:
    """How many numbers an action has."""
    return int(np.prod(env.action_space.shape or ()))


def num_velocities(env: gymnasium.Env) -> int:
    """How many velocities can be kicked; 0 where the robot is not MuJoCo's."""
    base: Any = env.unwrapped
    known = callable(getattr(base, "set_state", None)) and hasattr(getattr(base, "data", None), "qvel")
    return len(base.data.qvel) if known else 0


def _action_range(env: gymnasium.Env) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least and greatest actions, and half the way between them: 1 where there is no bound."""
    space: Any = env.action_space
    half = (space.high.astype(float) - space.low) / 2
    return space.low, space.high, np.where(np.isfinite(half), half, 1.0)
