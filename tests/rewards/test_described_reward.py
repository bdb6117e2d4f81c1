"""A described reward without an environment: its forms, by laws and oracles, and in all three libraries."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.automata.monitor import Monitor
from coachable.automata.tracker import Tracker
from coachable.behaviours import Behaviour, Dwell, Edge, Near, Phase, Signal, load_behaviour
from coachable.foundation.errors import ParameterError
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import Potential, reward_table

WALKING = load_behaviour("compass-walking")
STATES = np.random.default_rng(0).normal(size=(3, 20, 4)).astype(np.float32)


def rooms(*cycles, count=4):
    """The signal `room` says which phase it is; A is 0, and so on."""
    names = "ABCDEFG"[:count]
    phases = tuple(Phase(name, "", Near("room", index, 0.1)) for index, name in enumerate(names))
    walks = tuple(
        tuple(Edge(*pair) for pair in zip(cycle, cycle[1:] + cycle[:1], strict=True)) for cycle in cycles
    )
    edges = tuple(dict.fromkeys(edge for walk in walks for edge in walk))
    return Behaviour("rooms", "", (Signal("room"),), phases, edges, walks)


def signals_of(walk):
    """The signals of a walk through rooms; a dot is outside of all."""
    return np.array([["ABCDEFG.".index(room)] for room in walk], np.float64)


def followed(reward, signals, terminated=False):
    """What each step of one run is paid, and what it was."""
    memory, steps = reward.init(signals[0]), []
    for sample in signals[1:]:
        memory, paid, info = reward.step(memory, sample, terminated)
        steps.append((paid, info))
    return steps


def with_dwell(behaviour):
    first, *others = behaviour.phases
    return dataclasses.replace(
        behaviour, phases=(dataclasses.replace(first, dwell=Dwell(0.015, 0.02)), *others)
    )


FORMS = {
    "phases": {},
    "released": {"form": "released"},
    "cycles": {"cycle_bonus": 5.0},
    "shaping": {"form": Potential(0.9)},
    "both": {"form": Potential(0.9, {"O2": 3.0}), "cycle_bonus": 2.0},
}
each_form = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)


@pytest.mark.parametrize("behaviour", [WALKING, with_dwell(WALKING)])
@pytest.mark.parametrize("form", ["stay", "equation", "released"])
def test_plus_minus_one_is_what_the_tracker_and_the_table_give(behaviour, form):
    reward, tracker = DescribedReward(behaviour, form, 0.01), Tracker.of(behaviour)
    table = reward_table(behaviour, form)
    memory, its_memory = reward.init(STATES[:, 0]), tracker.start(STATES[:, 0])
    for sample in range(1, STATES.shape[1]):
        memory, paid, info = reward.step(memory, STATES[:, sample])
        its_memory, move = tracker.advance(its_memory, STATES[:, sample], 0.01)
        pay = table[move.previous, move.location]
        if move.too_short is not None:
            pay = np.where(move.too_short | move.too_long, -1, pay)
        np.testing.assert_array_equal(paid, pay)
        np.testing.assert_array_equal(info.follows, pay == 1)
        np.testing.assert_array_equal(info.phase, move.location)
        assert paid.dtype == STATES.dtype


@each_form
@pytest.mark.parametrize("behaviour", [WALKING, with_dwell(WALKING)], ids=["plain", "dwell"])
def test_numpy_jax_and_torch_agree_and_jax_compiles_and_maps(behaviour, form):
    torch = pytest.importorskip("torch")
    reward = DescribedReward(behaviour, dt=0.01, **form)

    def run(step, init, states, ended):
        memory, told = init(states[:, 0]), []
        for sample in range(1, states.shape[1]):
            memory, paid, info = step(memory, states[:, sample], ended)
            told.append([paid, *info[:-2], *(info.terms[name] for name in sorted(info.terms))])
        return [[np.asarray(value) for value in row] for row in told]

    ended = np.array([False, True, False])
    expected = run(reward.step, reward.init, STATES, ended)
    others = [
        run(reward.step, reward.init, torch.from_numpy(STATES), torch.from_numpy(ended)),
        run(jax.jit(reward.step), jax.jit(reward.init), jnp.asarray(STATES), jnp.asarray(ended)),
        run(
            jax.jit(jax.vmap(reward.step)),
            jax.jit(jax.vmap(reward.init)),
            jnp.asarray(STATES),
            jnp.asarray(ended),
        ),
    ]
    for other in others:
        for row, its_row in zip(expected, other, strict=True):
            for value, its_value in zip(row, its_row, strict=True):
                np.testing.assert_allclose(its_value, value, rtol=1e-6, atol=1e-6)
                assert its_value.dtype == value.dtype or value.dtype.kind == "i"
    assert len({float(value) for paid, *_ in expected for value in paid}) > 1


@each_form
def test_the_terms_add_up(form):
    for paid, info in followed(DescribedReward(WALKING, **form), STATES[0]):
        assert sum(info.terms.values()) == pytest.approx(paid)


LEFT_RIGHT = "ABCB"
"""A cycle that comes through B twice."""


@pytest.mark.parametrize("cycles", [("ABCD",), (LEFT_RIGHT,), ("ABC", "CD"), ("AB", "ABCD")])
@settings(max_examples=20)
@given(walk=st.text("ABCD.", min_size=1, max_size=30))
def test_cycles_are_those_that_the_monitor_counts(cycles, walk):
    behaviour = rooms(*cycles)
    monitor = Monitor(behaviour)
    signals = signals_of(walk)
    monitor.feed_rows(np.arange(len(walk)), {"room": signals[:, 0]})
    steps = followed(DescribedReward(behaviour, cycle_bonus=3.0), signals)
    assert sum(int(info.cycles) for _, info in steps) == sum(monitor.report().cycles)
    assert sum(info.terms["cycles"] for _, info in steps) == 3.0 * sum(monitor.report().cycles)


def test_a_cycle_pays_with_its_last_edge_and_an_interrupted_one_does_not():
    reward = DescribedReward(rooms("ABC", count=3), cycle_bonus=10.0)

    def paid(walk):
        return [float(paid) for paid, _ in followed(reward, signals_of(walk))]

    assert paid("ABBCAABC") == [1, 1, 1, 11, 1, 1, 1]
    assert paid("BCABCAB") == [1, 1, 11, 1, 1, 11]
    assert paid("AB.BCA") == [1, -1, 1, 1, 1]
    assert paid("ABACA") == [1, -1, -1, 1]


def test_edges_are_told_apart_from_staying_and_coming_in():
    steps = followed(DescribedReward(rooms("ABC", count=3)), signals_of("AAB.BA"))
    assert [bool(info.edge) for _, info in steps] == [False, True, False, False, False]
    assert [bool(info.follows) for _, info in steps] == [True, True, False, True, False]


@settings(max_examples=30)
@given(walk=st.text("ABCD.", min_size=2, max_size=30), truncated=st.booleans())
def test_the_discounted_sum_of_shaping_telescopes(walk, truncated):
    """Σ γᵗ F_t = γᵀ Φ(s_T) − Φ(s_0), where a terminal Φ is 0 and a truncated one is kept."""
    discount, potential = 0.8, {"A": 1.5, "C": -2.0}
    reward = DescribedReward(rooms("ABCD"), form=Potential(discount, potential))
    signals = signals_of(walk)
    memory, total = reward.init(signals[0]), 0.0
    for t, sample in enumerate(signals[1:]):
        last = t == len(signals) - 2
        memory, paid, _ = reward.step(memory, sample, last and not truncated)
        total += discount**t * float(paid)
    end = discount ** (len(walk) - 1) * potential.get(walk[-1], 0.0) if truncated else 0.0
    assert total == pytest.approx(end - potential.get(walk[0], 0.0))


def test_the_potential_is_by_default_the_progress_along_the_cycle():
    reward = DescribedReward(rooms("CAB"), form=Potential(1.0))
    paid = [float(paid) for paid, _ in followed(reward, signals_of(".CABD."))]
    np.testing.assert_allclose(paid, [1 / 3, 1 / 3, 1 / 3, -1, 0], atol=1e-15)


NUM_ROOMS, NUM_ACTIONS = 5, 3


def optimal_values(transitions, rewards, discount, ends):
    """Q* of a finite MDP by value iteration; rewards and transitions by (room, action, next room)."""
    q = np.zeros((NUM_ROOMS, NUM_ACTIONS))
    for _ in range(2000):
        value = np.where(ends, 0.0, q.max(axis=1))
        q = np.sum(transitions * (rewards + discount * value), axis=2)
    return q


@pytest.mark.parametrize("seed", range(5))
def test_shaping_changes_no_optimal_policy(seed):
    """A random MDP whose states are four phases and one outside, of which the last phase is terminal."""
    rng, discount = np.random.default_rng(seed), 0.9
    transitions = rng.dirichlet(np.full(NUM_ROOMS, 0.3), (NUM_ROOMS, NUM_ACTIONS))
    base = rng.normal(size=(NUM_ROOMS, NUM_ACTIONS, NUM_ROOMS))
    ends = np.arange(NUM_ROOMS) == 3
    potential = dict(zip("ABCD", rng.normal(0, 10, 4).tolist(), strict=True))
    walk = "ABCD."

    def paid(**form):
        reward = DescribedReward(rooms("ABCD"), **form)
        paid = np.zeros((NUM_ROOMS, NUM_ROOMS))
        for before, after in itertools.product(range(NUM_ROOMS), repeat=2):
            ((pay, _),) = followed(reward, signals_of(walk[before] + walk[after]), bool(ends[after]))
            paid[before, after] = pay
        return paid[:, None, :]

    plain = optimal_values(transitions, base, discount, ends)
    shaped = optimal_values(transitions, base + paid(form=Potential(discount, potential)), discount, ends)
    phi = np.array([potential.get(room, 0.0) for room in walk])
    np.testing.assert_allclose(shaped, plain - phi[:, None], atol=1e-9)
    np.testing.assert_array_equal(shaped.argmax(1)[~ends], plain.argmax(1)[~ends])
    pulled = optimal_values(transitions, base + 10 * paid(), discount, ends)
    assert np.any(np.abs((pulled - pulled.max(1, keepdims=True)) - (plain - plain.max(1, keepdims=True))) > 1)


def test_a_nan_is_outside_and_does_not_spread():
    reward = DescribedReward(rooms("ABC", count=3), form=Potential(0.5), cycle_bonus=1.0)
    paid = [float(paid) for paid, _ in followed(reward, np.array([[0.0], [np.nan], [0.0]]))]
    np.testing.assert_allclose(paid, [-1 / 3, 1 / 6])


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: DescribedReward(with_dwell(WALKING)), "dt is needed"),
        (lambda: DescribedReward(WALKING, dt=0.0), "dt must be greater than zero, got 0.0"),
        (lambda: DescribedReward(WALKING, dt=float("nan")), "dt must be a finite number, got nan"),
        (lambda: DescribedReward(WALKING, cycle_bonus=float("inf")), "cycle_bonus must be .* got inf"),
        (lambda: DescribedReward(WALKING, cycle_bonus=10**400), "cycle_bonus must be a finite number"),
        (lambda: DescribedReward(rooms(), cycle_bonus=1.0), "no cycle that a bonus"),
        (lambda: DescribedReward(rooms(), form=Potential(0.9)), "no cycle to make progress"),
        (lambda: DescribedReward(WALKING, form=Potential(0.9, {"O5": 1.0})), "unknown phase 'O5'"),
        (lambda: Potential(1.01), "discount must be from 0 to 1, got 1.01"),
        (lambda: Potential(0.9, {"O1": float("nan")}), "phase 'O1' must be a finite number, got nan"),
    ],
)
def test_mistakes_are_named(make, complaint):
    with pytest.raises(ParameterError, match=complaint):
        make()
