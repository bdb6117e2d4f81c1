"""Which lanes train together, with which keys, evaluated when."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.experiments.experiment import Lane
from coachable.experiments.layout import WIDEST_BATCH, batch_sizes, evaluation_steps, lane_key
from coachable.experiments.plan import load_plan


@given(st.integers(1, 500), st.integers(1, 64))
def test_batches_hold_every_lane_in_at_most_two_widths(num_lanes, cores):
    widths = batch_sizes(num_lanes, cores)
    assert sum(widths) == num_lanes
    assert max(widths) <= WIDEST_BATCH
    assert len(set(widths[:-1])) <= 1
    assert widths[-1] <= widths[0]
    assert len(widths) >= min(cores, num_lanes) // 2


@pytest.mark.parametrize("cores", [1, 2, 4])
@pytest.mark.parametrize("plan", ["demo", "paper", "paper-100"])
def test_the_plans_that_ship_need_one_program_and_every_core(plan, cores):
    widths = batch_sizes(len(load_plan(plan).lanes), cores)
    assert len(set(widths)) == 1
    assert len(widths) >= cores


def test_a_remainder_is_avoided_where_a_somewhat_smaller_width_leaves_none():
    assert batch_sizes(15, 2) == (5, 5, 5)
    assert batch_sizes(7, 2) == (4, 3)


def test_a_key_depends_on_seed_and_setup_alone():
    keys = {lane: tuple(np.asarray(lane_key(lane)).tolist()) for lane in load_plan("paper").lanes}
    assert len(set(keys.values())) == len(keys)
    again = load_plan("paper", setups=["orthant"], seeds=3)
    assert all(keys[lane] == tuple(np.asarray(lane_key(lane)).tolist()) for lane in again.lanes)
    # The same on every machine and in every Python: these numbers are what runs were made with.
    assert np.asarray(lane_key(Lane("orthant", 3))).tolist() == [637376516, 2187956011]


def test_the_papers_evaluations_use_the_weights_of_the_last_whole_rollout():
    schedule = evaluation_steps(load_plan("paper"))
    steps = [step for some in schedule.values() for step in some]
    assert steps == [*range(10_000, 500_001, 10_000), 501_760]
    assert all(updates == step // 2048 for updates, some in schedule.items() for step in some)
    assert max(schedule) == load_plan("paper").num_updates == 245
    assert schedule[4] == (10_000,)
    assert schedule[244] == (500_000,)


@given(st.integers(1, 5000), st.integers(1, 3000))
def test_evaluations_come_when_their_step_has_been_trained_and_end_with_the_last_weights(steps, every):
    experiment = load_plan("demo", steps=steps, evaluate_every=every)
    schedule = evaluation_steps(experiment)
    flat = [step for some in schedule.values() for step in some]
    assert flat == sorted(set(flat))
    assert set(range(every, steps + 1, every)) <= set(flat)
    assert schedule[experiment.num_updates][-1] == experiment.total_steps
