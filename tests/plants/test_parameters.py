"""Parameters that make no walker are refused by name, and so are signals it does not have."""

from dataclasses import fields

import jax.numpy as jnp
import numpy as np
import pytest

from coachable.foundation.errors import CoachableError, ParameterError
from coachable.plants import STATE_NAMES, CompassParameters, CompassWalker


@pytest.mark.parametrize("name", [field.name for field in fields(CompassParameters)])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), 0, True])
def test_a_bad_parameter_is_refused_by_name(name, value):
    with pytest.raises(ParameterError, match=rf"\b{name}\b") as refusal:
        CompassParameters(**{name: value})
    assert isinstance(refusal.value, CoachableError)
    assert repr(value) in str(refusal.value)


def test_a_huge_parameter_is_refused_and_numpys_numbers_are_numbers():
    with pytest.raises(ParameterError, match="one of some 400 digits"):
        CompassParameters(a=10**400)
    assert CompassParameters(hip_mass=np.float64(2)) == CompassParameters(hip_mass=2.0)


def test_parameters_are_values():
    assert CompassParameters(hip_mass=2) == CompassParameters(hip_mass=2.0)
    assert CompassParameters(a=0.25, b=0.5).leg_length == 0.75
    assert CompassWalker() == CompassWalker()
    assert hash(CompassWalker()) == hash(CompassWalker())


def test_signals_come_by_name_in_the_order_asked_for():
    x = jnp.array([1.0, 2.0, 3.0, 4.0])
    walker = CompassWalker()
    assert walker.signals(x, STATE_NAMES).tolist() == [1, 2, 3, 4]
    assert walker.signals(x, ("dtheta_2", "theta_1")).tolist() == [4, 1]
    with pytest.raises(ParameterError, match=r"'knee'.*theta_1"):
        walker.signals(x, ("theta_1", "knee"))
