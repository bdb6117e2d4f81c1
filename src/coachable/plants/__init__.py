"""The physics: the contract of a plant, its integration through events, and the compass walker."""

from coachable.plants.compass import PAPER_PARAMETERS as PAPER_PARAMETERS
from coachable.plants.compass import START as START
from coachable.plants.compass import STATE_NAMES as STATE_NAMES
from coachable.plants.compass import CompassParameters as CompassParameters
from coachable.plants.compass import CompassWalker as CompassWalker
from coachable.plants.compass import VirtualGravity as VirtualGravity
from coachable.plants.controllers import ConstantTorque as ConstantTorque
from coachable.plants.controllers import NoTorque as NoTorque
from coachable.plants.event_search import PAPER_CHATTER as PAPER_CHATTER
from coachable.plants.event_search import ChatterRule as ChatterRule
from coachable.plants.integrate import Advance as Advance
from coachable.plants.integrate import advance as advance
from coachable.plants.named import plant_class as plant_class
from coachable.plants.outcome import Outcome as Outcome
from coachable.plants.plant import Dynamics as Dynamics
from coachable.plants.plant import Event as Event
from coachable.plants.plant import Plant as Plant
from coachable.plants.runge_kutta import rk4 as rk4
