"""The compass walker of Harnack et al., CDC 2023."""

from coachable.plants.compass.walker import PAPER_PARAMETERS as PAPER_PARAMETERS
from coachable.plants.compass.walker import START as START
from coachable.plants.compass.walker import STATE_NAMES as STATE_NAMES
from coachable.plants.compass.walker import CompassParameters as CompassParameters
from coachable.plants.compass.walker import CompassWalker as CompassWalker
