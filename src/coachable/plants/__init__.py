"""The physics: what a plant must provide, the compass walker, and how both are integrated."""

from coachable.plants.compass import PAPER_PARAMETERS as PAPER_PARAMETERS
from coachable.plants.compass import START as START
from coachable.plants.compass import STATE_NAMES as STATE_NAMES
from coachable.plants.compass import CompassParameters as CompassParameters
from coachable.plants.compass import CompassWalker as CompassWalker
from coachable.plants.controllers import ConstantTorque as ConstantTorque
from coachable.plants.controllers import NoTorque as NoTorque
from coachable.plants.controllers import VirtualGravity as VirtualGravity
from coachable.plants.event_search import PAPER_CHATTER as PAPER_CHATTER
from coachable.plants.event_search import ChatterRule as ChatterRule
from coachable.plants.integrate import Advance as Advance
from coachable.plants.integrate import advance as advance
from coachable.plants.outcome import Outcome as Outcome
from coachable.plants.plant import HybridSystem as HybridSystem
from coachable.plants.runge_kutta import rk4 as rk4
