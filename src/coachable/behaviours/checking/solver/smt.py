"""Questions to the solver Z3: whether predicates can hold together, and where.

A refutation is a proof. A model is not, for the solver has exact numbers and few facts about sines: it
becomes a witness only once `holds` has confirmed it in floats.
"""

from __future__ import annotations

import itertools
import math
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction

import z3

from coachable.behaviours.behaviour import Assignment
from coachable.behaviours.checking.solver import sines
from coachable.behaviours.checking.solver.affine import bound_of, cells_of_bounds, nearest_float, tightest
from coachable.behaviours.checking.solver.encoding import Encoding, Formula, Real, State, Witness
from coachable.behaviours.checking.solver.kinematics import Decision, by_a_hair, decide
from coachable.behaviours.expressions import Expression
from coachable.behaviours.predicates import Comparison, Not, Predicate, holds

Model = typing.Any

_EFFORT = 100_000
"""The solver's resource limit for one answer, which does not depend on the machine."""
_LONGEST = 2_000
"""The time limit for one answer [ms]."""
_PATIENCE = 4
"""The number of answers without a result after which a question is given up."""
_ROUNDS = 10
"""The number of refuted models after which a question is given up."""
_FRIENDLY = tuple(map(Fraction, ("0.1", "-0.1", "1", "-1", "0", "0.5", "-0.5", "2", "-2")))


def _limited(kind: Callable[[], z3.Solver]) -> z3.Solver:
    """A solver with limited effort, which leaves Ctrl-C to Python: its own handler ends but one answer."""
    solver = kind()
    solver.set("rlimit", _EFFORT)
    solver.set("ctrl_c", False)
    return solver


class Question:
    """Requirements on one or several states of a behaviour, and whether they can be met."""

    def __init__(self, signals: Sequence[str]):
        self._signals = tuple(signals)
        self._encoding = Encoding(signals)
        self._required: list[Formula] = []
        self._claims: list[tuple[Predicate, State]] = []
        self._supposed: list[tuple[Predicate, State]] = []
        self._linked = False
        self.shown = False
        """Whether `refuted` found a state that meets the requirements, and whose neighbours show it."""
        self._given_up = 0

    def state(self) -> State:
        """A new state without constraints; a witness is a value of the first one."""
        return self._encoding.state()

    def after(self, state: State, reset: Sequence[Assignment]) -> State:
        """The state right after the signals have jumped."""
        self._linked = True
        return self._encoding.after(state, reset)

    def value(self, expression: Expression, state: State) -> Real:
        """The value of an expression in a state, for `require_that`; its divisors must not be zero."""
        return self._encoding.value(expression, state, [])

    def unknown_number(self) -> Real:
        """A new number without constraints, such as a time."""
        return self._encoding.unknown_number()

    def require(self, predicate: Predicate, state: State) -> None:
        """Require that a predicate holds in a state."""
        self._claims.append((predicate, state))
        self._required.append(self._encoding.truth(predicate, state))

    def suppose(self, predicate: Predicate, state: State) -> None:
        """As `require`, without confirmation in floats: for a boundary on which no float may lie."""
        self._supposed.append((predicate, state))
        self._required.append(self._encoding.truth(predicate, state))

    def require_that(self, fact: Formula) -> None:
        """Require a formula over the states' symbols."""
        self._linked = self._linked or _mentions(fact, self._encoding.free)
        self._required.append(fact)

    def differ(self, one: State, other: State) -> None:
        """Require that two states differ."""
        self._linked = True
        self._required.append(z3.Or([one.symbols[name] != other.symbols[name] for name in self._signals]))

    def refuted(self) -> bool | None:
        """True if it is proven that the requirements cannot be met, `None` if the solver gave up."""
        if self._refuted_without_sines():
            return True
        if (decided := self._decided()) is not None:
            self.shown = decided is not False
            return decided is False
        for _ in range(_ROUNDS):
            answer = self._answer()
            if answer in (z3.unsat, z3.unknown):
                return True if answer == z3.unsat else None
            if self._rounded(answer, self._in_sines()) is not None or not self._corrected_sines(answer):
                return False
        return False

    def witness(self) -> Witness | typing.Literal[False] | None:
        """A state that meets the requirements, False if none can, `None` if that is not known.

        Short numbers are preferred. Every requirement made by `require` has been evaluated at it in floats,
        which may be wrong only where two sines are equal but for a hair; such a state is no witness.
        """
        if self._refuted_without_sines():
            return False
        if isinstance(decided := self._decided(), Mapping) or decided is False:
            return decided
        all_are_left = True
        for _ in range(_ROUNDS):
            answer = self._answer()
            if answer in (z3.unsat, z3.unknown):
                return False if answer == z3.unsat and all_are_left else None
            found = self._rounded(answer, self._encoding.free)
            if found is not None:
                free = {name: nearest_float(value) for name, value in found.items()}
                claims = [(predicate, state.floats(free)) for predicate, state in self._claims]
                if all(holds(one, floats) and not by_a_hair(one, floats) for one, floats in claims):
                    return {signal: free[f"{signal}@0"] for signal in self._signals}
                all_are_left = False
                self._required.append(
                    z3.Or([self._encoding.free[name] != z3.RealVal(value) for name, value in found.items()])
                )
            if not self._corrected_sines(answer) and found is None:
                return None
        return None

    def _refuted_without_sines(self) -> bool:
        """Whether the requirements contradict each other whatever numbers sines and cosines are."""
        if not self._encoding.sines:
            return False
        solver = _limited(z3.SimpleSolver)
        solver.set("timeout", _LONGEST)
        solver.add(*self._required)
        return solver.check() == z3.unsat

    def _decided(self) -> Decision:
        """What branch and bound says, if sines are in the way and each state stands for itself."""
        if not self._encoding.sines or self._linked:
            return None
        of_states: dict[int, list[Predicate]] = {}
        for predicate, state in (*self._claims, *self._supposed):
            of_states.setdefault(id(state), []).append(predicate)
        answers = [decide(self._signals, predicates) for predicates in of_states.values()]
        if any(answer is False for answer in answers):
            return False
        return None if any(answer is None for answer in answers) else answers[0]

    def _answer(self, *further: Formula) -> Model:
        """A model, away from division by zero if there is one, or else `z3.unsat` or `z3.unknown`."""
        facts = [*self._encoding.facts, *self._required, *further]
        if self._encoding.divisors and isinstance(
            model := self._solved([*facts, *(divisor != 0 for divisor in self._encoding.divisors)]),
            z3.ModelRef,
        ):
            return model
        return self._solved(facts)

    def _solved(self, facts: Sequence[Formula]) -> Model:
        # The first solver is quick, and best with sums; the second knows more of products.
        for new_solver in (z3.SimpleSolver, z3.Solver):
            if self._given_up >= 2 * _PATIENCE:
                break
            solver = _limited(new_solver)
            solver.set("timeout", _LONGEST)
            solver.add(*facts)
            answer = solver.check()
            if answer != z3.unknown:
                return solver.model() if answer == z3.sat else answer
            self._given_up += 1
        return z3.unknown

    def _in_sines(self) -> dict[str, Real]:
        """The free signals on which the angles depend."""
        nothing = z3.RealVal(0)
        angles = [angle for angle, _, _ in self._encoding.sines.values()]
        return {
            name: symbol
            for name, symbol in self._encoding.free.items()
            if not all(z3.substitute(angle, (symbol, nothing)).eq(angle) for angle in angles)
        }

    def _rounded(self, model: Model, symbols: Mapping[str, Real]) -> dict[str, Fraction] | None:
        """Short numbers for free signals, one after the other, as long as the rest can still be met."""
        chosen: dict[str, Fraction] = {}
        for name, symbol in symbols.items():
            for value in dict.fromkeys(self._candidates(symbol, model)):
                better = self._answer(*self._pinned({**chosen, name: value}))
                if better not in (z3.unsat, z3.unknown):
                    model, chosen = better, {**chosen, name: value}
                    break
            else:
                return None
        return chosen

    def _candidates(self, symbol: Real, model: Model) -> Iterator[Fraction]:
        """Short numbers, the model's value, and values with which its sines and cosines are true."""
        yield from _FRIENDLY
        wanted = [_fraction(model, symbol)]
        for angle, *pair in self._encoding.sines.values():
            at = [_fraction(model, z3.substitute(angle, (symbol, z3.RealVal(x)))) for x in (0, 1)]
            if at[0] != at[1]:
                sine, cosine = (nearest_float(_fraction(model, term)) for term in pair)
                true, turn = Fraction(math.atan2(sine, cosine)), Fraction(math.tau)
                turns = round((_fraction(model, angle) - true) / turn)
                wanted += [(true + k * turn - at[0]) / (at[1] - at[0]) for k in {turns, 0}]
        for digits in (1, 2, 3, 6):
            yield from (Fraction(f"{nearest_float(value):.{digits}g}") for value in wanted)
        yield from (2 * wanted[0], *wanted)

    def _pinned(self, chosen: Mapping[str, Fraction]) -> Iterator[Formula]:
        values = [(self._encoding.free[name], z3.RealVal(value)) for name, value in chosen.items()]
        yield from (symbol == value for symbol, value in values)
        for angle, *pair in self._encoding.sines.values():
            known: typing.Any = z3.simplify(z3.substitute(angle, *values))
            if z3.is_rational_value(known):
                yield from sines.near(known, known.as_fraction(), *pair)

    def _corrected_sines(self, model: Model) -> bool:
        """Add the sine at every angle where the model has a wrong one; whether there was any."""
        corrected = False
        for angle, *pair in self._encoding.sines.values():
            known = nearest_float(_fraction(model, angle))
            given = [nearest_float(_fraction(model, term)) for term in pair]
            if math.dist(given, (math.sin(known), math.cos(known))) > 1e-9:
                self._required += sines.near(angle, Fraction(known), *pair)
                corrected = True
        return corrected


def _mentions(fact: Formula, free: Mapping[str, Real]) -> bool:
    """Whether a formula is about any of these symbols."""
    waiting = [fact]
    while waiting:
        term = waiting.pop()
        if str(term.decl()) in free:
            return True
        waiting += term.children()
    return False


def _fraction(model: Model, term: Real) -> Fraction:
    value: typing.Any = model.eval(term, model_completion=True)
    if z3.is_algebraic_value(value):
        value = value.approx(20)
    return Fraction(value.as_fraction()) if z3.is_rational_value(value) else Fraction(0)


def _question(signals: Sequence[str], predicates: Sequence[Predicate]) -> Question:
    question = Question(signals)
    state = question.state()
    for predicate in predicates:
        question.require(predicate, state)
    return question


def refuted(signals: Sequence[str], *predicates: Predicate) -> bool | None:
    """True if it is proven that the predicates hold together nowhere, `None` if the solver gave up."""
    return _question(signals, predicates).refuted()


def witness(signals: Sequence[str], *predicates: Predicate) -> Witness | typing.Literal[False] | None:
    """A state in which all the predicates hold, False if there is none, `None` if that is not known."""
    return _question(signals, predicates).witness()


def conflict(signals: Sequence[str], predicates: Sequence[Predicate]) -> tuple[Predicate, ...]:
    """Of predicates that exclude one another, some that do so, too, none of which can be left out."""
    kept = list(predicates)
    for predicate in predicates:
        fewer = [other for other in kept if other is not predicate]
        if refuted(signals, *fewer):
            kept = fewer
    return tuple(kept)


def essence(signals: Sequence[str], predicates: Sequence[Predicate]) -> tuple[Predicate, ...]:
    """The predicates without those that follow from the rest."""
    kept = tightest(predicates)
    for predicate in reversed(kept[:]):
        fewer = [other for other in kept if other is not predicate]
        if refuted(signals, *fewer, Not(predicate)):
            kept = fewer
    return tuple(kept)


def cells(signals: Sequence[str], cuts: Sequence[Comparison], most: int) -> list[tuple[bool, ...]] | None:
    """For which sides of the cuts there is a state; `None` for more than `most`, or if the solver gives up.

    The cuts are comparisons of sums of multiples of signals, all different.
    """
    bounds = [bound for cut in cuts if (bound := bound_of(cut)) is not None]
    if len(bounds) == len(cuts):
        of_bounds = list(itertools.islice(cells_of_bounds(bounds), most + 1))
        return sorted(of_bounds, reverse=True) if len(of_bounds) <= most else None
    encoding = Encoding(signals)
    state = encoding.state()
    facts = [encoding.truth(cut, state) for cut in cuts]
    solver = _limited(z3.SimpleSolver)
    found: list[tuple[bool, ...]] = []

    def search(sides: tuple[bool, ...]) -> bool:
        answer = solver.check()
        if answer != z3.sat:
            return answer == z3.unsat
        if len(sides) == len(facts):
            found.append(sides)
            return len(found) <= most
        for side in (True, False):
            solver.push()
            solver.add(facts[len(sides)] if side else z3.Not(facts[len(sides)]))
            complete = search((*sides, side))
            solver.pop()
            if not complete:
                return False
        return True

    return found if search(()) else None
