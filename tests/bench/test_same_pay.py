"""The wrappers that are timed beside ours pay the same, step for step, on the same walks."""

import gymnasium
import pytest

from bench.programs import wrapped_steps

pytest.importorskip("mujoco", reason="needs the [mujoco] extra")
pytest.importorskip("rtamt", reason="needs the [bench] extra")
pytest.importorskip("pycrm", reason="needs the [bench] extra")

from bench.two_feet import ENVIRONMENT, TWO_FEET, WRAPPERS
from coachable.envs.behaviour_reward import BehaviourReward


def paid(wrapper, num_steps=400):
    env = wrapper(gymnasium.make(ENVIRONMENT))
    env.reset(seed=0)
    env.action_space.seed(0)
    rewards = []
    for _ in range(num_steps):
        _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        rewards.append(reward)
        if terminated or truncated:
            env.reset()
    return rewards


@pytest.mark.parametrize("name", ["rtamt, online", "pyrewardmachines"])
def test_others_pay_what_coachable_pays(name):
    expected = paid(WRAPPERS["coachable"])
    assert paid(WRAPPERS[name]) == pytest.approx(expected)
    base = paid(lambda env: env)
    assert {round(ours - alone) for ours, alone in zip(expected, base, strict=True)} == {-1, 1}


def test_the_walks_come_through_all_phases():
    env = BehaviourReward(gymnasium.make(ENVIRONMENT), TWO_FEET)
    env.reset(seed=0)
    env.action_space.seed(0)
    seen = set()
    for _ in range(400):
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        seen.add(info["behaviour"]["phase"])
        if terminated or truncated:
            env.reset()
    assert seen == {"left", "both", "right", "outside"}


def test_all_are_timed_over_the_same_steps():
    works, units = wrapped_steps.prepare(30, list(WRAPPERS))
    assert units == 30
    assert list(works) == ["alone", *(f"with {name}" for name in WRAPPERS)]
    for work in works.values():
        work()
