import numpy as np
import pytest

from coachable.analysis.paper import PAPER_BASELINE_DISTANCE, paper_curves, paper_numbers

SETUPS = ("sparse", "forward", "orthant", "forward+orthant")


@pytest.mark.parametrize("setup", SETUPS)
def test_the_numbers_are_those_of_the_digitised_curves(setup):
    numbers = paper_numbers()[setup]
    distance, reward = paper_curves("walking_distance")[setup], paper_curves("learning_curves")[setup]
    assert numbers.highest_distance == pytest.approx(distance.value.max(), abs=0.005)
    above = distance.steps[distance.value > PAPER_BASELINE_DISTANCE]
    assert numbers.first_above_baseline == (above[0] if len(above) else np.inf)
    late = reward.steps >= 450_000
    assert numbers.normalised_reward == pytest.approx(
        np.interp(np.arange(450_000, 500_000, 1_000), reward.steps[late], reward.value[late]).mean(), abs=0.01
    )


@pytest.mark.parametrize("setup", SETUPS)
def test_curves_run_forward_and_distances_only_rise(setup):
    distance = paper_curves("walking_distance")[setup]
    assert np.all(np.diff(distance.steps) > 0)
    assert np.all(np.diff(distance.value) >= -0.01)


def test_the_paper_s_baseline_is_a_level_line():
    assert set(paper_curves("walking_distance")["virtual gravity"].value) == {PAPER_BASELINE_DISTANCE}


def test_table_three_as_printed():
    table = [(n.reward_std, n.distance_std) for n in (paper_numbers()[setup] for setup in SETUPS)]
    assert table == [(0.127, 1.302), (0.045, 1.192), (0.039, 0.744), (0.088, 1.173)]
