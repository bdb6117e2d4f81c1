import dataclasses
import itertools
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.automata.tracker import Move
from coachable.behaviours import All, Behaviour, Comparison, Dwell, Edge, Phase, Signal, load_behaviour
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import VARIANTS, form_of, reward_table


@st.composite
def graphs(draw):
    """The number of phases, one to five, and any edges between them."""
    locations = range(draw(st.integers(1, 5)))
    pairs = st.sampled_from(list(itertools.product(locations, locations)))
    return len(locations), draw(st.lists(pairs, max_size=8, unique=True))


def behaviour_of(graph):
    count, pairs = graph
    phases = tuple(Phase(f"P{index}", "", Comparison("x", ">", index)) for index in range(count))
    edges = tuple(Edge(f"P{source}", f"P{target}") for source, target in pairs)
    return Behaviour("random", "", (Signal("x"),), phases, edges)


WALKING = load_behaviour("compass-walking")


def printed_case_list(before, now, q, e):
    """Eq. (r_or) of the paper, case by case; a location is the name of a phase or of another orthant."""
    if before in q and now in q and (before, now) in e:
        return +1
    if before not in q and now in q:
        return +1
    return -1


def caption_of_the_figure(before, now, q, e):
    """The figure's caption: staying in or entering the cycle pays, leaving it or going wrong is punished."""
    if now not in q:
        return -1
    stays, enters, follows = before == now, before not in q, (before, now) in e
    return +1 if stays or enters or follows else -1


def released_rule(last, current, num_phases):
    """Phases numbered from 1, −1 outside; the same number pays, and so does the next one modulo K + 1."""
    return +1 if current in (last, (last + 1) % (num_phases + 1)) else -1


def table_by(rule, behaviour):
    names = [*behaviour.phase_names, "elsewhere"]
    q = set(behaviour.phase_names)
    e = {(edge.source, edge.target) for edge in behaviour.edges}
    return [[rule(before, now, q, e) for now in names] for before in names]


@given(graphs())
def test_equation_is_the_printed_case_list(graph):
    behaviour = behaviour_of(graph)
    assert reward_table(behaviour, "equation").tolist() == table_by(printed_case_list, behaviour)


@given(graphs())
def test_stay_is_the_caption_of_the_figure(graph):
    behaviour = behaviour_of(graph)
    assert reward_table(behaviour, "stay").tolist() == table_by(caption_of_the_figure, behaviour)


@given(graphs())
def test_stay_is_the_equation_with_a_self_loop_on_every_phase(graph):
    behaviour = behaviour_of(graph)
    loops = {Edge(name, name) for name in behaviour.phase_names} - set(behaviour.edges)
    looped = Behaviour("looped", "", behaviour.signals, behaviour.phases, (*behaviour.edges, *loops))
    np.testing.assert_array_equal(reward_table(behaviour, "stay"), reward_table(looped, "equation"))


@given(graphs())
def test_released_is_the_released_rule(graph):
    behaviour = behaviour_of(graph)
    count = len(behaviour.phases)
    numbers = [*range(1, count + 1), -1]
    expected = [[released_rule(last, now, count) for now in numbers] for last in numbers]
    assert reward_table(behaviour, "released").tolist() == expected


def test_the_tables_of_ideal_walking():
    assert reward_table(WALKING, "stay").tolist() == [
        [+1, +1, -1, -1, -1],
        [-1, +1, +1, -1, -1],
        [-1, -1, +1, +1, -1],
        [+1, -1, -1, +1, -1],
        [+1, +1, +1, +1, -1],
    ]
    assert reward_table(WALKING, "equation").tolist() == [
        [-1, +1, -1, -1, -1],
        [-1, -1, +1, -1, -1],
        [-1, -1, -1, +1, -1],
        [+1, -1, -1, -1, -1],
        [+1, +1, +1, +1, -1],
    ]
    assert reward_table(WALKING, "released").tolist() == [
        [+1, +1, -1, -1, -1],
        [-1, +1, +1, -1, -1],
        [-1, -1, +1, +1, -1],
        [-1, -1, -1, +1, -1],
        [-1, -1, -1, -1, +1],
    ]


def test_events_do_not_matter_to_the_reward():
    silent = Behaviour(
        "silent", "", WALKING.signals, WALKING.phases, tuple(Edge(e.source, e.target) for e in WALKING.edges)
    )
    for variant in VARIANTS:
        np.testing.assert_array_equal(reward_table(silent, variant), reward_table(WALKING, variant))


def test_without_the_tests_type_checks_an_unknown_variant_is_refused_with_the_nearest_one():
    program = (
        "from coachable.behaviours import load_behaviour;"
        "from coachable.rewards.forms import reward_table;"
        "reward_table(load_behaviour('compass-walking'), 'equations')"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "ParameterError: unknown reward variant 'equations'; did you mean 'equation'?" in done.stderr


@pytest.mark.parametrize("variant", VARIANTS)
def test_moves_pay_by_the_table_and_nothing_before_anything_was_seen(variant):
    bound = form_of(variant).bind(WALKING, None)

    def r_or(current, previous):
        return bound.r_or(Move(previous, current))

    locations = jnp.arange(5)
    pay = jax.jit(jax.vmap(jax.vmap(r_or, in_axes=(0, None)), in_axes=(None, 0)))
    np.testing.assert_array_equal(pay(locations, locations), reward_table(WALKING, variant))
    np.testing.assert_array_equal(pay(locations, jnp.array([5])), np.zeros((1, 5)))


STATES = np.random.default_rng(0).normal(size=(3, 40, 4)).astype(np.float32)


def paid(reward, states):
    """What runs side by side are paid, sample after sample, in the library of the states."""
    memory, pays = reward.init(states[:, 0]), []
    for sample in range(1, states.shape[1]):
        memory, pay, _ = reward.step(memory, states[:, sample])
        pays.append(pay.tolist())
    return pays


def walking_with(dwell=None, deadband=None):
    first, *others = WALKING.phases
    inside = All(Comparison("theta_1", ">", 0, deadband), *first.predicate.parts[1:])
    changed = dataclasses.replace(first, predicate=inside, dwell=dwell)
    return dataclasses.replace(WALKING, phases=(changed, *others))


@pytest.mark.parametrize("variant", ["stay", "equation"])
@pytest.mark.parametrize("behaviour", [WALKING, walking_with(Dwell(0.015, 0.02)), walking_with(deadband=0.5)])
def test_numpy_jax_and_torch_are_paid_alike(behaviour, variant):
    torch = pytest.importorskip("torch")
    reward = DescribedReward(behaviour, variant, 0.01)
    from_numpy = paid(reward, STATES)
    assert from_numpy == paid(reward, jnp.asarray(STATES)) == paid(reward, torch.from_numpy(STATES))
    assert {pay for pays in from_numpy for pay in pays} == {-1, 1}


def test_without_deadband_and_dwell_memory_pays_what_the_table_says():
    for variant in VARIANTS:
        reward = DescribedReward(WALKING, variant)
        locations = reward.tracker.classifier(STATES)
        table = reward_table(WALKING, variant)
        assert paid(reward, STATES) == table[locations[:, :-1], locations[:, 1:]].T.tolist()


IN_O1, IN_O2 = np.array([0.1, -0.1, -1.0, 1.0]), np.array([0.1, 0.1, -1.0, 1.0])


def test_a_violated_dwell_time_pays_minus_one():
    reward = DescribedReward(walking_with(Dwell(0.03, 0.05)), dt=0.01)
    outside = -IN_O1

    def pays(*states):
        return [pay for (pay,) in paid(reward, np.stack([outside, *states])[None])]

    # O1 → O2 after 0.02, 0.03 and 0.05 s; and staying in O1 beyond 0.05 s, until it is left.
    assert pays(*[IN_O1] * 2, IN_O2, IN_O2) == [1, 1, -1, 1]
    assert pays(*[IN_O1] * 3, IN_O2, IN_O2) == [1, 1, 1, 1, 1]
    assert pays(*[IN_O1] * 5, IN_O2) == [1] * 6
    assert pays(*[IN_O1] * 8, IN_O2) == [1] * 6 + [-1, -1, 1]


def test_a_deadband_pays_for_staying_where_a_wobble_would_not():
    wobble = IN_O1 * [-0.1, 1, 1, 1]
    run = np.stack([IN_O1, wobble, IN_O1, IN_O1])[None]
    assert paid(DescribedReward(WALKING), run) == [[-1], [1], [1]]
    assert paid(DescribedReward(walking_with(deadband=0.02)), run) == [[1], [1], [1]]


def test_nothing_is_paid_for_the_first_sample_of_a_run_of_which_nothing_was_seen():
    reward = DescribedReward(walking_with(Dwell(0.03)), dt=0.01)
    memory, pay, _ = reward.step(reward.init_unseen(IN_O1), IN_O1)
    assert pay == 0
    _, pay, _ = reward.step(memory, IN_O2)
    assert pay == 1
