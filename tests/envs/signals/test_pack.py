"""Signal packs are found by environment and id, say what they offer, and can be used in a behaviour."""

import gymnasium
import pytest

from coachable.behaviours import All, Behaviour, Comparison, Edge, Phase
from coachable.envs.signals import SIGNAL_PACKS, signal_pack
from coachable.foundation.errors import ParameterError


@pytest.mark.parametrize("name", SIGNAL_PACKS)
def test_a_pack_says_what_its_signals_are(name):
    signals = signal_pack(name).signals
    names = [signal.name for signal in signals]
    assert len(set(names)) == len(names)
    for signal in signals:
        assert signal.description
        assert signal.unit in (
            {"", "m", "rad", "N", "W"} if signal.derivative_of is None else {"m/s", "rad/s"}
        ) or ((name, signal.name) == ("BipedalWalker-v3", "vertical_speed"))
        if signal.derivative_of is not None:
            integral = signals[names.index(signal.derivative_of)]
            assert signal.unit == f"{integral.unit}/s"


@pytest.mark.parametrize("name", SIGNAL_PACKS)
def test_a_behaviour_can_be_made_of_a_pack(name):
    signals = signal_pack(name).signals
    foot = next(signal.name for signal in signals if signal.name.endswith("foot_contact"))
    stance = Comparison(foot, ">", 0.5)
    Behaviour(
        "stepping",
        "",
        signals,
        (Phase("S", "stance", stance), Phase("W", "swing", All(Comparison(foot, "<", 0.5)))),
        (Edge("S", "W"), Edge("W", "S")),
    )


def test_an_environment_has_the_pack_of_its_id():
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")
    env = gymnasium.make("Hopper-v5")
    observation, info = env.reset(seed=0)
    pack = signal_pack(env)
    assert pack is SIGNAL_PACKS["Hopper-v5"]
    everything = pack.read(env, observation, info)
    assert tuple(everything) == tuple(signal.name for signal in pack.signals)
    assert all(type(value) is float for value in everything.values())
    some = pack.reader(env, ["knee", "foot_contact"])(observation, info)
    assert some == {name: everything[name] for name in ("knee", "foot_contact")}
    with pytest.raises(ParameterError, match=r"Hopper-v5 has no signal 'left_knee'; did you mean 'knee'"):
        pack.reader(env, ["left_knee"])


def test_what_has_no_pack_is_told_what_has():
    with pytest.raises(ParameterError, match="'Walker2d-v5'"):
        signal_pack("Walker2d-v4")
    with pytest.raises(ParameterError, match=r"CartPole-v1.*functions of your own"):
        signal_pack(gymnasium.make("CartPole-v1"))
    with pytest.raises(ParameterError, match="no id"):
        signal_pack(gymnasium.envs.classic_control.CartPoleEnv())
