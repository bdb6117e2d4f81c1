"""The description of a movement: signals, predicates, phases and their order. Pure Python."""

from coachable.behaviours.behaviour import Assignment as Assignment
from coachable.behaviours.behaviour import Behaviour as Behaviour
from coachable.behaviours.behaviour import Dwell as Dwell
from coachable.behaviours.behaviour import Edge as Edge
from coachable.behaviours.behaviour import Phase as Phase
from coachable.behaviours.expressions import Constant as Constant
from coachable.behaviours.expressions import Number as Number
from coachable.behaviours.expressions import Variable as Variable
from coachable.behaviours.library import load_behaviour as load_behaviour
from coachable.behaviours.predicates import All as All
from coachable.behaviours.predicates import Any as Any
from coachable.behaviours.predicates import Between as Between
from coachable.behaviours.predicates import Comparison as Comparison
from coachable.behaviours.predicates import Near as Near
from coachable.behaviours.predicates import Not as Not
from coachable.behaviours.predicates import Phrase as Phrase
from coachable.behaviours.predicates import Predicate as Predicate
from coachable.behaviours.predicates import Signal as Signal
from coachable.behaviours.predicates import holds as holds
from coachable.behaviours.predicates import signals_of as signals_of
