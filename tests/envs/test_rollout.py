"""A rollout is the task stepped by hand until the episode ends; a summary is its sums."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.envs.rollout import Trajectory, rollout, summary
from coachable.envs.walking_task import NO_BOX, make_task
from coachable.plants import ConstantTorque, NoTorque
from coachable.rewards.setup import PAPER_SETUPS

pytestmark = pytest.mark.usefixtures("x64")


def by_hand(task, controller):
    step, state, timesteps = eqx.filter_jit(task.step), task.init(), []
    while not timesteps or not timesteps[-1].terminated:
        state, timestep = step(state, controller(task.observation(state)))
        timesteps.append(timestep)
    return jax.tree.map(lambda *leaves: np.stack(leaves), *timesteps)


@pytest.mark.parametrize(
    ("controller", "falls"), [(NoTorque(2), True), (ConstantTorque((-1.35, -0.18)), False)]
)
@pytest.mark.parametrize("clock", ["free", "touchdown"])
@pytest.mark.parametrize("semantics", ["paper", "released-code"])
def test_a_rollout_is_the_task_stepped_by_hand(controller, falls, clock, semantics):
    task = make_task(PAPER_SETUPS["forward+orthant"], semantics, clock=clock, seconds=2.5, box=NO_BOX)
    expected = by_hand(task, controller)

    @jax.jit
    def roll():
        episode = rollout(task, controller)
        return episode, summary(task, episode)

    episode, numbers = roll()
    length = len(expected.time)
    assert numbers.length == length
    assert bool(numbers.fell) == falls
    assert episode.alive.tolist() == [True] * length + [False] * (task.longest_episode - length)
    jax.tree.map(
        lambda ours, theirs: np.testing.assert_allclose(ours[:length], theirs, rtol=1e-10, atol=1e-10),
        episode.timesteps,
        expected,
    )
    np.testing.assert_allclose(numbers.episode_return, expected.reward.sum(), rtol=1e-10)
    np.testing.assert_allclose(numbers.terms, expected.terms.sum(axis=0), rtol=1e-10)
    np.testing.assert_allclose(numbers.terms @ task.weights, numbers.episode_return, rtol=1e-10)
    np.testing.assert_allclose(numbers.share_in_cycle, np.mean(expected.phase < 4))
    for name in ("hip_x", "foot_x", "time"):
        np.testing.assert_allclose(getattr(numbers, name), getattr(expected, name)[-1], atol=1e-10)

    trajectory = Trajectory.of(task, episode)
    assert len(trajectory.time) == length + 1
    np.testing.assert_allclose(trajectory.dtheta_2[1:], expected.observation[:, 3], atol=1e-10)
    np.testing.assert_array_equal(trajectory.phase[1:], expected.phase)
    np.testing.assert_allclose(trajectory.terms["forward"][:-1], expected.terms[:, 3])


def test_a_rollout_may_start_anywhere_and_stop_early():
    task = make_task(PAPER_SETUPS["orthant"])
    state, _ = task.step(task.init(), jnp.array([-1.0, -0.5]))
    episode = jax.jit(lambda state: rollout(task, NoTorque(2), state, num_steps=5))(state)
    assert episode.timesteps.time.shape == (5,)
    np.testing.assert_allclose(episode.timesteps.time[0], 0.02)
