"""How long a walker stays up, and from how many of the perturbed starts."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.envs.walking_task import make_task
from coachable.experiments.survival import LARGEST_CHANGE, NUM_STARTS, perturbed_starts, share_up, time_up
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.rewards.setup import PAPER_SETUPS

WALKING = ConstantTorque((-1.35, -0.18))


def task_of(seconds, **options):
    return make_task(PAPER_SETUPS["sparse"], seconds=seconds, **options)


def test_a_walker_is_up_until_it_falls():
    task = task_of(20.0)
    up_for, is_up = time_up(task, WALKING, task.x0)
    assert (float(up_for), bool(is_up)) == (pytest.approx(20.0), True)
    up_for, is_up = time_up(task, NoTorque(2), task.x0)
    assert 0 < float(up_for) < 10
    assert not is_up


@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_the_share_is_that_of_the_starts_taken_one_by_one(clock):
    task = task_of(3.0, clock=clock)
    starts = perturbed_starts(task)[:7]
    one_by_one = [bool(jax.jit(time_up)(task, WALKING, jnp.asarray(x0))[1]) for x0 in starts]
    assert 0 < sum(one_by_one) < 7
    assert float(share_up(task, WALKING, jnp.asarray(starts))) == pytest.approx(np.mean(one_by_one))


def test_the_starts_surround_the_state_after_an_impact_of_the_baseline():
    task = task_of(10.0)
    starts = perturbed_starts(task)
    # The fixed point of continuous virtual gravity; sampling at 100 Hz moves it by some 1e-4.
    after_impact = np.array([0.29917117, -0.29917117, -1.14151641, -0.21486579])
    change = starts / after_impact - 1
    assert starts.shape == (NUM_STARTS, 4)
    assert starts.dtype == task.x0.dtype
    assert np.abs(change).max() < LARGEST_CHANGE + 0.005
    assert np.abs(change).max(axis=0) == pytest.approx(LARGEST_CHANGE, abs=0.005)
    assert np.abs(np.corrcoef(change.T) - np.eye(4)).max() < 0.1
    assert np.array_equal(starts, perturbed_starts(task))
