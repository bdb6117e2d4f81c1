"""For which states before touchdown an edge is taken at once, in the automaton bound to its plant."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from coachable.automata.execution import execute
from coachable.automata.hybrid import TOUCHDOWN, HybridAutomaton
from coachable.behaviours.behaviour import Behaviour, Edge, Phase
from coachable.behaviours.checking.comparison import Answer, State
from coachable.behaviours.checking.solver.encoding import State as Moment
from coachable.behaviours.checking.solver.smt import Question
from coachable.behaviours.expressions import Arithmetic, Call, Number, Variable
from coachable.behaviours.notation import pretty_name, pretty_predicate
from coachable.behaviours.predicates import OPERATORS, All, Comparison, Not, Predicate, Signal, holds
from coachable.behaviours.rewriting import conjuncts
from coachable.foundation.errors import BehaviourError
from coachable.plants.impact_algebra import ImpactAlgebra
from coachable.plants.plant import Plant

Occurrence = Literal["always", "never", "sometimes", "unknown"]

_NEGLIGIBLE = 1e-12
"""A coefficient below it is what rounding leaves of zero."""


@dataclass(frozen=True)
class Bound:
    """Σ pᵢ(c) vᵢ ⋚ r(c) of the velocities vᵢ right before the impact, c the cosine of `ImpactAlgebra`.

    Each polynomial is given by its coefficients of c², c and 1.
    """

    left: Mapping[str, tuple[float, float, float]]
    """pᵢ by the velocity's name."""
    words: Mapping[str, str]
    """What each of them is the velocity of, by its name."""
    relation: str
    right: tuple[float, float, float]

    def holds(self, cos: float, velocities: Mapping[str, float]) -> bool:
        """Whether velocities before the impact fulfil it."""

        def at(polynomial: tuple[float, float, float]) -> float:
            return (polynomial[0] * cos + polynomial[1]) * cos + polynomial[2]

        left = sum(at(polynomial) * velocities[name] for name, polynomial in self.left.items())
        return OPERATORS[self.relation](left, at(self.right))

    def __str__(self) -> str:
        products = [
            f"({text}) {pretty_name(name)}"
            if " " in text.lstrip("−").replace(" c", "c")
            else f"{text} {pretty_name(name)}"
            for name, text in ((name, _polynomial_text(one)) for name, one in self.left.items())
            if text != "0"
        ]
        left = " + ".join(products).replace("+ −", "− ")
        return (
            pretty_predicate(Comparison("left", self.relation, "right"))
            .replace("left", left)
            .replace("right", _polynomial_text(self.right))
        )


@dataclass(frozen=True)
class Condition:
    """One part of the invariant that an edge leads to, right after the impact."""

    part: Predicate
    verdict: Occurrence
    """Whether it holds after every touchdown in the edge's source."""
    before: Bound | None
    """The same as a condition on the velocities right before the impact, if it is linear in them."""


@dataclass(frozen=True)
class Jump:
    """A touchdown: the signals right before and right after it, as the plant computes them."""

    before: State
    after: State


@dataclass(frozen=True)
class EdgeAtImpact:
    """Whether an edge is taken in the instant of a touchdown that happens in its source."""

    edge: Edge
    verdict: Occurrence
    conditions: tuple[Condition, ...]
    taken: Jump | None
    """A touchdown at which it is."""
    refused: Jump | None
    """A touchdown at which it is not."""
    gait: Jump | None
    """The touchdown of the baseline's gait."""
    baseline: str
    """The name of the controller whose gait that is."""
    cosine: str
    """What c is, and what holds of the angles at touchdown."""

    @property
    def sentences(self) -> tuple[str, ...]:
        """The answer for people."""
        return tuple(_sentences(self))

    @property
    def data(self) -> Mapping[str, object]:
        """The answer for programs."""
        return {
            "edge": str(self.edge),
            "verdict": self.verdict,
            "conditions": [
                {
                    "after": str(one.part),
                    "verdict": one.verdict,
                    "before": None if one.before is None else _bound_data(one.before),
                }
                for one in self.conditions
            ],
            **{name: _jump_data(getattr(self, name)) for name in ("taken", "refused", "gait")},
        }


def explain_edges_at_impact(automaton: HybridAutomaton) -> tuple[EdgeAtImpact, ...]:
    """`explain_edge_at_impact` for every edge of an automaton that is taken at touchdown."""
    gait = gait_touchdown(_plant_of(automaton)[0])
    return tuple(
        explain_edge_at_impact(automaton, edge, gait) for edge in automaton.edges if edge.event == TOUCHDOWN
    )


def explain_edge_at_impact(automaton: HybridAutomaton, edge: Edge, gait: State | None = None) -> EdgeAtImpact:
    """For which states before touchdown an edge is taken at once.

    The plant's `ImpactAlgebra` maps the velocities linearly, with coefficients that are rational in the
    cosine c of a difference of angles. Z3 decides, with c a number on the unit circle; each state that it
    finds is confirmed with the plant's reset map.

    **Arguments:** `gait`: the state right before a touchdown of a gait, to be judged as well.

    **Raises:** `BehaviourError` if the edge is not taken at touchdown, or the plant gives no algebra of its
    impact.
    """
    if edge.event != TOUCHDOWN:
        raise BehaviourError(f"edge {edge}: it is not taken on {TOUCHDOWN}, so its touchdowns are none")
    plant, algebra = _plant_of(automaton)
    touchdowns = _Touchdowns(plant, algebra, automaton.invariants[edge.source])
    target = automaton.invariants[edge.target]
    taken, refused = touchdowns.one(target), touchdowns.one(Not(target))
    conditions = []
    for part in conjuncts(target):
        verdict = _verdict(touchdowns.one(part), touchdowns.one(Not(part)))
        conditions.append(Condition(part, verdict, _before(part, algebra)))
    return EdgeAtImpact(
        edge=edge,
        verdict=_verdict(taken, refused),
        conditions=tuple(conditions),
        taken=None if taken.state is None else touchdowns.jump(taken.state),
        refused=None if refused.state is None else touchdowns.jump(refused.state),
        gait=None if gait is None else touchdowns.jump(gait),
        baseline=next(iter(plant.controllers())),
        cosine=_cosine_text(algebra),
    )


def gait_touchdown(plant: Plant, seconds: float = 4.0) -> State | None:
    """The state right before the last touchdown of the baseline's gait from x₀, if there is any."""
    anywhere = Behaviour(
        name="anywhere",
        description="",
        signals=tuple(map(Signal, plant.state_names)),
        phases=(Phase("anywhere", "", All()),),
        edges=(Edge("anywhere", "anywhere", TOUCHDOWN),),
    )
    baseline = next(iter(plant.controllers().values()))
    execution = execute(HybridAutomaton.of(anywhere, plant), plant.start, baseline, seconds)
    if not execution.transitions:
        return None
    # A transition has two rows of its time; the first is before it.
    row = int(np.searchsorted(execution.times, execution.transitions[-1].time))
    return dict(zip(plant.state_names, execution.states[row].tolist(), strict=True))


@dataclass(frozen=True)
class _Touchdowns:
    """The touchdowns of a plant that happen in a location."""

    plant: Plant
    algebra: ImpactAlgebra
    source: Predicate

    def one(self, target: Predicate) -> Answer:
        """A touchdown after which a predicate holds, of a usual step if possible."""
        usual = self._one_between(*self.algebra.usual, target)
        return usual if usual.state is not None else self._one_between(*self.algebra.possible, target)

    def _one_between(self, lowest: float, highest: float, target: Predicate) -> Answer:
        algebra, names = self.algebra, self.plant.state_names
        question = Question(names)
        before = question.state()
        first, second = (before.symbols[name] for name in algebra.angles)
        bounded = before.symbols[algebra.bounded]
        together = first == (-second if algebra.mirrored else second)
        for fact in (together, bounded >= lowest, bounded <= highest):
            question.require_that(fact)
        cos = question.value(Call("cos", Arithmetic(*_difference(algebra))), before)
        velocities = algebra.after(cos, [before.symbols[name] for name in algebra.linear])
        changed = dict(zip(algebra.linear, velocities, strict=True)) | {
            name: before.symbols[old] for name, old in algebra.swapped.items()
        }
        after = Moment(
            {name: changed[name] for name in names},
            # The witness is judged by the plant itself, not by what the solver made of it.
            lambda free: self.jump(before.floats(free)).after,
        )
        question.require(self.source, before)
        question.require(target, after)
        witness = question.witness()
        return Answer(witness or None, decided=witness is not None)

    def jump(self, before: State) -> Jump:
        """What the plant's impact does to a state, in float64."""
        with jax.enable_x64(True):
            x = jnp.array([before[name] for name in self.plant.state_names], jnp.float64)
            after = self.plant.events[0].reset(x)
        return Jump(before, dict(zip(self.plant.state_names, np.asarray(after).tolist(), strict=True)))


def _difference(algebra: ImpactAlgebra) -> tuple[Variable, Literal["-"], Variable]:
    first, second = algebra.angles
    return Variable(first), "-", Variable(second)


def _cosine_text(algebra: ImpactAlgebra) -> str:
    first, second = map(pretty_name, algebra.angles)
    return f"c = cos({first} − {second}), {first} = {'−' if algebra.mirrored else ''}{second}"


def _bound_data(bound: Bound) -> Mapping[str, object]:
    left = {bound.words[name]: polynomial for name, polynomial in bound.left.items()}
    return {**left, "relation": bound.relation, "right": bound.right}


def _jump_data(jump: Jump | None) -> Mapping[str, Mapping[str, float]] | None:
    return None if jump is None else {"before": dict(jump.before), "after": dict(jump.after)}


def _plant_of(automaton: HybridAutomaton) -> tuple[Plant, ImpactAlgebra]:
    plant = automaton.plant
    algebra = plant.impact_algebra() if isinstance(plant, Plant) else None
    if not isinstance(plant, Plant) or algebra is None:
        name = getattr(plant, "name", "this plant")
        raise BehaviourError(
            "edges at touchdown are explained for a plant that gives its reset map as arithmetic, that of "
            f"touchdowns with the feet apart, and {name} gives none"
        )
    return plant, algebra


def _verdict(holding: Answer, failing: Answer) -> Occurrence:
    if holding.state is not None and failing.state is not None:
        return "sometimes"
    if holding.state is not None and failing.decided:
        return "always"
    return "never" if holding.state is None and holding.decided else "unknown"


def _before(part: Predicate, algebra: ImpactAlgebra) -> Bound | None:
    """A bound on a velocity after the impact, times the algebra's scale, which is positive."""
    match part:
        case Comparison(Variable(signal), relation, Number(bound)) if signal in algebra.linear:
            which = list(algebra.linear).index(signal)
        case _:
            return None

    def coefficient(velocity: str) -> tuple[float, float, float]:
        alone = [1.0 if name == velocity else 0.0 for name in algebra.linear]
        return _polynomial(lambda c: algebra.after(c, alone)[which] * algebra.scale(c))

    right = _polynomial(lambda c: bound * algebra.scale(c))
    return Bound({name: coefficient(name) for name in algebra.linear}, algebra.linear, relation, right)


def _polynomial(function: Callable[[float], float]) -> tuple[float, float, float]:
    """The coefficients of a polynomial of degree two at most, from its values at 0, 1 and −1."""
    at_0, at_1, at_minus_1 = function(0.0), function(1.0), function(-1.0)
    return (at_1 + at_minus_1) / 2 - at_0, (at_1 - at_minus_1) / 2, at_0


def _polynomial_text(polynomial: tuple[float, float, float]) -> str:
    terms = [
        f"{_number(value)}{power}"
        for value, power in zip(polynomial, (" c²", " c", ""), strict=True)
        if abs(value) > _NEGLIGIBLE
    ]
    return " + ".join(terms).replace("+ −", "− ") or "0"


def _sentences(found: EdgeAtImpact) -> Iterator[str]:
    edge = f"{found.edge.source} → {found.edge.target}"
    needed = [one for one in found.conditions if one.verdict != "always"]
    match found.verdict:
        case "always":
            yield f"{edge} is taken in the instant of every touchdown in {found.edge.source}."
        case "never":
            yield f"{edge} is taken in the instant of no touchdown in {found.edge.source}."
        case "unknown":
            yield f"Whether {edge} is taken in the instant of a touchdown is unknown to Z3. It would need"
        case _:
            yield f"{edge} is taken in the instant of a touchdown exactly where"
    if found.verdict != "always":
        for one in needed:
            before = "" if one.before is None else f", that is {one.before} right before it"
            never = ", which never is" if one.verdict == "never" else ""
            yield f"  {pretty_predicate(one.part)} right after it{before}{never}"
        if any(one.before is not None for one in needed):
            yield f"  where {found.cosine}"
    for does, jump in (("is", found.taken), ("is not", found.refused)):
        if jump is not None:
            yield f"It {does} taken at {_listing(jump.before)}: right after, {_listing(jump.after)}."
    if found.gait is not None:
        misses = [pretty_predicate(one.part) for one in needed if not holds(one.part, found.gait.after)]
        why = f" does not take it, for it misses {' and '.join(misses)}" if misses else " takes it"
        yield (
            f"The {found.baseline} gait{why}: "
            f"{_listing(found.gait.before)} becomes {_listing(found.gait.after)}."
        )


def _listing(state: State) -> str:
    return "(" + ", ".join(f"{pretty_name(name)} = {_number(value)}" for name, value in state.items()) + ")"


def _number(value: float) -> str:
    return f"{value:.4g}".replace("-", "−")
