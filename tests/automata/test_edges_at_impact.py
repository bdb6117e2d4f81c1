import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable import cli
from coachable.automata.edges_at_impact import (
    explain_edge_at_impact,
    explain_edges_at_impact,
    gait_touchdown,
)
from coachable.automata.hybrid import HybridAutomaton
from coachable.behaviours import All, Comparison, Edge, Phase, holds, load_behaviour
from coachable.foundation.errors import BehaviourError
from coachable.plants import CompassParameters, CompassWalker

WALKER = CompassWalker()
WALKING = load_behaviour("compass-walking")
O4_TO_O1 = WALKING.edges[3]
NAMES = WALKING.signal_names

sizes = st.floats(0.1, 3.0)
parameters = st.builds(dict, hip_mass=sizes, leg_mass=sizes, a=sizes, b=sizes)
velocities = st.floats(-6.0, 6.0)


def automaton(behaviour=WALKING, walker=WALKER):
    return HybridAutomaton.of(behaviour, walker)


def leading_to(*parts, source="O4"):
    """Ideal walking, but a touchdown leads to a phase of these comparisons."""
    phases = (*WALKING.phases, Phase("then", "", All(*parts)))
    edge = Edge(source, "then", "touchdown")
    behaviour = dataclasses.replace(WALKING, phases=phases, edges=(*WALKING.edges[:3], edge), cycles=())
    return explain_edge_at_impact(automaton(behaviour), edge)


@pytest.fixture(scope="module")
def crossing():
    (found,) = explain_edges_at_impact(automaton())
    return found


def after_impact(before):
    return dict(
        zip(
            NAMES,
            np.asarray(WALKER.impact(jnp.array([before[name] for name in NAMES]))).tolist(),
            strict=True,
        )
    )


def test_o4_to_o1_needs_the_swing_leg_to_move_forward_right_after_touchdown(crossing):
    assert crossing.verdict == "sometimes"
    verdicts = {str(one.part): one.verdict for one in crossing.conditions}
    assert verdicts == {
        "theta_1 > 0": "always",
        "theta_2 <= 0": "always",
        "dtheta_1 <= 0": "sometimes",
        "dtheta_2 > 0": "sometimes",
    }


def test_the_sentences_begin_with_the_answer(crossing):
    assert crossing.sentences[0] == "O4 → O1 is taken in the instant of a touchdown exactly where"


def test_the_condition_is_the_one_that_the_impact_law_gives_by_hand(crossing):
    # θ̇₂⁺ = (l c θ̇₁⁺ − a θ̇₁)/b with the paper's numbers: [(3 c² − 13/8) θ̇₁ − c/4 θ̇₂] / (13/8 − c²/2).
    stance, swing = (one.before for one in crossing.conditions[2:])
    assert stance.left == {"dtheta_1": (0, 1.25, 0), "dtheta_2": (0, 0, -0.125)}
    assert swing.left == {"dtheta_1": (3, 0, -1.625), "dtheta_2": (0, -0.25, 0)}
    assert str(swing) == "(3 c² − 1.625) θ\u0307₁ − 0.25 c θ\u0307₂ > 0"


def test_both_witnesses_are_confirmed_by_the_plant(crossing, x64):
    phase = {phase.name: phase.predicate for phase in WALKING.phases}
    for jump, taken in ((crossing.taken, True), (crossing.refused, False)):
        assert holds(phase["O4"], jump.before)
        assert jump.before["theta_1"] == -jump.before["theta_2"]
        assert jump.after == after_impact(jump.before)
        assert holds(phase["O1"], jump.after) == taken


def test_the_virtual_gravity_gait_does_not_cross_in_one_instant(crossing, x64):
    gait = crossing.gait
    assert WALKING.phase_at(gait.before) == "O4"
    assert gait.before["theta_1"] == pytest.approx(-gait.before["theta_2"], abs=1e-12)
    assert gait.after == after_impact(gait.before)
    assert gait.after["dtheta_2"] < 0
    step = 2 * np.sin(gait.before["theta_2"])
    assert step == pytest.approx(0.5895, abs=0.02)  # as the baseline's
    assert "The virtual-gravity gait does not take it, for it misses θ\u0307₂ > 0" in crossing.sentences[-1]


@settings(max_examples=5)  # each compiles a walker
@given(parameters, st.floats(0.05, 1.5), velocities, velocities, st.sampled_from(("<=", ">")))
def test_the_bound_before_says_what_the_impact_says_after(sizes, theta_2, dtheta_1, dtheta_2, relation):
    walker = CompassWalker(CompassParameters(**sizes))
    parts = [Comparison(name, relation, 0.25) for name in NAMES[2:]]
    phases = (Phase("any", "", All()), Phase("then", "", All(*parts)))
    edge = Edge("any", "then", "touchdown")
    behaviour = dataclasses.replace(WALKING, phases=phases, edges=(edge,), cycles=())
    conditions = explain_edge_at_impact(automaton(behaviour, walker), edge).conditions
    cos = float(np.cos(2 * theta_2))
    after = walker.velocities_after_impact(cos, dtheta_1, dtheta_2)
    for condition, value in zip(conditions, after, strict=True):
        assert condition.before is not None
        if abs(value - 0.25) > 1e-6:
            said = condition.before.holds(cos, {"dtheta_1": dtheta_1, "dtheta_2": dtheta_2})
            assert said == (value <= 0.25 if relation == "<=" else value > 0.25)


def test_what_always_or_never_happens_is_known():
    assert leading_to(Comparison("theta_1", ">", 0)).verdict == "always"
    assert "every touchdown in O4" in leading_to(Comparison("theta_1", ">", 0)).sentences[0]
    never = leading_to(Comparison("theta_1", "<", 0))
    assert never.verdict == "never"
    assert never.taken is None
    assert "θ₁ < 0 right after it, which never is" in never.sentences[1]


def test_a_phase_in_which_no_touchdown_happens_crosses_never():
    # In O1 the swing leg trails.
    assert leading_to(Comparison("theta_1", ">", -9), source="O1").verdict == "never"


def test_a_gait_that_does_not_walk_touches_down_nowhere():
    assert gait_touchdown(WALKER, seconds=0.1) is None


def test_what_cannot_be_asked_is_refused():
    with pytest.raises(BehaviourError, match="O1 → O2: it is not taken on touchdown"):
        explain_edge_at_impact(automaton(), WALKING.edges[0])
    released = CompassWalker(backward_passing_counts=True)
    with pytest.raises(BehaviourError, match="feet apart"):
        explain_edge_at_impact(automaton(walker=released), O4_TO_O1)


def test_the_command_prints_it(capsys):
    cli.main(["check", "compass-walking", "--plant", "compass", "--json"])
    (told,) = json.loads(capsys.readouterr().out)["crossings"]
    assert told["verdict"] == "sometimes"
    assert told["gait"]["after"]["dtheta_2"] < 0


def test_the_command_says_when_there_is_no_touchdown_to_ask_about(capsys):
    cli.main(["check", "squat-and-stand", "--plant", "compass"])
    assert "No edge is taken on touchdown" in capsys.readouterr().out
