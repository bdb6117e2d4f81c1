import numpy as np
import pytest

from tests.verification.certificate import simulator
from tests.verification.certificate.claims import STEP


@pytest.fixture(scope="session", params=[False, True], ids=["continuous", "held"])
def gait(request):
    """Virtual gravity's fixed point, eigenvectors, controller, and whether it is held, from the simulator."""
    torque = simulator.virtual_gravity()
    y, jacobian = simulator.fixed_point(torque, request.param, np.array([0.299, -1.14, -0.215]), float(STEP))
    return y, simulator.eigenbasis(jacobian), torque, request.param


@pytest.fixture(scope="session")
def held_gait():
    """The same, held."""
    torque = simulator.virtual_gravity()
    y, jacobian = simulator.fixed_point(torque, True, np.array([0.299, -1.14, -0.215]), float(STEP))
    return y, simulator.eigenbasis(jacobian), torque
