"""One run in plain floats is paid what `DescribedReward` pays it in arrays, step for step."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import Comparison, Dwell, Edge, Phase
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import VARIANTS, Potential, Stay
from coachable.rewards.run_reward import RunReward
from tests.automata.tracked import RUNS, behaviour_of, descriptions

POSITIVE = [Phase("P", "", Comparison("x", ">", 0.0), Dwell(0.5))], []
VERDICTS = ("follows", "edge", "too_short", "too_long")
DTS = st.sampled_from([0.25, 0.1, 1 / 3])
SHAPINGS = st.none() | st.tuples(st.sampled_from([0.0, 0.9, 1.0]), st.floats(-9, 9))


def closed(behaviour):
    """With cycles along all of its phases, there and back, whatever edges it had."""
    names = behaviour.phase_names
    walks = [(*names,), (*names, *names[::-1])]
    cycles = tuple(
        tuple(Edge(*pair) for pair in zip(walk, (*walk[1:], walk[0]), strict=True)) for walk in walks
    )
    edges = tuple(dict.fromkeys((*behaviour.edges, *(edge for cycle in cycles for edge in cycle))))
    return dataclasses.replace(behaviour, edges=edges, cycles=cycles)


@settings(max_examples=100)
@given(
    descriptions(),
    st.lists(st.tuples(RUNS, st.booleans()), min_size=1, max_size=3),
    st.sampled_from([*VARIANTS, Stay(0.0), Stay(0.6)]),
    DTS,
    st.sampled_from([0.0, 2.5]),
    SHAPINGS,
)
def test_it_pays_and_gives_what_arrays_do(description, episodes, form, dt, bonus, shaping):
    behaviour = behaviour_of(description)
    behaviour = closed(behaviour) if bonus else behaviour
    if shaping is not None:
        discount, potential = shaping
        form = Potential(discount, {behaviour.phase_names[0]: potential})
    reward = DescribedReward(behaviour, form, dt, bonus)
    run = RunReward(reward)
    for xs, terminates in episodes:
        memory = reward.init(np.array([xs[0]]))
        begun = run.begin([xs[0]])
        assert (begun.location, begun.phase) == (memory.phase.location, reward.phase_names[begun.location])
        assert (begun.paid, begun.cycles, set(begun.verdict.values())) == (0.0, 0, {False})
        for number, x in enumerate(xs[1:], start=2):
            terminated = terminates and number == len(xs)
            memory, paid, info = reward.step(memory, np.array([x]), terminated)
            step = run.step([x], terminated)
            assert step.paid == paid
            assert (step.location, step.cycles) == (info.phase, info.cycles)
            assert step.phase == reward.phase_names[step.location]
            assert step.verdict == {name: bool(getattr(info, name)) for name in VERDICTS}
            assert step.memory == (memory.form, memory.cycles)
            np.testing.assert_array_equal(step.observed, reward.observe(memory, np.array([x])))


def test_it_gives_pythons_own_numbers():
    behaviour = closed(behaviour_of(POSITIVE))
    run = RunReward(DescribedReward(behaviour, dt=0.1, cycle_bonus=1.0))
    run.begin([0.3])
    step = run.step([-0.3], False)
    assert [type(value) for value in (step.paid, step.location, step.cycles)] == [float, int, int]
    assert {type(value) for value in step.verdict.values()} == {bool}


@pytest.mark.parametrize("terminated", [False, True])
def test_what_a_step_pays_is_computed_once(terminated, monkeypatch):
    reward = DescribedReward(behaviour_of(POSITIVE), dt=0.1)
    computed, pay = [], DescribedReward.pay
    monkeypatch.setattr(DescribedReward, "pay", lambda *args: computed.append(args) or pay(*args))
    run = RunReward(reward)
    for _ in range(3):
        run.begin([0.3])
        for _ in range(20):
            run.step([0.3], terminated)
    assert len(computed) == 1


NODS = ([Phase("P", "", Comparison("x", ">", 0.0), Dwell(at_most=5.0))], [])
STEPS = (
    [*NODS[0], Phase("Q", "", Comparison("x", "<=", 0.0))],
    [("P", "Q"), ("Q", "P")],
)


@pytest.mark.parametrize("description", [NODS, STEPS], ids=["outside", "in a neighbour phase"])
@pytest.mark.parametrize(
    ("form", "absence", "is_paid"),
    [
        ("stay", 1, False),
        ("stay", 2, True),
        (Stay(flicker=0.2), 2, False),
        (Stay(flicker=0.2), 3, True),
        (Stay(flicker=0.0), 1, True),
        ("equation", 1, None),
    ],
)
def test_a_nod_undoes_no_limit_under_stay(description, form, absence, is_paid):
    """Standing for 4.9 s and nodding, again and again, where at most 5 s are allowed."""
    run = RunReward(DescribedReward(behaviour_of(description), form, 0.1))
    xs = [1.0] * 49 + [-1.0] * absence
    run.begin(xs[:1])
    steps = [(x, run.step([x], False)) for x in [*xs[1:], *xs * 3]]
    later = [step for x, step in steps[51:] if x > 0]
    late = [step.verdict["too_long"] for step in later]
    if is_paid is None:
        assert not any(late)
    else:
        assert (any(late), all(late)) == (not is_paid, not is_paid)
        assert [step.paid for step in later] == [1.0 if is_paid else -1.0] * len(later)
