import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest

from coachable.behaviours import load_behaviour
from coachable.envs import EnvironmentProblem
from coachable.foundation.errors import ParameterError
from coachable.rewards import Potential, Schedule
from coachable.rewards.setup import PAPER_SETUPS, TERM_NAMES, DescribedSetup, RewardSetup, paper_setup


def test_the_papers_table_of_weights():
    assert {name: (setup.forward, setup.orthant) for name, setup in PAPER_SETUPS.items()} == {
        "sparse": (0.0, 0.0),
        "forward": (0.01, 0.0),
        "orthant": (0.0, 0.01),
        "forward+orthant": (0.005, 0.005),
    }
    for name, setup in PAPER_SETUPS.items():
        assert setup.name == name
        assert (setup.jerk, setup.distance, setup.fall) == (-0.001, 1.0, -10.0)


def test_weights_are_in_the_order_of_the_terms():
    setup = RewardSetup("mine", jerk=1, distance=2, fall=3, forward=4, orthant=5)
    assert setup.weights == (1.0, 2.0, 3.0, 4.0, 5.0)
    assert setup.weights == tuple(getattr(setup, term) for term in TERM_NAMES)
    assert all(type(weight) is float for weight in setup.weights)


@pytest.mark.parametrize("term", TERM_NAMES)
@pytest.mark.parametrize("weight", [math.nan, math.inf, -math.inf])
def test_a_weight_is_finite(term, weight):
    with pytest.raises(ParameterError, match=rf"reward setup 'mine': the weight {term} is {weight}"):
        RewardSetup("mine", **{term: weight})


def test_a_setup_has_a_name():
    with pytest.raises(ParameterError, match="needs a name"):
        RewardSetup(" ")


def test_setups_are_values():
    assert RewardSetup("sparse") == PAPER_SETUPS["sparse"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(PAPER_SETUPS["sparse"], "jerk", 0.0)  # noqa: B010


def test_numpys_numbers_make_the_same_setup_with_the_same_hash():
    number = np.float64(0.5)
    given = DescribedSetup(name="mine", weight=number, cycle_bonus=number, terms={"alive": np.float32(0.5)})
    behaviour = load_behaviour("hop")
    problem = EnvironmentProblem(behaviour=behaviour, env="Hop-v0", signals={"height": np.int64(0)})
    mine = DescribedSetup(name="mine", weight=0.5, cycle_bonus=0.5, terms={"alive": 0.5})
    own = EnvironmentProblem(behaviour=behaviour, env="Hop-v0", signals={"height": 0})
    assert problem.reward_hash(given) == own.reward_hash(mine)
    for form in (Potential, Schedule):
        assert repr(form(number).to_data()) == repr(form(0.5).to_data())


def test_a_setup_by_its_name():
    assert paper_setup("orthant") is PAPER_SETUPS["orthant"]
    with pytest.raises(ParameterError, match=r"unknown reward setup 'ortant'; did you mean 'orthant'\?"):
        paper_setup("ortant")
    with pytest.raises(ParameterError, match=r"known: 'sparse', 'forward', 'orthant', 'forward\+orthant'"):
        paper_setup("???")


def test_without_the_tests_type_checks_a_weight_that_is_text_is_refused_and_jax_is_not_needed():
    program = """
import sys
from coachable.foundation.errors import ParameterError
from coachable.rewards.setup import RewardSetup
for weight in ("1", None, True):
    try:
        RewardSetup("mine", fall=weight)
    except ParameterError as error:
        assert f"the weight fall is {weight!r}; give a finite number" in str(error), error
    else:
        raise AssertionError(weight)
assert "jax" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
