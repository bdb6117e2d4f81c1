"""How long a step lasts is found by one rule, and asked for where it cannot be known."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from coachable.behaviours import Behaviour, Comparison, Dwell, Edge, Phase, Signal
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.signals.time_step import time_step
from coachable.envs.vector_behaviour_reward import VectorBehaviourReward
from coachable.foundation.errors import ParameterError

# Gymnasium forks its workers, which never touch JAX.
pytestmark = pytest.mark.filterwarnings(r"ignore:os\.fork\(\) was called:RuntimeWarning")

ONE = {"x": lambda env, observation, info: observation[0]}
MANY = {"x": lambda env, observations, infos: observations[:, 0]}


class Line(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-99.0, 99.0, (1,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
    metadata = {"render_modes": [], "render_fps": 30}  # noqa: RUF012

    def __init__(self, dt=None):
        if dt is not None:
            self.dt = dt

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = 1.0
        return np.array([self.x]), {}

    def step(self, action):
        self.x += float(action[0])
        return np.array([self.x]), 0.0, False, False, {}


class Repeat(gymnasium.Wrapper):
    """Takes four steps for one."""

    def step(self, action):
        for _ in range(3):
            self.env.step(action)
        return self.env.step(action)


class Honest(Repeat):
    dt = 0.4


def behaviour():
    left = Phase("left", "", Comparison("x", "<", 0.0), Dwell(0.1, 9.0))
    right = Phase("right", "", Comparison("x", ">", 0.0))
    edges = (Edge("left", "right"), Edge("right", "left"))
    return Behaviour("sides", "", (Signal("x"),), (left, right), edges, (edges,))


def ways(make, **options):
    """One step in one environment and in many, by each way to run them."""

    def one():
        return BehaviourReward(make(), behaviour(), ONE, **options)

    yield one
    for kind in (SyncVectorEnv, AsyncVectorEnv):

        def many(kind=kind):
            base = kind([make] * 2)
            try:
                return VectorBehaviourReward(base, behaviour(), MANY, **options)
            except ParameterError:
                base.close()
                raise

        yield many


def stepped(way):
    env = way()
    env.reset(seed=0)
    env.step(env.action_space.sample())
    return env


@pytest.mark.parametrize(
    ("make", "dt"),
    [
        (lambda: Line(0.1), 0.1),
        (lambda: Line(), 1 / 30),
        (lambda: Line(np.float32(0.25)), 0.25),
        (lambda: Line(np.array(0.25)), 0.25),
        (lambda: gymnasium.wrappers.TimeLimit(Line(0.1), 9), 0.1),
        (lambda: Honest(Line(0.1)), 0.4),
    ],
)
def test_one_environment_and_many_take_the_same_time(make, dt):
    for way in ways(make):
        env = way()
        assert env.behaviour_reward.dt == pytest.approx(dt)
        env.reset(seed=0)
        env.step(env.action_space.sample())
        env.step(env.action_space.sample())
        env.close()


def test_where_a_step_is_several_it_is_asked_for():
    for way in ways(lambda: Repeat(Line(0.1))):
        with pytest.raises(
            ParameterError, match=r"4 steps of Line.* 0\.1 s or 0\.4 s\? Give dt=0\.1 or dt=0\.4"
        ):
            stepped(way)
    for way in ways(lambda: Repeat(Line(0.1)), dt=0.4):
        stepped(way).close()


class Simulated(Line):
    """Has a simulator, and with it a dt, from the first reset on."""

    @property
    def dt(self):
        return self.simulator.dt


class Counted(Line):
    dt = None


@pytest.mark.parametrize("make", [Simulated, Counted, lambda: Line("0.1"), lambda: Line(-0.1)])
def test_a_dt_that_is_no_time_is_asked_for_and_not_taken_from_pictures(make):
    for way in ways(make):
        with pytest.raises(ParameterError, match="dt is needed"):
            way()
    for way in ways(make, dt=0.4):
        stepped(way).close()


def test_environments_that_differ_are_asked_about():
    env = SyncVectorEnv([lambda: Line(0.1), lambda: Line(0.2)])
    with pytest.raises(ParameterError, match=r"0\.1 s and 0\.2 s; give dt"):
        time_step(env)
