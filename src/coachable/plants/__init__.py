"""The physics: the contract of a plant, its integration through events, and the compass walker."""

from coachable.plants.compass import (
    PAPER_PARAMETERS,
    START,
    STATE_NAMES,
    CompassParameters,
    CompassWalker,
    VirtualGravity,
)
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.plants.disturbances import Disturbances, Kick
from coachable.plants.equations import Equations
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.impact_algebra import ImpactAlgebra
from coachable.plants.integrate import Advance, advance
from coachable.plants.named import make_plant, plant_class, plant_names
from coachable.plants.outcome import Outcome
from coachable.plants.plant import Controller, Dynamics, Event, Plant
from coachable.plants.restated import Restated
from coachable.plants.runge_kutta import rk4
from coachable.plants.skeleton import PointMass, Segment, Skeleton

__all__ = [
    "PAPER_CHATTER",
    "PAPER_PARAMETERS",
    "START",
    "STATE_NAMES",
    "Advance",
    "ChatterRule",
    "CompassParameters",
    "CompassWalker",
    "ConstantTorque",
    "Controller",
    "Disturbances",
    "Dynamics",
    "Equations",
    "Event",
    "ImpactAlgebra",
    "Kick",
    "NoTorque",
    "Outcome",
    "Plant",
    "PointMass",
    "Restated",
    "Segment",
    "Skeleton",
    "VirtualGravity",
    "advance",
    "make_plant",
    "plant_class",
    "plant_names",
    "rk4",
]
