import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.automata.classifier import Classifier
from coachable.behaviours import All, Any, Behaviour, Comparison, Not, Phase, Signal, load_behaviour

NAMES = ("x", "y", "z")
BOUNDS = (-1.0, -0.0, 0.0, 0.5)
COMPARISONS = st.builds(
    Comparison, st.sampled_from(NAMES), st.sampled_from(["<", "<=", ">", ">="]), st.sampled_from(BOUNDS)
)
PREDICATES = st.recursive(
    COMPARISONS,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda parts: All(*parts))
        | st.lists(inner, max_size=3).map(lambda parts: Any(*parts))
        | inner.map(Not)
    ),
    max_leaves=6,
)
# XLA flushes subnormal numbers to zero, as the classifier's docstring says; they are left out here.
NUMBERS = st.sampled_from([*BOUNDS, math.nan, math.inf, -math.inf]) | st.floats(
    width=32, allow_subnormal=False
)
STATES = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=6, max_size=6)


def behaviour_of(predicates):
    phases = tuple(Phase(f"P{index}", "", predicate) for index, predicate in enumerate(predicates))
    return Behaviour("random", "", tuple(map(Signal, NAMES)), phases, ())


def expected_location(behaviour, state):
    name = behaviour.phase_at(dict(zip(behaviour.signal_names, state, strict=True)))
    return behaviour.phase_names.index(name) if name is not None else len(behaviour.phases)


@given(st.lists(PREDICATES, min_size=1, max_size=4), STATES, st.sampled_from([np.float32, np.float64]))
def test_numpy_jax_and_pure_python_agree(predicates, states, dtype):
    behaviour = behaviour_of(predicates)
    classifier = Classifier.of(behaviour)
    expected = [expected_location(behaviour, state) for state in states]
    with jax.enable_x64(True):
        batch = np.array(states, dtype)
        from_numpy = classifier(batch)
        from_jax = classifier(jnp.asarray(batch))
    assert from_numpy.tolist() == expected
    assert from_jax.tolist() == expected
    assert from_numpy.dtype == from_jax.dtype == np.int32


@pytest.fixture
def walking():
    return Classifier.of(load_behaviour("compass-walking"))


STATES_OF_WALKING = np.array(
    [[0.1, -0.1, -1, 1], [0.1, 0.1, -1, 1], [-0.1, 0.1, -1, 1], [-0.1, 0.1, -1, -1], [0.1, -0.1, -1, -1]],
    np.float32,
)


def test_it_runs_under_jit_and_vmap_and_on_any_batch(walking):
    states = jnp.asarray(STATES_OF_WALKING)
    assert walking(states).tolist() == [0, 1, 2, 3, 4]
    assert jax.jit(walking)(states).tolist() == [0, 1, 2, 3, 4]
    assert jax.jit(jax.vmap(walking))(states).tolist() == [0, 1, 2, 3, 4]
    assert walking(states[2]).shape == ()
    assert walking(states[:, None, :]).shape == (5, 1)
    assert walking(STATES_OF_WALKING[2]) == 2
    assert walking(states[:0]).shape == (0,)


def test_it_is_compiled_without_callbacks(walking):
    program = str(jax.make_jaxpr(walking)(jnp.zeros(4)))
    assert "callback" not in program


def test_zeros_of_either_sign_are_where_the_paper_puts_them(walking):
    # μ₂(O1): θ₁ > 0 ∧ θ₂ ≤ 0 ∧ θ̇₁ ≤ 0 ∧ θ̇₂ > 0.
    for zero in (0.0, -0.0):
        assert walking(np.array([0.1, zero, zero, 0.1])) == 0
        assert walking(np.array([zero, -0.1, -0.1, 0.1])) == walking.outside
        assert walking(np.array([0.1, -0.1, -0.1, zero])) == walking.outside


def test_a_nan_in_any_signal_is_outside(walking):
    for index in range(4):
        state = STATES_OF_WALKING[0].copy()
        state[index] = np.nan
        assert walking(state) == walking.outside
    negation = Classifier.of(behaviour_of([Not(Comparison("x", ">", 0))]))
    assert negation(np.array([-1.0, 0.0, 0.0])) == 0
    assert negation(np.array([np.nan, 0.0, 0.0])) == negation.outside
    assert negation(np.array([-1.0, 0.0, np.nan])) == negation.outside


def test_it_is_a_value_that_can_be_static(walking):
    again = Classifier.of(load_behaviour("compass-walking"))
    assert walking == again
    assert hash(walking) == hash(again)
    assert walking != Classifier.of(load_behaviour("compass-walking-released"))
    count = 0

    def locate(classifier, x):
        nonlocal count
        count += 1
        return classifier(x)

    jitted = jax.jit(locate, static_argnums=0)
    jitted(walking, jnp.zeros(4))
    jitted(again, jnp.ones(4))
    assert count == 1


@pytest.mark.parametrize("shape", [(3,), (4, 5), (0,)])
def test_signals_of_the_wrong_number_are_refused(walking, shape):
    with pytest.raises(ValueError, match="the 4 signals theta_1, theta_2, dtheta_1, dtheta_2"):
        walking(np.zeros(shape))
