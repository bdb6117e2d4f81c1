"""A real walk: the virtual gravity controller's, ten seconds of it."""

import pytest

from coachable.behaviours.library import load_behaviour
from coachable.drawing.motion import Motion
from coachable.envs.baselines import baseline
from coachable.plants.compass import PAPER_PARAMETERS, CompassWalker


@pytest.fixture(scope="session")
def columns():
    """The trajectory as a run folder stores it."""
    return baseline("virtual-gravity").trajectory.columns()


@pytest.fixture(scope="session")
def motion_of():
    """The compass walker's motion along columns, as a function of them and of its parameters."""

    def motion(columns, parameters=PAPER_PARAMETERS):
        return Motion.of(CompassWalker(parameters), columns)

    return motion


@pytest.fixture(scope="session")
def motion(columns, motion_of):
    return motion_of(columns)


@pytest.fixture(scope="session")
def phases():
    return load_behaviour("compass-walking").phases


@pytest.fixture(scope="session")
def until(motion):
    """The first part of the motion, as a function of its length in seconds."""

    def first(seconds):
        return motion.part(0, motion.at(seconds) + 1)

    return first
