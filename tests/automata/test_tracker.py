import dataclasses
import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.automata.classifier import Classifier
from coachable.automata.monitor import Monitor
from coachable.automata.tracker import Memory, Tracker
from coachable.behaviours import Behaviour, Comparison, Dwell, Phase, Signal, load_behaviour
from coachable.behaviours.text import parse
from tests.automata.tracked import DT, RUNS, behaviour_of, descriptions, follow

WALKING = load_behaviour("compass-walking")


def locations_of(behaviour, names):
    return [len(behaviour.phases) if name is None else behaviour.phase_names.index(name) for name in names]


def advanced(behaviour, runs, dt=DT):
    """Runs of equal length side by side: the moves from sample to sample, in the library of the runs."""
    tracker = Tracker.of(behaviour)
    memory = tracker.start(runs[:, 0, None])
    moves = []
    for sample in range(1, runs.shape[1]):
        memory, move = tracker.advance(memory, runs[:, sample, None], dt)
        moves.append(move)
    return moves


def flags(values, count):
    return [False] * count if values is None else values.tolist()


@settings(max_examples=40)
@given(descriptions(), st.lists(RUNS, min_size=1, max_size=3), st.sampled_from(["numpy", "jax", "torch"]))
def test_runs_are_followed_as_the_words_say_in_every_library(description, runs, library):
    behaviour = behaviour_of(description)
    torch = pytest.importorskip("torch")
    length = min(map(len, runs))
    runs = [run[:length] for run in runs]
    arrays = {"numpy": np.array, "jax": lambda x: jnp.asarray(np.array(x)), "torch": torch.tensor}
    with jax.enable_x64(True):
        signals = arrays[library](runs) if library != "torch" else torch.tensor(runs, dtype=torch.float64)
        moves = advanced(behaviour, signals)
    expected = list(zip(*(follow(behaviour, run)[1:] for run in runs), strict=True))
    assert len(moves) == len(expected)
    for move, steps in zip(moves, expected, strict=True):
        assert move.previous.tolist() == locations_of(behaviour, [step.previous for step in steps])
        assert move.location.tolist() == locations_of(behaviour, [step.phase for step in steps])
        assert flags(move.too_short, len(runs)) == [step.too_short for step in steps]
        assert flags(move.too_long, len(runs)) == [step.too_long for step in steps]


@given(descriptions(), RUNS, st.integers(0, 4))
def test_a_whole_run_at_once_is_the_run_sample_by_sample(description, run, previous):
    behaviour = behaviour_of(description)
    tracker = Tracker.of(behaviour)
    previous = min(previous, tracker.none_yet)
    one_by_one, location, held = [], previous, tracker.latches.of_phase(np.array(previous))
    for x in run:
        location = int(tracker.locate(np.array([x]), np.array(location), held))
        held = tracker.latches.after(held, {"x": np.array(x)})
        one_by_one.append(location)
    assert tracker.along({"x": np.array(run)}, previous).tolist() == one_by_one


@given(RUNS)
def test_without_a_deadband_the_classifier_decides(run):
    behaviour = Behaviour(
        "plain", "", (Signal("x"),), (Phase("P", "", Comparison("x", ">", 0.0), Dwell(0.1)),), ()
    )
    column = np.array(run)
    np.testing.assert_array_equal(
        Tracker.of(behaviour).along({"x": column}, 0), Classifier.of(behaviour)(column[:, None])
    )


def flickering(deadband):
    inside = Comparison("x", ">", 0.0, deadband)
    return Behaviour("flicker", "", (Signal("x"),), (Phase("P", "", inside),), ())


def test_a_deadband_holds_on_to_a_phase_but_does_not_let_anybody_in():
    run = {"x": np.array([-0.05, 0.05, -0.05, 0.0, -0.1, -0.05, 0.05, np.nan, -0.05])}
    assert Tracker.of(flickering(None)).along(run, 1).tolist() == [1, 0, 1, 1, 1, 1, 0, 1, 1]
    assert Tracker.of(flickering(0.1)).along(run, 1).tolist() == [1, 0, 0, 0, 1, 1, 0, 1, 1]


def path_of(text, x, y, library=np):
    """The phases that a run in the plane is in, one after the other."""
    behaviour = parse(text)
    tracker, columns = Tracker.of(behaviour), {"x": np.array(x), "y": np.array(y)}
    locations = tracker.along(columns, tracker.none_yet)
    signals = library.asarray(np.stack([*columns.values()], axis=-1))
    memory, found = tracker.initial(signals[0]), []
    for sample in signals:
        memory, _ = tracker.advance(memory, sample, 0.01)
        found.append(int(memory.location))
    monitor = Monitor(behaviour)
    for t, (here, there) in enumerate(zip(x, y, strict=True)):
        monitor.feed(float(t), {"x": here, "y": there})
        assert monitor.phase == dict(enumerate(behaviour.phase_names)).get(found[t])
    assert found == locations.tolist()
    names = (*behaviour.phase_names, "-")
    return "".join(names[place] for place, _ in itertools.groupby(found))


QUADRANTS = """behaviour "quadrants"
signals
  x [m]
  y [m]
vocabulary
  ahead means x > 0 [m] deadband 0.1 [m]
  high means y > 0 [m] deadband 0.1 [m]
phases
  {}
  {}
  {}
cycle
  a -> b -> c -> a on back
"""
WRITTEN_OUT = (
    "a: x <= 0 [m] deadband 0.1 [m], y <= 0 [m] deadband 0.1 [m]",
    "b: x > 0 [m] deadband 0.1 [m], y <= 0 [m] deadband 0.1 [m]",
    "c: 0 [m] < x deadband 0.1 [m], 0 [m] < y deadband 0.1 [m]",
)
IN_PHRASES = ("a: not ahead, not high", "b: ahead and not high", "c: not (not ahead or not high)")
NESTED = ("a: not (ahead or high)", "b: ahead, not high", "c: (ahead and high) or false")


@pytest.mark.parametrize("phases", [WRITTEN_OUT, IN_PHRASES, NESTED])
def test_each_comparison_has_its_own_deadband_in_any_order_of_the_phases(phases):
    t = np.linspace(0, 3, 31)
    x, y = (-0.105 + 0.1 * t).round(4).tolist(), (-0.19 + 0.125 * t).round(4).tolist()
    for order in itertools.permutations(phases):
        assert path_of(QUADRANTS.format(*order), x, y) == "abc"
        assert path_of(QUADRANTS.format(*order), x[::-1], y[::-1]) == "cba"
    assert path_of(QUADRANTS.format(*phases), x[::3], y[::3], jnp) == "abc"


def test_flickering_in_one_signal_is_held_while_another_moves_on():
    x = [-1.0, *[0.05, -0.05] * 4, 0.2, 0.05, -0.05, 0.2]
    y = [-1.0, *[-1.0] * 8, -0.05, 0.05, -0.05, 0.3]
    assert path_of(QUADRANTS.format(*WRITTEN_OUT), x, y) == "abc"


def test_what_was_not_known_is_not_remembered():
    x = [1.0, 0.05, math.nan, -0.05, 0.05, 0.2]
    assert path_of(QUADRANTS.format(*WRITTEN_OUT), x, [-1.0] * 6) == "b-ab"


def test_memories_of_comparisons_have_the_shape_of_the_batch():
    tracker = Tracker.of(parse(QUADRANTS.format(*WRITTEN_OUT)))
    memory = tracker.start(np.zeros((5, 3, 2)))
    after, _ = tracker.advance(memory, np.zeros((5, 3, 2)), 0.01)
    assert {leaf.shape for leaf in jax.tree.leaves((memory, after))} == {(5, 3)}


def test_only_what_is_needed_is_remembered_and_computed():
    state = jnp.zeros(4)
    plain = Tracker.of(WALKING)
    memory, move = plain.advance(plain.start(state), state, 0.01)
    assert jax.tree.leaves((memory, move)) == [4, 4, 4]
    phases = tuple(dataclasses.replace(phase, dwell=Dwell(0.1)) for phase in WALKING.phases)
    dwelling = Tracker.of(dataclasses.replace(WALKING, phases=phases))
    assert len(jax.tree.leaves(dwelling.start(state))) == 1 + 3 * 4
    unlimited = tuple(dataclasses.replace(phase, dwell=Dwell()) for phase in WALKING.phases)
    assert Tracker.of(dataclasses.replace(WALKING, phases=unlimited)) == plain
    assert hash(Tracker.of(WALKING)) == hash(plain)


def limited(dwell):
    behaviour = Behaviour(
        "limited", "", (Signal("x"),), (Phase("P", "", Comparison("x", ">", 0.0), dwell),), ()
    )
    return Tracker.of(behaviour)


@pytest.mark.parametrize("dt", [0.01, 1 / 240, 0.002])
@pytest.mark.parametrize("samples", [5, 40, 300])
def test_sums_of_steps_that_are_not_exact_violate_nothing(dt, samples):
    """A phase of exactly so many float32 steps is neither too short nor too long for its own length."""
    tracker = limited(Dwell(samples * dt, samples * dt))
    xs = jnp.array([-1.0] + [1.0] * (samples + 1) + [-1.0], jnp.float32)
    # From the first sample inside to the last there are `samples` steps; leaving comes one later.
    memory = tracker.start(xs[:1])

    def step(memory, x):
        memory, move = tracker.advance(memory, x[None], jnp.float32(dt))
        return memory, (move.too_short, move.too_long)

    _, (too_short, too_long) = jax.lax.scan(step, memory, xs[1:])
    assert not too_short.any()
    assert not too_long.any()
    _, (_, too_long) = jax.lax.scan(step, memory, jnp.concatenate([xs[1:-1], xs[1:2]]))
    assert np.flatnonzero(too_long).tolist() == [samples + 1]
    _, (too_short, _) = jax.lax.scan(step, memory, jnp.concatenate([xs[1:samples], xs[:1]]))
    assert np.flatnonzero(too_short).tolist() == [samples - 1]


def test_a_phase_that_nobody_saw_begin_is_not_held_to_its_minimum():
    tracker = limited(Dwell(at_least=1.0))
    inside, out = np.array([1.0]), np.array([-1.0])
    _, move = tracker.advance(tracker.start(inside), out, 0.1)
    assert not move.too_short
    memory, move = tracker.advance(tracker.initial(inside), inside, 0.1)
    assert move.previous == tracker.none_yet
    _, move = tracker.advance(memory, out, 0.1)
    assert not move.too_short
    memory, _ = tracker.advance(tracker.start(out), inside, 0.1)
    _, move = tracker.advance(memory, out, 0.1)
    assert move.too_short


def test_it_can_be_jitted_and_vmapped_and_calls_nothing_back():
    phases = [
        dataclasses.replace(WALKING.phases[0], dwell=Dwell(0.02, 0.05)),
        dataclasses.replace(WALKING.phases[1], predicate=Comparison("theta_2", ">", 0.0, 0.1)),
        *WALKING.phases[2:],
    ]
    tracker = Tracker.of(dataclasses.replace(WALKING, phases=tuple(phases)))
    states = jnp.asarray(np.random.default_rng(0).normal(size=(6, 50, 4)).astype(np.float32))

    def whole(states):
        def step(memory, state):
            memory, move = tracker.advance(memory, state, jnp.float32(0.01))
            return memory, move

        return jax.lax.scan(step, tracker.start(states[0]), states[1:])[1]

    together = jax.jit(jax.vmap(whole))(states)
    for run in range(6):
        for alone, beside in zip(whole(states[run]), together, strict=True):
            np.testing.assert_array_equal(alone, beside[run])
    assert "callback" not in str(jax.make_jaxpr(whole)(states[0]))


def test_memory_is_a_pytree_of_one_dtype_from_step_to_step():
    tracker = limited(Dwell(0.5, 1.0))
    for x in (jnp.zeros(1, jnp.float32), np.zeros(1, np.float32)):
        start = tracker.start(x)
        after, _ = tracker.advance(start, x, 0.01)
        assert [leaf.dtype for leaf in jax.tree.leaves(start)] == [
            leaf.dtype for leaf in jax.tree.leaves(after)
        ]
        assert isinstance(after, Memory)
