"""The vector twin gives what a loop over wrapped environments gives, in each of the autoreset modes."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from coachable.behaviours import Behaviour, Comparison, Dwell, Edge, Phase, Signal
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.gymnasium_vector_env import PlantVectorEnv
from coachable.envs.vector_behaviour_reward import VectorBehaviourReward
from coachable.foundation.errors import ParameterError, SignalError
from coachable.rewards.forms import Potential

NUM = 4
each_mode = pytest.mark.parametrize("mode", list(AutoresetMode))


class Pacing(gymnasium.Env):
    """A walker on a line, who stops at ±3; told late in the info, and not at all after a reset."""

    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (2,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
    metadata = {"render_modes": [], "render_fps": 4}  # noqa: RUF012

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x, self.steps = self.np_random.uniform(-1, 1), 0
        return self.seen(), {"place": {"x": self.x}}

    def step(self, action):
        self.x, self.steps = self.x + float(action[0]), self.steps + 1
        over = abs(self.x) > 2
        return self.seen(), self.x / 2, over, self.steps >= 12 and not over, {"place": {"x": self.x}, "n": 1}

    def seen(self):
        return np.array([self.x, self.steps], np.float32)


def pacing():
    left = Phase("left", "", Comparison("x", "<", -0.2), Dwell(0.5, 1.0))
    right = Phase("right", "", Comparison("x", ">", 0.2, 0.1))
    edges = (Edge("left", "right"), Edge("right", "left"))
    return Behaviour("pacing", "", (Signal("x"),), (left, right), edges, (edges,))


ONE = {
    "observation": {"x": lambda env, observation, info: observation[0]},
    "info": {"x": lambda env, observation, info: info["place"]["x"]},
    "environment": {"x": lambda env, observation, info: env.x},
}
MANY = {
    "observation": {"x": lambda env, observations, infos: observations[:, 0]},
    "info": {"x": lambda env, observations, infos: infos["place"]["x"]},
    "environment": {"x": lambda env, observations, infos: [one.x for one in env.envs]},
}
OPTIONS = {
    "plain": {"weight": 0.5},
    "all": {"cycle_bonus": 3.0, "form": Potential(0.9), "observe": "memory", "weight": 2.0},
    "replaced": {"replace": True, "form": "equation", "observe": "memory"},
}


def assert_same(one, other, path=""):
    """Equal values, dtypes, shapes and keys, all the way down."""
    assert type(one) is type(other), path
    if isinstance(one, dict):
        assert one.keys() == other.keys(), path
        for key in one:
            assert_same(one[key], other[key], f"{path}/{key}")
    elif isinstance(one, tuple):
        for index, (a, b) in enumerate(zip(one, other, strict=True)):
            assert_same(a, b, f"{path}/{index}")
    elif isinstance(one, np.ndarray) and one.dtype == object:
        assert_same(tuple(one), tuple(other), path)
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape), path
        np.testing.assert_array_equal(one, other, path)
    else:
        assert one == other, path


def pair(mode, way, options):
    def one():
        return BehaviourReward(Pacing(), pacing(), ONE[way], **options)

    ours = VectorBehaviourReward(
        SyncVectorEnv([Pacing] * NUM, autoreset_mode=mode), pacing(), MANY[way], **options
    )
    return ours, SyncVectorEnv([one] * NUM, autoreset_mode=mode)


@pytest.mark.parametrize(
    ("mode", "way"),
    [
        (mode, way)
        for mode in AutoresetMode
        for way in MANY
        # In the same-step mode the last state is gone from the environment itself.
        if (mode, way) != (AutoresetMode.SAME_STEP, "environment")
    ],
)
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_it_is_a_loop_over_wrapped_environments(mode, way, options):
    ours, loop = pair(mode, way, options)
    for space in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(ours, space) == getattr(loop, space)
    assert_same(ours.reset(seed=7), loop.reset(seed=7))
    rng = np.random.default_rng(0)
    terminations = truncations = 0
    for _ in range(120):
        actions = rng.uniform(-1, 1, (NUM, 1))
        told = ours.step(actions)
        assert_same(told, loop.step(actions))
        _, _, terminated, truncated, _ = told
        terminations, truncations = terminations + terminated.sum(), truncations + truncated.sum()
        ended = terminated | truncated
        if mode is AutoresetMode.DISABLED and ended.any():
            mine, its = ({"reset_mask": ended.copy()} for _ in range(2))
            assert_same(ours.reset(options=mine), loop.reset(options=its))
    assert terminations > 5
    assert truncations > 5
    assert_same(ours.reset(), loop.reset())
    assert_same(ours.step(actions), loop.step(actions))


class Nested(gymnasium.ObservationWrapper):
    observation_space = gymnasium.spaces.Dict({"body": Pacing.observation_space})

    def observation(self, observation):
        return {"body": observation}


@each_mode
def test_dictionaries_get_a_further_entry(mode):
    many = {"x": lambda env, observations, infos: observations["body"][:, 0]}
    one = {"x": lambda env, observation, info: observation["body"][0]}

    def plain():
        return Nested(Pacing())

    ours = VectorBehaviourReward(
        SyncVectorEnv([plain] * 2, autoreset_mode=mode), pacing(), many, observe="memory"
    )
    loop = SyncVectorEnv(
        [lambda: BehaviourReward(plain(), pacing(), one, observe="memory")] * 2, autoreset_mode=mode
    )
    assert ours.observation_space == loop.observation_space
    assert_same(ours.reset(seed=1), loop.reset(seed=1))
    ended = 0
    for _ in range(40):
        actions = np.full((2, 1), 0.3)
        told = ours.step(actions)
        assert_same(told, loop.step(actions))
        done = told[2] | told[3]
        ended += done.sum()
        if mode is AutoresetMode.DISABLED and done.any():
            ours.reset(options={"reset_mask": done.copy()})
            loop.reset(options={"reset_mask": done.copy()})
    assert ended > 2


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
def test_a_pack_looks_into_the_environments_one_by_one(mode):
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")
    stance = Phase("stance", "", Comparison("foot_contact", ">", 0.5))
    flight = Phase("flight", "", Comparison("foot_contact", "<", 0.5))
    hops = Behaviour(
        "hops",
        "",
        (Signal("foot_contact"),),
        (stance, flight),
        (Edge("stance", "flight"), Edge("flight", "stance")),
    )

    def plain():
        return gymnasium.make("Hopper-v5")

    ours = VectorBehaviourReward(SyncVectorEnv([plain] * 2, autoreset_mode=mode), hops)
    loop = SyncVectorEnv([lambda: BehaviourReward(plain(), hops)] * 2, autoreset_mode=mode)
    assert_same(ours.reset(seed=1), loop.reset(seed=1))
    ours.action_space.seed(0)
    for _ in range(60):
        actions = ours.action_space.sample()
        told = ours.step(actions)
        assert_same(told, loop.step(actions))
        ended = told[2] | told[3]
        if mode is AutoresetMode.DISABLED and ended.any():
            ours.reset(options={"reset_mask": ended.copy()})
            loop.reset(options={"reset_mask": ended.copy()})
    with pytest.raises(ParameterError, match="same-step autoreset mode"):
        VectorBehaviourReward(SyncVectorEnv([plain], autoreset_mode=AutoresetMode.SAME_STEP), hops)


@each_mode
def test_a_native_vector_environment_can_be_wrapped(mode):
    """The compass walkers' own phases are those that the wrapper finds in their observations."""
    names = ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
    signals = {
        name: lambda env, observations, infos, index=index: observations[:, index]
        for index, name in enumerate(names)
    }
    base = PlantVectorEnv(3, autoreset_mode=mode, seconds=0.5, start_noise=0.1)
    env = VectorBehaviourReward(base, "compass-walking", signals, replace=True)
    env.reset(seed=0)
    for _ in range(60):
        _, rewards, terminated, truncated, infos = env.step(np.tile([-1.35, -0.18], (3, 1)))
        ended = terminated | truncated
        np.testing.assert_array_equal(infos["behaviour"]["location"], infos["phase"])
        if "final_info" in infos:
            final = infos["final_info"]
            np.testing.assert_array_equal(final["behaviour"]["location"][ended], final["phase"][ended])
            np.testing.assert_array_equal(rewards[ended], final["terms"]["orthant"][ended])
        else:
            np.testing.assert_array_equal(rewards, infos["terms"]["orthant"])
        if mode is AutoresetMode.DISABLED and ended.any():
            env.reset(options={"reset_mask": ended})


def vector(signals, mode=AutoresetMode.NEXT_STEP, **options):
    return VectorBehaviourReward(
        SyncVectorEnv([Pacing] * NUM, autoreset_mode=mode), pacing(), signals, **options
    )


def test_mistakes_are_named():
    with pytest.raises(ParameterError, match="signal 'x' is missing"):
        vector({})
    with pytest.raises(ParameterError, match="weight must be a finite number, got inf"):
        vector(MANY["info"], weight=float("inf"))
    with pytest.raises(ParameterError, match="no id"):
        vector(None)
    silent = SyncVectorEnv([Pacing])
    silent.metadata = {}
    with pytest.raises(ParameterError, match="autoreset mode"):
        VectorBehaviourReward(silent, pacing(), MANY["info"])
    with pytest.raises(ParameterError, match="does not show its environments"):
        VectorBehaviourReward(PlantVectorEnv(2), "compass-walking")
    with pytest.raises(SignalError, match=r"'x' must be 4 numbers, one an environment, but .* \(2,\)"):
        vector({"x": lambda env, observations, infos: observations[0]}).reset()
    env = vector(MANY["info"], AutoresetMode.DISABLED)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros((NUM, 1)))
    with pytest.raises(ResetNeeded, match="never"):
        env.reset(options={"reset_mask": np.arange(NUM) == 0})


def test_a_nan_is_named_with_its_environments_or_counts_as_outside():
    values = iter([np.zeros(NUM), np.array([1.0, np.nan, 0.0, np.nan])] * 2)
    signals = {"x": lambda env, observations, infos: next(values)}
    env = vector(signals)
    env.reset()
    with pytest.raises(SignalError, match="'x' is NaN after step 1 in environment 1, 3"):
        env.step(np.zeros((NUM, 1)))
    env = vector(signals, on_nan="outside")
    env.reset()
    *_, infos = env.step(np.zeros((NUM, 1)))
    assert infos["behaviour"]["phase"].tolist() == ["right", "outside", "outside", "outside"]
