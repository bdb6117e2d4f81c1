"""The description of a movement: signals, predicates, phases and their order. Pure Python."""

from coachable.behaviours.behaviour import Assignment, Behaviour, Dwell, Edge, Phase, Symmetry
from coachable.behaviours.expressions import Constant, Number, Variable
from coachable.behaviours.library import load_behaviour
from coachable.behaviours.predicates import (
    All,
    Any,
    Between,
    Comparison,
    Near,
    Not,
    Phrase,
    Predicate,
    Signal,
    holds,
    signals_of,
)

__all__ = [
    "All",
    "Any",
    "Assignment",
    "Behaviour",
    "Between",
    "Comparison",
    "Constant",
    "Dwell",
    "Edge",
    "Near",
    "Not",
    "Number",
    "Phase",
    "Phrase",
    "Predicate",
    "Signal",
    "Symmetry",
    "Variable",
    "holds",
    "load_behaviour",
    "signals_of",
]
