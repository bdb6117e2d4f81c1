"""A real walk: the virtual gravity controller's, ten seconds of it."""

import pytest

from coachable.behaviours.library import load_behaviour
from coachable.envs.baselines import baseline


@pytest.fixture(scope="session")
def trajectory():
    return baseline("virtual-gravity").trajectory


@pytest.fixture(scope="session")
def columns(trajectory):
    """The same as a run folder keeps it."""
    names = ("theta_1", "theta_2", "dtheta_1", "dtheta_2", "foot_x", "phase")
    return {"t": trajectory.time} | {name: getattr(trajectory, name) for name in names}


@pytest.fixture(scope="session")
def phases():
    return load_behaviour("compass-walking").phases


@pytest.fixture(scope="session")
def until(columns):
    """The first part of the walk, as a function of its length in seconds."""

    def first(seconds):
        kept = columns["t"] <= seconds + 1e-9
        return {name: column[kept] for name, column in columns.items()}

    return first
