"""An evaluation comes to its end, whatever the environment does."""

import gymnasium
import jax.numpy as jnp
import numpy as np

from coachable.behaviours import Behaviour, Comparison, Edge, Phase, Signal
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.experiments import assessment
from coachable.experiments.assessment import most_steps, roll_out_episodes
from coachable.learning.policy import Policy


class Endless(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1), {}

    def step(self, action):
        return np.zeros(1), 1.0, False, False, {}


def test_an_episode_that_never_ends_is_ended_by_the_evaluation(monkeypatch):
    monkeypatch.setattr(assessment, "LONGEST_EPISODE", 7)
    row, one = np.zeros((1, 1), np.float32), np.ones(1, np.float32)
    policy = Policy(
        weights=(jnp.asarray(row),),
        biases=(jnp.asarray(0 * one),),
        low=jnp.asarray(-one),
        high=jnp.asarray(one),
        activation="tanh",
        squashing="clip",
    )
    phases = (Phase("left", "", Comparison("x", "<", 0.5)), Phase("right", "", Comparison("x", ">", 0.5)))
    edges = (Edge("left", "right"), Edge("right", "left"))
    behaviour = Behaviour("sides", "", (Signal("x"),), phases, edges, (edges,))
    signals = {"x": lambda env, observation, info: observation[0]}
    env = BehaviourReward(Endless(), behaviour, signals, replace=True, weight=0.0)
    columns = roll_out_episodes(env, policy, 2, lambda info: {}, behaviour)
    assert columns["length"].tolist() == [7, 7]
    assert not columns["fell"].any()
    assert most_steps(gymnasium.make("Pendulum-v1")) == np.inf
