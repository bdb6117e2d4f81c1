"""For which states before touchdown does an edge hold at once? Asked of the automaton bound to its plant."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
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
from coachable.plants.compass import START, STATE_NAMES, CompassWalker, VirtualGravity

Verdict = Literal["always", "never", "sometimes", "unknown"]

_COS_ALPHA = Call("cos", Arithmetic(Variable("theta_1"), "-", Variable("theta_2")))
_LOWEST, _STEEPEST, _USUAL = 1e-9, 1.57, (0.1, 0.4)
"""Bounds on θ₂ at touchdown [rad]: above 0; below π/2, where the walker has fallen; and of usual steps."""

_NEGLIGIBLE = 1e-12
"""A coefficient below it is what rounding leaves of zero."""


@dataclass(frozen=True)
class Bound:
    """p(c) θ̇₁ + q(c) θ̇₂ ⋚ r(c) of the velocities right before the impact, where c = cos(θ₁ − θ₂).

    Each polynomial is given by what stands before c², before c, and alone.
    """

    stance: tuple[float, float, float]
    swing: tuple[float, float, float]
    relation: str
    right: tuple[float, float, float]

    def holds(self, cos: float, dtheta_1: float, dtheta_2: float) -> bool:
        """Whether velocities before the impact fulfil it."""

        def at(polynomial: tuple[float, float, float]) -> float:
            return (polynomial[0] * cos + polynomial[1]) * cos + polynomial[2]

        left = at(self.stance) * dtheta_1 + at(self.swing) * dtheta_2
        return OPERATORS[self.relation](left, at(self.right))

    def __str__(self) -> str:
        names = [pretty_name(name) for name in STATE_NAMES[2:]]
        products = [
            f"({text}) {name}" if " " in text.lstrip("−").replace(" c", "c") else f"{text} {name}"
            for text, name in zip(map(_polynomial_text, (self.stance, self.swing)), names, strict=True)
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
    verdict: Verdict
    """Whether it holds after every touchdown in the edge's source."""
    before: Bound | None
    """The same said of the velocities right before the impact, if it is linear in them."""


@dataclass(frozen=True)
class Jump:
    """A touchdown: the signals right before and right after it, as the plant computes them."""

    before: State
    after: State


@dataclass(frozen=True)
class Crossing:
    """Whether an edge is taken in the instant of a touchdown that happens in its source."""

    edge: Edge
    verdict: Verdict
    conditions: tuple[Condition, ...]
    taken: Jump | None
    """A touchdown at which it is."""
    refused: Jump | None
    """A touchdown at which it is not."""
    gait: Jump | None
    """The touchdown of the virtual-gravity gait."""

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
                    "before": None if one.before is None else asdict(one.before),
                }
                for one in self.conditions
            ],
            **{name: _jump_data(getattr(self, name)) for name in ("taken", "refused", "gait")},
        }


def explain_crossings(automaton: HybridAutomaton) -> tuple[Crossing, ...]:
    """`explain_crossing` for every edge of an automaton that is taken at touchdown."""
    gait = gait_touchdown(_walker_of(automaton))
    return tuple(
        explain_crossing(automaton, edge, gait) for edge in automaton.edges if edge.event == TOUCHDOWN
    )


def explain_crossing(automaton: HybridAutomaton, edge: Edge, gait: State | None = None) -> Crossing:
    """For which states before touchdown an edge of the compass walker holds at once.

    At touchdown both feet are on the ground, so θ₁ = −θ₂, and the impact maps the velocities linearly, with
    coefficients that are rational in c = cos(θ₁ − θ₂). Z3 decides, with c a number on the unit circle; each
    state that it finds is confirmed with `plant.impact`.

    **Arguments:** `gait`: the state right before a touchdown of a gait, to be judged as well.

    **Raises:** `BehaviourError` if the edge is not taken at touchdown, or the plant is no compass walker.
    """
    if edge.event != TOUCHDOWN:
        raise BehaviourError(f"edge {edge}: it is not taken on {TOUCHDOWN}, so it cannot be asked about that")
    touchdowns = _Touchdowns(_walker_of(automaton), automaton.invariants[edge.source])
    target = automaton.invariants[edge.target]
    taken, refused = touchdowns.one(target), touchdowns.one(Not(target))
    conditions = []
    for part in conjuncts(target):
        verdict = _verdict(touchdowns.one(part), touchdowns.one(Not(part)))
        conditions.append(Condition(part, verdict, _before(part, touchdowns.walker)))
    return Crossing(
        edge=edge,
        verdict=_verdict(taken, refused),
        conditions=tuple(conditions),
        taken=None if taken.state is None else touchdowns.jump(taken.state),
        refused=None if refused.state is None else touchdowns.jump(refused.state),
        gait=None if gait is None else touchdowns.jump(gait),
    )


def gait_touchdown(walker: CompassWalker, seconds: float = 4.0) -> State | None:
    """The state right before the last touchdown of the virtual-gravity gait from x₀, if there is any."""
    anywhere = Behaviour(
        name="anywhere",
        description="",
        signals=tuple(map(Signal, STATE_NAMES)),
        phases=(Phase("anywhere", "", All()),),
        edges=(Edge("anywhere", "anywhere", TOUCHDOWN),),
    )
    execution = execute(HybridAutomaton.of(anywhere, walker), START, VirtualGravity(walker), seconds)
    if not execution.transitions:
        return None
    # A transition has two rows of its time; the first is before it.
    row = int(np.searchsorted(execution.times, execution.transitions[-1].time))
    return dict(zip(STATE_NAMES, execution.states[row].tolist(), strict=True))


@dataclass(frozen=True)
class _Touchdowns:
    """The touchdowns of a walker that happen in a location."""

    walker: CompassWalker
    source: Predicate

    def one(self, target: Predicate) -> Answer:
        """A touchdown after which a predicate holds, of a usual step if possible."""
        usual = self._one_between(*_USUAL, target)
        return usual if usual.state is not None else self._one_between(_LOWEST, _STEEPEST, target)

    def _one_between(self, lowest: float, highest: float, target: Predicate) -> Answer:
        question = Question(STATE_NAMES)
        before = question.state()
        theta_1, theta_2, dtheta_1, dtheta_2 = (before.symbols[name] for name in STATE_NAMES)
        for fact in (theta_1 == -theta_2, theta_2 >= lowest, theta_2 <= highest):
            question.require_that(fact)
        cos = question.value(_COS_ALPHA, before)
        velocities = self.walker.velocities_after_impact(cos, dtheta_1, dtheta_2)
        after = Moment(
            dict(zip(STATE_NAMES, (theta_2, theta_1, *velocities), strict=True)),
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
            x = jnp.array([before[name] for name in STATE_NAMES], jnp.float64)
            after = self.walker.impact(x)
        return Jump(before, dict(zip(STATE_NAMES, np.asarray(after).tolist(), strict=True)))


def _jump_data(jump: Jump | None) -> Mapping[str, Mapping[str, float]] | None:
    return None if jump is None else {"before": dict(jump.before), "after": dict(jump.after)}


def _walker_of(automaton: HybridAutomaton) -> CompassWalker:
    plant = automaton.plant
    if not isinstance(plant, CompassWalker) or plant.backward_passing_counts:
        raise BehaviourError(
            "crossings are explained for the compass walker whose touchdowns have both feet apart"
        )
    return plant


def _verdict(holding: Answer, failing: Answer) -> Verdict:
    if holding.state is not None and failing.state is not None:
        return "sometimes"
    if holding.state is not None and failing.decided:
        return "always"
    return "never" if holding.state is None and holding.decided else "unknown"


def _before(part: Predicate, walker: CompassWalker) -> Bound | None:
    """A bound on a velocity after the impact, times the reduced inertia, which is positive."""
    match part:
        case Comparison(Variable(signal), relation, Number(bound)) if signal in STATE_NAMES[2:]:
            which = STATE_NAMES.index(signal) - 2
        case _:
            return None

    def coefficient(*velocities: float) -> tuple[float, float, float]:
        return _polynomial(
            lambda c: walker.velocities_after_impact(c, *velocities)[which] * walker.reduced_inertia(c)
        )

    right = _polynomial(lambda c: bound * walker.reduced_inertia(c))
    return Bound(coefficient(1.0, 0.0), coefficient(0.0, 1.0), relation, right)


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


def _sentences(crossing: Crossing) -> Iterator[str]:
    edge = f"{crossing.edge.source} → {crossing.edge.target}"
    needed = [one for one in crossing.conditions if one.verdict != "always"]
    match crossing.verdict:
        case "always":
            yield f"{edge} is taken in the instant of every touchdown in {crossing.edge.source}."
        case "never":
            yield f"{edge} is taken in the instant of no touchdown in {crossing.edge.source}."
        case "unknown":
            yield f"Whether {edge} is taken in the instant of a touchdown is unknown to Z3. It would need"
        case _:
            yield f"{edge} is taken in the instant of a touchdown exactly where"
    if crossing.verdict != "always":
        for one in needed:
            before = "" if one.before is None else f", that is {one.before} right before it"
            never = ", which never is" if one.verdict == "never" else ""
            yield f"  {pretty_predicate(one.part)} right after it{before}{never}"
        if any(one.before is not None for one in needed):
            yield "  where c = cos(θ₁ − θ₂), θ₁ = −θ₂"
    for does, jump in (("is", crossing.taken), ("is not", crossing.refused)):
        if jump is not None:
            yield f"It {does} taken at {_listing(jump.before)}: right after, {_listing(jump.after)}."
    if crossing.gait is not None:
        misses = [pretty_predicate(one.part) for one in needed if not holds(one.part, crossing.gait.after)]
        why = f" does not take it, for it misses {' and '.join(misses)}" if misses else " takes it"
        yield (
            f"The virtual-gravity gait{why}: "
            f"{_listing(crossing.gait.before)} becomes {_listing(crossing.gait.after)}."
        )


def _listing(state: State) -> str:
    return "(" + ", ".join(f"{pretty_name(name)} = {_number(value)}" for name, value in state.items()) + ")"


def _number(value: float) -> str:
    return f"{value:.4g}".replace("-", "−")
