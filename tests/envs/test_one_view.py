"""However environments are run, copied or made anew, the same recorded trace is read and paid alike."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import batch_space

from coachable.behaviours import Behaviour, Comparison, Dwell, Edge, Phase, Signal
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.signals.sources import signal_sources
from coachable.envs.vector_behaviour_reward import VectorBehaviourReward
from coachable.foundation.errors import SignalError

# Gymnasium forks its workers, which never touch JAX.
pytestmark = pytest.mark.filterwarnings(r"ignore:os\.fork\(\) was called:RuntimeWarning")

ABSENT = None
TRACES = (
    (ABSENT, 1.0, 1.0, -1.0, ABSENT, 1.0, -1.0, -1.0),
    (ABSENT, ABSENT, -1.0, 1.0, 1.0, 1.0, ABSENT, 1.0),
    (ABSENT, ABSENT, 1.0, -1.0, 1.0, 1.0, 1.0, ABSENT),
)
"""What the info has of x after the reset and after every step, for each environment."""


class Replay(gymnasium.Env):
    """Replays a trace in its info."""

    observation_space = gymnasium.spaces.Box(0.0, 99.0, (1,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
    metadata = {"render_modes": [], "render_fps": 10}  # noqa: RUF012

    def __init__(self, trace):
        self.trace = trace

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros(1), self.info()

    def step(self, action):
        self.count += 1
        return np.zeros(1), 0.0, False, self.count == len(self.trace) - 1, self.info()

    def info(self):
        x = self.trace[self.count]
        return {} if x is ABSENT else {"x": x, "deep": {"x": [x, 5.0, 6.0], "n": int(x)}}


class ReplayAll(gymnasium.vector.VectorEnv):
    """A vector environment of its own making, which has all entries, and a mask where they are absent."""

    metadata = {"autoreset_mode": AutoresetMode.DISABLED, "render_fps": 10}  # noqa: RUF012
    single_observation_space, single_action_space = Replay.observation_space, Replay.action_space
    num_envs = len(TRACES)
    observation_space = batch_space(single_observation_space, num_envs)
    action_space = batch_space(single_action_space, num_envs)

    def reset(self, *, seed=None, options=None):
        self.count = 0
        return np.zeros((3, 1)), self.infos()

    def step(self, actions):
        self.count += 1
        over = np.full(3, self.count == len(TRACES[0]) - 1)
        return np.zeros((3, 1)), np.zeros(3), np.zeros(3, bool), over, self.infos()

    def infos(self):
        column = [trace[self.count] for trace in TRACES]
        mask = np.array([x is not ABSENT for x in column])
        x = np.array([77.0 if one is ABSENT else one for one in column])
        deep = {"x": x[:, None], "_x": mask, "n": x.astype(int), "_n": mask}
        return {"x": x, "_x": mask, "deep": deep, "_deep": mask}


def behaviour():
    left = Phase("left", "", Comparison("x", "<", 0.0), Dwell(0.1, 9.0))
    right = Phase("right", "", Comparison("x", ">", 0.0))
    edges = (Edge("left", "right"), Edge("right", "left"))
    return Behaviour("sides", "", (Signal("x"),), (left, right), edges, (edges,))


def phase(x):
    return "outside" if x is ABSENT else "left" if x < 0 else "right"


WAYS = {
    "function": {"x": lambda env, observation, info: info["x"]},
    "number of another type": {"x": lambda env, observation, info: info["deep"]["n"]},
    "comparison": {"x": lambda env, observation, info: (info["x"] > 0) * 2.0 - 1.0},
    "two entries": {"x": lambda env, observation, info: info["x"] + 0 * info["deep"]["n"]},
    "entry": signal_sources({"x": "x"}),
    "path": signal_sources({"x": {"info": ["deep", "n"]}}),
    "path into a list": signal_sources({"x": {"info": ["deep", "x", 0]}}),
}
FILLED = {
    "default": {"x": lambda env, observation, info: info.get("x", -1.0)},
    "at reset": signal_sources({"x": {"info": "x", "at_reset": -1.0}}),
    "list at reset": signal_sources({"x": {"info": ["deep", "x", 0], "at_reset": -1.0}}),
    "path at reset": signal_sources({"x": {"info": ["deep", "n"], "at_reset": -1.0}}),
}


def one(trace, signals):
    return BehaviourReward(Replay(trace), behaviour(), signals, on_nan="outside")


def copied(env):
    env.reset()
    other = copy.deepcopy(env)
    env.unwrapped.trace = ()  # whoever reads the original now fails
    return other


def pickled(env):
    cloudpickle = pytest.importorskip("cloudpickle")
    env.reset()
    return pickle.loads(cloudpickle.dumps(env))


def seen_by_one(make, signals):
    """The phases of each environment, and what it was paid in all."""
    phases, paid = [], []
    for trace in TRACES:
        env = make(one(trace, signals))
        _, info = env.reset()
        mine, total, over = [info["behaviour"]["phase"]], 0.0, False
        while not over:
            _, reward, _, over, info = env.step(np.zeros(1))
            mine.append(info["behaviour"]["phase"])
            total += reward
        phases.append(mine)
        paid.append(total)
    return phases, paid


def seen_by_many(base, signals, mode):
    env = VectorBehaviourReward(base, behaviour(), signals, on_nan="outside")
    _, infos = env.reset()
    phases, paid = [infos["behaviour"]["phase"]], np.zeros(3)
    for step in range(1, len(TRACES[0])):
        _, rewards, _, _, infos = env.step(np.zeros((3, 1)))
        last = step == len(TRACES[0]) - 1 and mode is AutoresetMode.SAME_STEP
        phases.append((infos["final_info"] if last else infos)["behaviour"]["phase"])
        paid += rewards
    if mode is AutoresetMode.SAME_STEP:
        assert infos["behaviour"]["phase"].tolist() == phases[0].tolist()
    elif mode is AutoresetMode.NEXT_STEP:
        *_, infos = env.step(np.zeros((3, 1)))
        assert infos["behaviour"]["phase"].tolist() == phases[0].tolist()
    env.close()
    return [list(mine) for mine in zip(*phases, strict=True)], paid.tolist()


def makers():
    return [lambda trace=trace: Replay(trace) for trace in TRACES]


@pytest.mark.parametrize("way", [*WAYS, *FILLED])
def test_every_view_is_the_recorded_trace(way):
    signals = (WAYS | FILLED)[way]
    truth = [[phase(-1.0 if x is ABSENT and way in FILLED else x) for x in trace] for trace in TRACES]
    phases, paid = seen_by_one(lambda env: env, signals)
    assert phases == truth
    for make in (copied, pickled):
        assert seen_by_one(make, signals) == (phases, paid)
    for mode in AutoresetMode:
        assert seen_by_many(SyncVectorEnv(makers(), autoreset_mode=mode), signals, mode) == (phases, paid)
    assert seen_by_many(ReplayAll(), signals, AutoresetMode.DISABLED) == (phases, paid)
    if way in ("function", "at reset"):  # processes take their time
        for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
            env = AsyncVectorEnv(makers(), autoreset_mode=mode)
            assert seen_by_many(env, signals, mode) == (phases, paid)


def test_what_is_absent_is_named_with_when_and_where():
    with pytest.raises(SignalError, match="'x' is NaN after the reset, for the info has no entry 'x' there"):
        BehaviourReward(Replay(TRACES[0]), behaviour(), WAYS["entry"]).reset()
    env = VectorBehaviourReward(SyncVectorEnv(makers()), behaviour(), WAYS["entry"])
    with pytest.raises(SignalError, match=r"after the reset in environment 0, 1, 2, .* no entry 'x'"):
        env.reset()


class Robot:
    """A MuJoCo environment whose model can be made anew, or changed, at a reset."""

    def __new__(cls, options=()):
        class Randomised(gymnasium.Wrapper):
            def reset(self, *, seed=None, options=None):
                base = self.unwrapped
                for what in options or ():
                    if what == "anew":
                        base.model, base.data = copy.deepcopy(base.model), None
                        base.data = base_data(base.model)
                    elif what == "heavy":
                        base.model.body_mass[:] *= 2.0
                    elif what == "big feet":
                        base.model.geom("foot_geom").size[0] += 0.01
                return self.env.reset(seed=seed)

        return Randomised(gymnasium.make("Hopper-v5"))


def base_data(model):
    import mujoco

    return mujoco.MjData(model)


def hop():
    stance = Phase("stance", "", Comparison("foot_height", "<", 0.05))
    flight = Phase("flight", "", Comparison("foot_height", ">", 0.05))
    edges = (Edge("stance", "flight"), Edge("flight", "stance"))
    return Behaviour("hops", "", (Signal("foot_height"),), (stance, flight), edges, (edges,))


def test_a_robots_model_may_be_made_anew_or_changed_at_a_reset():
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")
    from coachable.envs.signals import signal_pack

    env = Robot()
    pack = signal_pack(env)
    read = pack.reader(env)
    env.reset(seed=0)
    before = read(None, {})
    for options in (["anew"], ["heavy"], ["big feet"], ["anew", "heavy"]):
        weight, height = before["weight"], before["foot_height"]
        env.reset(seed=0, options=options)
        seen = read(None, {})
        assert seen == pack.read(env, None, {})  # which looks up everything for this reading
        assert seen["weight"] == pytest.approx(weight * (2 if "heavy" in options else 1))
        assert seen["foot_height"] == pytest.approx(height - (0.01 if "big feet" in options else 0))
        env.step(np.ones(3))
        assert read(None, {})["knee"] != before["knee"]
        before = seen


@pytest.mark.parametrize("signals", ["pack", "function"])
@pytest.mark.parametrize("how", ["copy", "pickle"])
def test_a_copy_of_a_robot_is_read_and_not_its_original(signals, how):
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")
    cloudpickle = pytest.importorskip("cloudpickle")
    own = {"foot_height": lambda env, observation, info: env.data.qpos[1] - 1.2}
    original = BehaviourReward(gymnasium.make("Hopper-v5"), hop(), None if signals == "pack" else own)
    original.reset(seed=0)
    original.step(np.zeros(3))
    other = copy.deepcopy(original) if how == "copy" else pickle.loads(cloudpickle.dumps(original))
    twin = BehaviourReward(gymnasium.make("Hopper-v5"), hop(), None if signals == "pack" else own)
    for env in (other, twin):
        env.reset(seed=1)  # Gymnasium copies how a robot is made, not where it is
    original.unwrapped.data.qpos[1] += 5.0  # the original flies
    for _ in range(3):
        its, expected = other.step(np.zeros(3)), twin.step(np.zeros(3))
        assert its[1] == expected[1]
        assert its[-1]["behaviour"] == expected[-1]["behaviour"]
    assert original.step(np.zeros(3))[-1]["behaviour"]["phase"] == "flight"
