"""What is exported: a behaviour's automaton on a plant, and what drives it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from coachable.automata.hybrid import TOUCHDOWN, HybridAutomaton
from coachable.automata.latches import has_deadband
from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.expressions import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
)
from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate
from coachable.behaviours.rewriting import expanded
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.learning.policy import Policy
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.plants.equations import Definitions, Equations, decimal
from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import Clock

OUTSIDE = "outside"
CONTROL_DT = 0.01
"""How long a torque is held [s]."""

_CLOSED = {"<": "<=", "<=": "<=", ">": ">=", ">=": ">="}
_OPPOSITE = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}


@dataclass(frozen=True)
class Location:
    """Where the automaton may be."""

    name: str
    """Letters and digits, perhaps with an index: `O1`, `phase_2`."""
    title: str
    """Its title, for people."""
    invariant: Predicate | None
    """Where the state must be; `None` outside all phases."""


@dataclass(frozen=True, eq=False)
class Model:
    """A behaviour's automaton, the plant's flow in each of its locations, and what drives it.

    Bare, without a controller, the torques are free, and the automaton is that of section II of the paper:
    what it does not allow does not happen. With one, a location `outside` is added, which can be entered from
    everywhere and left to everywhere: the closed loop does what it does, and the automaton watches.
    """

    name: str
    behaviour: Behaviour
    controller: Controller | None
    """A learned policy, or a controller that is written down."""
    plant: Plant
    clock: Clock = "free"

    def __post_init__(self):
        if self.plant.equations() is None:
            raise ParameterError(
                f"{self.plant.name} gives no equations as text, so no model of it can be exported"
            )
        for signal in self.behaviour.signal_names:
            if signal not in self.plant.state_names:
                raise ParameterError(
                    f"behaviour {self.behaviour.name!r}: {self.plant.name} has no signal {signal!r}; "
                    + suggestion(signal, self.plant.state_names)
                )
        HybridAutomaton.of(self.behaviour, self.plant)

    @property
    def equations(self) -> Equations:
        """The plant's."""
        equations = self.plant.equations()
        assert equations is not None, "checked at construction"
        return equations

    @property
    def locations(self) -> tuple[Location, ...]:
        """The phases, and outside all of them where there is a controller."""
        phases = tuple(
            Location(_identifier(phase.name, index), phase.title or phase.name, phase.predicate)
            for index, phase in enumerate(self.behaviour.phases)
        )
        return phases if self.controller is None else (*phases, Location(OUTSIDE, "outside all phases", None))

    def edges(self, event: str | None) -> Iterator[tuple[int, int]]:
        """The edges with this event, or those without one: (source, target), counted as the locations are."""
        names, count = self.behaviour.phase_names, len(self.behaviour.phases)
        for edge in self.behaviour.edges:
            if edge.event == event:
                yield names.index(edge.source), names.index(edge.target)
        if self.controller is not None:
            yield from ((phase, count) for phase in range(count))
            yield from ((count, count),) if event == TOUCHDOWN else ((count, phase) for phase in range(count))

    @property
    def controls(self) -> Definitions | None:
        """The controller's formulas, `torque_1`, … among them; `None` for a policy and without a controller.

        **Raises:** `ParameterError` for a controller that gives no formulas.
        """
        match self.controller:
            case None | Policy():
                return None
            case ConstantTorque(torque=torque):
                return {f"torque_{index}": decimal(one) for index, one in enumerate(torque, start=1)}
            case NoTorque():
                return {f"torque_{index}": "0" for index in range(1, len(self.equations.inputs) + 1)}
        formulas = getattr(self.controller, "formulas", None)
        if formulas is None:
            raise ParameterError(
                f"a {type(self.controller).__name__} gives no formulas, so it cannot be exported; "
                "export a policy, a baseline or free inputs"
            )
        return formulas()

    @property
    def bounds(self) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
        """Least and greatest controls of a learned policy, as decimals."""
        if not isinstance(self.controller, Policy):
            return None
        low, high = self.controller.low.tolist(), self.controller.high.tolist()
        return tuple(map(decimal, low)), tuple(map(decimal, high))

    @property
    def start(self) -> int:
        """The location of the plant's start, the first phase that holds there, else outside."""
        phase = self.behaviour.phase_at(self.equations.start)
        names = self.behaviour.phase_names
        return len(names) if phase is None else names.index(phase)

    @property
    def _remembers(self) -> bool:
        return any(phase.dwell or has_deadband(phase.predicate) for phase in self.behaviour.phases)

    @property
    def driven_by(self) -> str:
        """Where the controls come from, in words."""
        words = self.equations.input_words
        if self.controller is None:
            listed = " and ".join(f"{name} ({where})" for name, where in self.equations.inputs.items())
            return f"The {words} {listed} are free inputs."
        also = ", and at each touchdown, where the clock restarts" if self.clock == "touchdown" else ""
        what = "a learned network" if isinstance(self.controller, Policy) else "a formula"
        return f"The {words} come from {what}, sampled every {CONTROL_DT:g} s{also}, and held."

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader of a model in a prover's language must know, a sentence each."""
        network = (
            f"The network is not in the model: at each sample the {self.equations.input_words} are any "
            "numbers within its bounds. So the model does all that the network does, and much more."
        )
        return (
            self.equations.about,
            self.driven_by,
            *((network,) if isinstance(self.controller, Policy) else ()),
            "Invariants are closed: neighbours share their boundary, or no edge could be taken.",
            self.equations.event.remark,
            *(("Deadbands and dwell times are left out.",) if self._remembers else ()),
            "This states a model. It proves nothing.",
        )


def comparison_texts(predicate: Predicate | None) -> list[str] | None:
    """The closure of a predicate as comparisons that hold together, or `None` if it is no conjunction."""
    if predicate is None:
        return []
    match expanded(predicate):
        case Comparison() as comparison:
            return [_comparison(comparison, negated=False)]
        case Not(Comparison() as comparison):
            return [_comparison(comparison, negated=True)]
        case All(parts=parts):
            texts = [comparison_texts(part) for part in parts]
            return None if None in texts else list(dict.fromkeys(t for text in texts if text for t in text))
        case Not(Any(parts=parts)):
            return comparison_texts(All(*map(Not, parts)))
        case Not(Not(part)):
            return comparison_texts(part)
        case _:
            return None


def formula_text(predicate: Predicate, negated: bool = False) -> str:
    """The closure of a predicate, or of its complement, with & and |; negations are driven inwards."""
    match expanded(predicate):
        case Comparison() as comparison:
            return _comparison(comparison, negated)
        case Not(part):
            return formula_text(part, not negated)
        case All(parts=parts) | Any(parts=parts) as joined:
            conjunction = isinstance(joined, All) != negated
            texts = dict.fromkeys(formula_text(part, negated) for part in parts)
            if not texts:
                return "true" if conjunction else "false"
            return (
                f"({(' & ' if conjunction else ' | ').join(texts)})" if len(texts) > 1 else next(iter(texts))
            )
        case other:
            raise TypeError(f"{other!r} is not expanded")


def python_text(predicate: Predicate) -> str:
    """A predicate exactly as it is, in Python."""
    match expanded(predicate):
        case Comparison(left, relation, right):
            return f"{expression_text(left)} {relation} {expression_text(right)}"
        case Not(part):
            return f"not ({python_text(part)})"
        case All(parts=parts):
            return " and ".join(f"({python_text(part)})" for part in parts) or "True"
        case Any(parts=parts):
            return " or ".join(f"({python_text(part)})" for part in parts) or "False"
        case other:
            raise TypeError(f"{other!r} is not expanded")


def expression_text(expression: Expression) -> str:
    """An expression with constants as numbers; functions have two arguments at most."""
    match expression:
        case Number(value) | Constant(number=Number(value)):
            return decimal(value) if value >= 0 else f"({decimal(value)})"
        case Variable(name):
            return name
        case Negative(operand):
            return f"(-{expression_text(operand)})"
        case Arithmetic(left, symbol, right):
            return f"({expression_text(left)} {symbol} {expression_text(right)})"
        case Call(function, (first, *others)):
            text = expression_text(first)
            if not others:
                return f"{function}({text})"
            for other in others:
                text = f"{function}({text}, {expression_text(other)})"
            return text
    raise TypeError(f"{expression!r} is no expression")


def _comparison(comparison: Comparison, negated: bool) -> str:
    relation = _OPPOSITE[comparison.relation] if negated else comparison.relation
    return f"{expression_text(comparison.left)} {_CLOSED[relation]} {expression_text(comparison.right)}"


def _identifier(name: str, index: int) -> str:
    """The phase's own name where every format can read it and it cannot be taken for something else."""
    return name if re.fullmatch(r"[A-Z][A-Za-z]*[0-9]+", name) else f"phase_{index}"
