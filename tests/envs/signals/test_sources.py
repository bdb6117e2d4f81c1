"""Signals that a plan names: there and back, what they read, packs with additions, and mistakes."""

import copy
import sys
import types

import gymnasium
import numpy as np
import pytest

from coachable.behaviours import Behaviour, Comparison, Edge, Phase, Signal
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.signals import SIGNAL_PACKS, signal_pack
from coachable.envs.signals.reading import require_signals
from coachable.envs.signals.sources import SignalSources, signal_sources
from coachable.envs.vector_behaviour_reward import VectorBehaviourReward
from coachable.foundation.errors import ParameterError

OBSERVATION = np.array([0.5, 1.5, 2.5])
NESTED = {"body": (OBSERVATION, {"joints": np.array([[1.0, 2.0], [3.0, 4.0]])})}
INFO = {"speed": 7.0, "place": {"x": 8.0}, "a:b": 9.0, "start_speed": 6.0}


@pytest.fixture(autouse=True)
def own_module(monkeypatch):
    module = types.ModuleType("my_robot")
    module.knee = lambda env, observation, info: 10.0
    module.number = 3
    monkeypatch.setitem(sys.modules, "my_robot", module)


@pytest.mark.parametrize(
    ("source", "observation", "value"),
    [
        (1, OBSERVATION, 1.5),
        (-1, OBSERVATION, 2.5),
        ({"observation": ["body", 0, 2]}, NESTED, 2.5),
        ({"observation": ["body", 1, "joints", 1]}, NESTED, [2.0, 4.0]),
        ({"observation": "speed"}, INFO, 7.0),
        ("speed", None, 7.0),
        ({"info": ["place", "x"]}, None, 8.0),
        ({"info": "a:b"}, None, 9.0),
        ({"info": "speed", "at_reset": 0.25}, None, 7.0),
        ({"info": "missing", "at_reset": 0.25}, None, 0.25),
        ({"info": "missing", "at_reset": "start_speed"}, None, 6.0),
        ({"info": ["place", "y"], "at_reset": ["place", "x"]}, None, 8.0),
        ("my_robot:knee", None, 10.0),
    ],
)
def test_a_source_reads_what_it_names_and_goes_there_and_back(source, observation, value):
    sources = signal_sources({"signal": source})
    np.testing.assert_array_equal(sources["signal"](None, observation, INFO), value)
    assert sources.to_data() == {"signal": source}
    assert signal_sources(sources.to_data()).sources == sources.sources
    assert copy.deepcopy(sources).sources == sources.sources  # as it is when it is sent to another process


def test_an_entry_that_is_missing_and_has_no_other_is_a_key_error():
    with pytest.raises(KeyError):
        signal_sources({"signal": "missing"})["signal"](None, None, INFO)


def test_numbers_of_numpy_are_numbers():
    given = {"x": np.int64(1), "y": {"info": "speed", "at_reset": np.float32(0.25)}}
    assert signal_sources(given).to_data() == {"x": 1, "y": {"info": "speed", "at_reset": 0.25}}


def test_without_sources_the_pack_is_read():
    assert signal_sources({}) is None


def test_a_pack_can_be_named():
    sources = signal_sources({"pack": "Hopper-v5", "more": 0})
    assert sources.pack is SIGNAL_PACKS["Hopper-v5"]
    assert [*sources] == ["more"]
    assert sources.to_data() == {"pack": "Hopper-v5", "more": 0}


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        ({"x": 1.5}, "signals.x must be a column"),
        ({"x": True}, "signals.x must be a column"),
        ({"x": {"observatoin": 1}}, "signals.x: unknown key 'observatoin'; did you mean 'observation'"),
        ({"x": {}}, "signals.x must have observation, or info"),
        ({"x": {"observation": 1, "info": "y"}}, "signals.x must have observation, or info"),
        ({"x": {"observation": 1, "at_reset": 0}}, "signals.x must have observation, or info"),
        ({"x": {"info": []}}, "signals.x.info must be a key or a list"),
        ({"x": {"info": "y", "at_reset": True}}, "signals.x.at_reset must be a key or a list"),
        ({"x": "no_such_module:f"}, "signals.x: 'no_such_module:f': ModuleNotFoundError"),
        ({"x": "my_robot:kne"}, "signals.x: 'my_robot:kne': my_robot has no 'kne'; did you mean 'knee'"),
        ({"x": "my_robot:number"}, "signals.x: 'my_robot:number' must be a function"),
        ({"pack": "Hoper-v5"}, "no signal pack for 'Hoper-v5'; did you mean 'Hopper-v5'"),
    ],
)
def test_mistakes_are_named_by_their_keys(data, complaint):
    with pytest.raises(ParameterError) as raised:
        signal_sources(data)
    assert complaint in str(raised.value)


def test_functions_as_such_have_no_data():
    with pytest.raises(ParameterError, match="'x' is a function without a name in plans"):
        SignalSources({"x": lambda env, observation, info: 0.0}).to_data()


def test_signals_are_looked_for_before_an_environment_is_made():
    own = {"more": lambda env, observation, info: 0.0}
    require_signals(("foot_contact", "more"), own, "Hopper-v5")
    require_signals(("foot_contact", "more"), own, "my_module:Hopper-v5")
    require_signals(("foot_contact", "more"), SignalSources(own, signal_pack("Hopper-v5")), "Mine-v0")
    require_signals(("foot_contact",), None, "Hopper-v5")
    with pytest.raises(ParameterError, match=r"'foot_contact' is missing in signals"):
        require_signals(("foot_contact", "more"), own, "Mine-v0")
    with pytest.raises(ParameterError, match=r"Hopper-v5 has no signal 'mor', and .*did you mean 'more'"):
        require_signals(("foot_contact", "mor"), own, "Hopper-v5")
    with pytest.raises(ParameterError, match="no signal pack for 'Mine-v0'"):
        require_signals(("x",), None, "Mine-v0")


def hops():
    stance = Phase("stance", "", Comparison("foot_contact", ">", 0.5))
    flight = Phase("flight", "", Comparison("height", ">", 0.0))
    edges = (Edge("stance", "flight"), Edge("flight", "stance"))
    return Behaviour("hops", "", (Signal("height"), Signal("foot_contact")), (stance, flight), edges)


def test_a_pack_with_additions():
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")

    def plain():
        return gymnasium.make("Hopper-v5")

    own = signal_sources({"height": 0})
    env = BehaviourReward(plain(), hops(), own)
    read = signal_pack("Hopper-v5").reader(env, ("foot_contact",))
    vector = VectorBehaviourReward(gymnasium.vector.SyncVectorEnv([plain] * 2), hops(), own)
    observation, info = env.reset(seed=0)
    _, infos = vector.reset(seed=[0, 0])
    env.action_space.seed(0)
    seen = set()
    for _ in range(40):
        contact = read(observation, info)["foot_contact"]
        expected = "stance" if contact > 0.5 else "flight"
        assert info["behaviour"]["phase"] == expected
        assert infos["behaviour"]["phase"].tolist() == [expected] * 2
        seen.add(expected)
        action = env.action_space.sample()
        observation, *_, ended, _, info = env.step(action)
        *_, infos = vector.step(np.stack([action] * 2))
        if ended:
            break
    assert seen == {"stance", "flight"}
