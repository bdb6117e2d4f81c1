import dataclasses
import os
import subprocess
import sys

import numpy as np
import pytest

from coachable.behaviours import All, Comparison, Dwell, Edge, Not, Number, Phase, load_behaviour
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import Stay, Variant
from coachable.rewards.reward_hash import reward_hash
from coachable.rewards.setup import PAPER_SETUPS, RewardSetup, Semantics

WALKING = load_behaviour("compass-walking")
ORTHANT = PAPER_SETUPS["orthant"]


def hash_of(behaviour=WALKING, variant: Variant = "stay", semantics: Semantics = "paper", setup=ORTHANT):
    return reward_hash(behaviour, variant, semantics, setup)


def with_predicate(index, change):
    phases = list(WALKING.phases)
    phases[index] = dataclasses.replace(phases[index], predicate=change(phases[index].predicate))
    return dataclasses.replace(WALKING, phases=tuple(phases))


def test_it_is_a_sha256_and_the_same_in_every_process():
    program = (
        "from coachable.behaviours import load_behaviour as b;"
        "from coachable.rewards.setup import PAPER_SETUPS as s;"
        "from coachable.rewards.reward_hash import reward_hash as h;"
        "print(h(b('compass-walking'), 'stay', 'paper', s['orthant']))"
    )
    environment = os.environ | {"PYTHONHASHSEED": "17"}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.strip() == hash_of()
    assert len(hash_of()) == 64


def renamed_phases(behaviour):
    new = {name: f"{name}-renamed" for name in behaviour.phase_names}
    return dataclasses.replace(
        behaviour,
        phases=tuple(Phase(new[phase.name], "another title", phase.predicate) for phase in behaviour.phases),
        edges=tuple(Edge(new[edge.source], new[edge.target], edge.event) for edge in behaviour.edges),
        cycles=(),
    )


@pytest.mark.parametrize(
    "same",
    [
        dataclasses.replace(WALKING, name="another", description="Another text."),
        renamed_phases(WALKING),
        dataclasses.replace(
            WALKING,
            edges=tuple(Edge(edge.source, edge.target) for edge in reversed(WALKING.edges)),
            cycles=(),
        ),
        dataclasses.replace(WALKING, signals=tuple(reversed(WALKING.signals))),
        with_predicate(0, lambda p: All(*reversed(p.parts), p.parts[0])),
        with_predicate(1, lambda p: Not(Not(p))),
        parse(to_text(WALKING)),
    ],
    ids=[
        "description",
        "titles",
        "edge order and events",
        "signal order",
        "part order",
        "double negation",
        "text",
    ],
)
def test_the_text_does_not_matter(same):
    assert hash_of(same) == hash_of()


def test_the_name_of_the_setup_does_not_matter():
    assert hash_of(setup=dataclasses.replace(ORTHANT, name="another")) == hash_of()
    assert hash_of(setup=dataclasses.replace(ORTHANT, forward=-0.0)) == hash_of()


def test_all_that_is_paid_matters():
    different = [
        hash_of(),
        hash_of(with_predicate(0, lambda p: All(Comparison("theta_1", ">", 1e-9), *p.parts[1:]))),
        hash_of(with_predicate(0, lambda p: All(Comparison("theta_1", ">=", 0), *p.parts[1:]))),
        hash_of(with_predicate(0, lambda p: All(Comparison("theta_2", ">", 0), *p.parts[1:]))),
        hash_of(load_behaviour("compass-walking-released")),
        hash_of(dataclasses.replace(WALKING, edges=WALKING.edges[1:], cycles=())),
        hash_of(dataclasses.replace(WALKING, edges=(*WALKING.edges, Edge("O1", "O3")))),
        hash_of(dataclasses.replace(WALKING, phases=tuple(reversed(WALKING.phases)))),
        hash_of(variant="equation"),
        hash_of(variant="released"),
        hash_of(semantics="released-code"),
        *(
            hash_of(setup=dataclasses.replace(ORTHANT, **{term: weight}))
            for term, weight in [
                ("jerk", -0.0011),
                ("distance", 2),
                ("fall", -9),
                ("forward", 1),
                ("orthant", 0.011),
            ]
        ),
    ]
    assert len(set(different)) == len(different)


def with_dwell(index, dwell):
    phases = list(WALKING.phases)
    phases[index] = dataclasses.replace(phases[index], dwell=dwell)
    return dataclasses.replace(WALKING, phases=tuple(phases))


def with_deadband(deadband):
    return with_predicate(0, lambda p: All(Comparison("theta_1", ">", 0, deadband), *p.parts[1:]))


def test_dwell_times_and_deadbands_matter():
    different = [
        hash_of(),
        hash_of(with_dwell(0, Dwell(0.05))),
        hash_of(with_dwell(1, Dwell(0.05))),
        hash_of(with_dwell(0, Dwell(0.06))),
        hash_of(with_dwell(0, Dwell(at_most=0.4))),
        hash_of(with_dwell(0, Dwell(0.05, 0.4))),
        hash_of(with_deadband(0.01)),
        hash_of(with_deadband(0.02)),
    ]
    assert len(set(different)) == len(different)


def test_a_dwell_time_that_limits_nothing_and_a_deadband_of_nothing_do_not():
    assert hash_of(with_dwell(0, Dwell())) == hash_of()
    assert hash_of(with_dwell(2, Dwell(0.0))) == hash_of()
    assert hash_of(with_deadband(0)) == hash_of()
    assert hash_of(with_deadband(Number(0.01, "rad"))) == hash_of(with_deadband(0.01))


def test_the_hashes_of_the_runs_that_are_published_stay():
    assert hash_of() == "f0143aaa164259efb60c19caca71d37b7231e2f1750e6da1d9686899ce988a6d"
    released = load_behaviour("compass-walking-released")
    assert (
        hash_of(released, "released", "released-code")
        == "7128d4a6b7838ae0e9b2a1aba78ef19e0ad6b0fcb7b5cbb63fa9221c1278b716"
    )


def test_setups_with_equal_weights_are_paid_alike():
    assert hash_of(setup=RewardSetup("mine", orthant=0.01)) == hash_of()


def test_a_stay_that_judges_no_times_pays_as_if_there_were_none():
    timed, plain = load_behaviour("compass-walking-timed"), load_behaviour("compass-walking")
    setup = PAPER_SETUPS["orthant"]
    assert reward_hash(timed, Stay(dwells=False), "paper", setup) == reward_hash(
        plain, "stay", "paper", setup
    )
    assert reward_hash(timed, Stay(), "paper", setup) != reward_hash(plain, "stay", "paper", setup)
    camping = np.array([0.2, -0.1, -1.0, 1.0])
    rewards = [DescribedReward(timed, Stay(dwells=judged), 0.01) for judged in (False, True)]
    paid = []
    for reward in rewards:
        memory, total = reward.init(camping), 0.0
        for _ in range(50):
            memory, pay, _ = reward.step(memory, camping)
            total += float(pay)
        paid.append(total)
    assert paid[0] == 50 > paid[1]
