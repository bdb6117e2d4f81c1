"""The compass walker of Harnack et al., CDC 2023."""

from coachable.plants.compass.parameters import PAPER_PARAMETERS, START, STATE_NAMES, CompassParameters
from coachable.plants.compass.virtual_gravity import VirtualGravity
from coachable.plants.compass.walker import WALKING_TORQUE, CompassWalker

PLANT = CompassWalker

__all__ = [
    "PAPER_PARAMETERS",
    "PLANT",
    "START",
    "STATE_NAMES",
    "WALKING_TORQUE",
    "CompassParameters",
    "CompassWalker",
    "VirtualGravity",
]
