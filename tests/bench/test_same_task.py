"""The benchmark's opponent, written independently on SciPy, is our task: states, rewards, endings."""

import equinox as eqx
import jax
import numpy as np
import pytest

from bench.scipy_walker import FLOWS, ScipyWalker
from coachable.envs.walking_task import make_task
from coachable.rewards.setup import PAPER_SETUPS

pytestmark = pytest.mark.usefixtures("x64")


def random_torques(seed, num_steps):
    """Torques beyond the box on both sides, so that clipping is part of the task."""
    return np.random.default_rng(seed).uniform(-2.5, 0.5, (num_steps, 2))


TORQUES = {
    "constant": np.tile([-1.35, -0.18], (1000, 1)),
    **{f"random {seed}": random_torques(seed, 1000) for seed in range(6)},
}


@pytest.fixture(scope="module")
def task():
    with jax.enable_x64(True):
        return make_task(PAPER_SETUPS["orthant"])


@pytest.fixture(scope="module")
def step(task):
    return eqx.filter_jit(task.step)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("torques", TORQUES.values(), ids=TORQUES)
def test_an_episode_is_the_same(task, step, flow, torques):
    state = task.init(jax.random.key(0))
    walker = ScipyWalker(FLOWS[flow])
    walker.reset()
    for torque in torques:
        state, ours = step(state, torque)
        _, reward, terminated, _, _ = walker.step(torque)
        np.testing.assert_allclose(ours.observation, walker.x, atol=1e-5)
        np.testing.assert_allclose(ours.reward, reward, atol=1e-5)
        np.testing.assert_allclose(ours.hip_x, walker.hip_x, atol=1e-5)
        assert bool(ours.terminated) == terminated
        if terminated:
            break
    assert terminated, "an episode ends within ten seconds"


def test_the_episodes_compared_include_falls_and_a_whole_walk():
    walker = ScipyWalker(FLOWS["scalar"])
    lengths = {}
    for name, torques in TORQUES.items():
        walker.reset()
        lengths[name] = 1 + [walker.step(torque)[2] for torque in torques].index(True)
    assert lengths["constant"] == 1000
    assert all(length < 1000 for name, length in lengths.items() if name != "constant")
