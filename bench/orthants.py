"""The paper's walking cycle over a recorded walk, told to coachable, to rtamt and to pyrewardmachines alike.

The question put to each of them, sample by sample: does the step here follow the behaviour? It does if it
stays in a phase, goes along an edge, or enters a phase from outside (r_or in the variant `stay`).
"""

from __future__ import annotations

from enum import Enum
from functools import cache

import numpy as np

from coachable.automata.classifier import Classifier
from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.behaviours.predicates import Comparison, Predicate
from coachable.behaviours.rewriting import conjuncts
from coachable.envs.baselines import baseline
from coachable.rewards.forms import reward_table

BEHAVIOUR = load_behaviour("compass-walking")
DT = 0.01


@cache
def walk() -> dict[str, np.ndarray]:
    """Ten seconds of virtual gravity: a column for each signal.

    The paper's start itself, which has zeros in it, is left out: there rtamt's robustness is zero, which says
    neither yes nor no.
    """
    trajectory = baseline("virtual-gravity").trajectory
    return {name: getattr(trajectory, name)[1:] for name in BEHAVIOUR.signal_names}


def trace(num_samples: int) -> dict[str, np.ndarray]:
    """The walk over and over again, so many samples long."""
    return {name: np.resize(column, num_samples) for name, column in walk().items()}


def our_verdicts(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Whether the step to each sample follows the behaviour, for all samples but the first."""
    locations = Classifier.of(BEHAVIOUR).locate(columns)
    return reward_table(BEHAVIOUR, "stay")[locations[:-1], locations[1:]] > 0


def bounds(predicate: Predicate) -> list[tuple[str, str, float]]:
    """An orthant as (signal, relation, bound), which all must hold."""
    found = []
    for part in conjuncts(predicate):
        assert isinstance(part, Comparison), "an orthant is made of comparisons"
        found.append((str(part.left), part.relation, float(str(part.right))))
    return found


def rtamt_specification(specification):
    """Give rtamt the behaviour in past-time signal temporal logic: robustness is positive where it follows.

    No `prev` is written twice: online, rtamt 0.4.10 loses count of an operator that is.
    """
    for name in BEHAVIOUR.signal_names:
        specification.declare_var(name, "float")
    for phase in BEHAVIOUR.phases:
        specification.declare_var(phase.name, "float")
        signs = " and ".join(f"({' '.join(map(str, bound))})" for bound in bounds(phase.predicate))
        specification.add_sub_spec(f"{phase.name} = {signs}")
    anywhere = " or ".join(BEHAVIOUR.phase_names)
    steps = []
    for name in BEHAVIOUR.phase_names:
        before = " or ".join(_sources(BEHAVIOUR, name))
        steps.append(f"({name} and ((prev ({before})) or not (prev ({anywhere}))))")
    specification.declare_var("follows", "float")
    specification.spec = f"follows = {' or '.join(steps)}"
    specification.parse()
    return specification


class Place(Enum):
    """What a reward machine is told of a sample."""

    O1 = 1
    O2 = 2
    O3 = 3
    O4 = 4
    OUTSIDE = 5


def reward_machine():
    """The behaviour as a reward machine of pycrm, with its labelling function."""
    from pycrm.automaton import RewardMachine, RmToCrmAdapter  # pyright: ignore[reportMissingImports]
    from pycrm.label import LabellingFunction  # pyright: ignore[reportMissingImports]

    places = list(Place)
    table = reward_table(BEHAVIOUR, "stay")

    class Walking(RewardMachine):
        @property
        def u_0(self) -> int:
            return len(places) - 1

        def _get_state_transition_function(self) -> dict:
            return {u: {place.name: v for v, place in enumerate(places)} for u in range(len(places))}

        def _get_reward_transition_function(self) -> dict:
            return {
                u: {place.name: int(table[u, v]) for v, place in enumerate(places)}
                for u in range(len(places))
            }

    order = BEHAVIOUR.signal_names.index
    orthants = [
        (Place[phase.name], [(order(name), relation == ">") for name, relation, _ in bounds(phase.predicate)])
        for phase in BEHAVIOUR.phases
    ]

    class Where(LabellingFunction):
        @LabellingFunction.event
        def place(self, obs, action, next_obs):
            for place, signs in orthants:
                if all((next_obs[index] > 0.0) == positive for index, positive in signs):
                    return place
            return Place.OUTSIDE

    return RmToCrmAdapter(Walking(Place)), Where()


def _sources(behaviour: Behaviour, target: str) -> list[str]:
    return [target, *(edge.source for edge in behaviour.edges if edge.target == target)]
