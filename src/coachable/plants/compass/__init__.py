"""The compass walker of Harnack et al., CDC 2023."""

from coachable.plants.compass.parameters import PAPER_PARAMETERS as PAPER_PARAMETERS
from coachable.plants.compass.parameters import START as START
from coachable.plants.compass.parameters import STATE_NAMES as STATE_NAMES
from coachable.plants.compass.parameters import CompassParameters as CompassParameters
from coachable.plants.compass.virtual_gravity import VirtualGravity as VirtualGravity
from coachable.plants.compass.walker import WALKING_TORQUE as WALKING_TORQUE
from coachable.plants.compass.walker import CompassWalker as CompassWalker

PLANT = CompassWalker
