import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from coachable.automata.hybrid import HybridAutomaton
from coachable.behaviours import Assignment, Variable, load_behaviour
from coachable.foundation.errors import BehaviourError
from coachable.plants import CompassWalker

WALKER = CompassWalker()
WALKING = load_behaviour("compass-walking")


def test_the_tuple_of_ideal_walking_is_the_papers(x64):
    automaton = HybridAutomaton.of(WALKING, WALKER)
    names = tuple(signal.name for signal in automaton.data_variables)
    assert names == ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
    assert automaton.locations == ("O1", "O2", "O3", "O4")
    assert [(edge.source, edge.target) for edge in automaton.edges] == [
        ("O1", "O2"),
        ("O2", "O3"),
        ("O3", "O4"),
        ("O4", "O1"),
    ]
    x, u = jnp.array([-0.2, 0.2, -1.0, -0.5]), jnp.array([0.3, -0.1])
    for location in automaton.locations:
        np.testing.assert_array_equal(automaton.activities[location](x, u), WALKER.flow(x, u))
        assert automaton.invariants[location] == {p.name: p.predicate for p in WALKING.phases}[location]
    for edge in automaton.edges[:3]:
        np.testing.assert_array_equal(automaton.resets[edge](x), x)


def test_the_reset_at_touchdown_swaps_the_angles_and_not_the_velocities(x64):
    automaton = HybridAutomaton.of(WALKING, WALKER)
    x = jnp.array([-0.3, 0.3, -1.6, -2.1])
    after = automaton.resets[automaton.edges[3]](x)
    np.testing.assert_array_equal(after, WALKER.impact(x))
    # T⁺ θ̇⁺ = T⁻ θ̇⁻, eq. (5), with the paper's parameters and θ̇⁺ = (new stance, new swing).
    m_h, m, a, b, l = 1.0, 0.5, 0.5, 0.5, 1.0  # noqa: E741
    c = np.cos(x[0] - x[1])
    t_plus = [[m_h * l**2 + m * a**2 + m * l * (l - b * c), m * b * (b - l * c)], [-m * b * l * c, m * b**2]]
    t_minus = [[(m_h * l**2 + 2 * m * a * l) * c - m * a * b, -m * a * b], [-m * a * b, 0]]
    np.testing.assert_allclose(np.array(t_plus) @ after[2:], np.array(t_minus) @ x[2:], rtol=1e-12)
    np.testing.assert_array_equal(after[:2], x[:2][::-1])


def test_a_reset_without_an_event_is_refused():
    swap = (Assignment("theta_1", Variable("theta_2")),)
    edges = (*WALKING.edges[:3], dataclasses.replace(WALKING.edges[3], event=None, reset=swap))
    with pytest.raises(BehaviourError, match=r"O4 → O1: it resets theta_1, .* write O4 → O1 on touchdown"):
        HybridAutomaton.of(dataclasses.replace(WALKING, edges=edges, cycles=()), WALKER)
    edges = (*WALKING.edges[:3], dataclasses.replace(WALKING.edges[3], reset=swap))
    automaton = HybridAutomaton.of(dataclasses.replace(WALKING, edges=edges, cycles=()), WALKER)
    assert automaton.resets[edges[3]] == WALKER.impact


def test_an_event_that_never_happens_to_the_plant_is_refused():
    edges = (*WALKING.edges[:3], dataclasses.replace(WALKING.edges[3], event="touch-down"))
    behaviour = dataclasses.replace(WALKING, edges=edges, cycles=())
    with pytest.raises(BehaviourError, match=r"O4 → O1 on touch-down: .* did you mean 'touchdown'\?"):
        HybridAutomaton.of(behaviour, WALKER)
