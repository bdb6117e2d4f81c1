"""The SMT solver Z3 for predicates over signals: whether they can hold together, and where."""

from coachable.behaviours.checking.solver.affine import affine as affine
from coachable.behaviours.checking.solver.affine import bound_of as bound_of
from coachable.behaviours.checking.solver.affine import cut_of as cut_of
from coachable.behaviours.checking.solver.affine import decimal as decimal
from coachable.behaviours.checking.solver.affine import is_affine as is_affine
from coachable.behaviours.checking.solver.affine import nearest_float as nearest_float
from coachable.behaviours.checking.solver.corners import without_corners as without_corners
from coachable.behaviours.checking.solver.encoding import State as State
from coachable.behaviours.checking.solver.encoding import Witness as Witness
from coachable.behaviours.checking.solver.encoding import exact as exact
from coachable.behaviours.checking.solver.smt import Question as Question
from coachable.behaviours.checking.solver.smt import cells as cells
from coachable.behaviours.checking.solver.smt import conflict as conflict
from coachable.behaviours.checking.solver.smt import essence as essence
from coachable.behaviours.checking.solver.smt import refuted as refuted
from coachable.behaviours.checking.solver.smt import witness as witness
