from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours.behaviour import Behaviour, Edge, Phase
from coachable.behaviours.predicates import All, Any, Comparison, Not, Signal
from coachable.foundation.errors import BehaviourError, ParameterError
from coachable.plants.compass import STATE_NAMES, CompassParameters, CompassWalker, VirtualGravity
from coachable.plants.controllers import ConstantTorque
from coachable.plants.equations import decimal, inlined
from coachable.verification.export.keymaerax import keymaerax
from coachable.verification.export.model import Model
from tests.verification.export.archive import Archive, BadArchive

GOLDEN = Path(__file__).parent / "golden"
DRIVEN = ("bare", "gravity", "policy")


def vector(values, names=STATE_NAMES):
    return jnp.array([values[name] for name in names])


@pytest.mark.parametrize("driven", DRIVEN)
def test_every_name_is_declared_and_the_file_is_as_it_was(models, driven):
    text = keymaerax(models[driven])
    Archive(text)
    assert text == (GOLDEN / f"{driven}.kyx").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("there", "instead", "said"),
    [
        ("  Real coupling = legmass * b * leg;\n", "", "coupling is not declared"),
        ("  Real foot; /* where the stance foot stands */\n", "", "foot is not declared"),
        ("  Real t; /* since the last sample */\n", "", "t is not declared"),
        ("import kyx.math.{cos,sin};", "import kyx.math.{cos};", "sin is not declared"),
        ("import kyx.math.{cos,sin};", "import kyx.math.{cos,sin,tan};", "has no tan"),
        ("t := 0;", "s := 0;", "s is not a program variable"),
        ("lever * cosine(theta_1, theta_2) * swing", "lever * cosine(theta_1) * swing", "takes 2 arguments"),
        ("& t <= period }", "& t }", "a number, not a formula"),
        ("?location = 0 & O2(", "?location = 0 & steplength(", "takes 2 arguments"),
        ("Real legmass = 0.5;", "Real leg_mass = 0.5;", "No terminal"),
        ("Real period = 0.01;", "Real period = 1e-2;", "No terminal"),
        ("Real lever = leg / b;", "Real lever = leg / b", "Unexpected token"),
        ("Real lever = leg / b;", "Real lever = leg / b; Real lever = leg;", "defined twice"),
        ("Real u_2;", "Real u_2; Real b;", "declared twice"),
        ("\nEnd.\n\nEnd.", "\nEnd.", "Unexpected"),
    ],
)
def test_a_broken_archive_is_refused(models, there, instead, said):
    text = keymaerax(models["gravity"])
    assert there in text
    with pytest.raises(BadArchive, match=said):
        Archive(text.replace(there, instead))


def test_there_are_no_comments_in_the_formula(models):
    for model in models.values():
        problem = keymaerax(model).partition("\nProblem\n")[2]
        assert "/*" not in problem
        assert "//" not in problem


@pytest.mark.usefixtures("x64")
def test_the_archive_flows_and_jumps_as_the_plant_does(models, states):
    walker, archive = CompassWalker(), Archive(keymaerax(models["bare"]))
    for state in states:
        x, u = vector(state), vector(state, ("u_1", "u_2"))
        rates = [archive(name, **state) for name in ("ddtheta_1", "ddtheta_2")]
        np.testing.assert_allclose(rates, walker.flow(x, u)[2:], rtol=1e-12)
        jump = [archive(name, **state) for name in ("after_1", "after_2")]
        np.testing.assert_allclose(jump, walker.impact(x)[2:], rtol=1e-12)
        np.testing.assert_allclose(archive("steplength", **state), walker.step_length(x), atol=1e-15)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("released", [False, True])
def test_the_controller_is_the_formula_for_any_walker_and_slope(models, states, released):
    plant = CompassWalker(CompassParameters(hip_mass=2.0, leg_mass=0.3, a=0.4, b=0.7, gravity=1.62))
    controller = VirtualGravity(plant, slope=-0.11, released=released)
    model = Model("other", models["gravity"].behaviour, controller, plant)
    archive = Archive(keymaerax(model))
    for state in states:
        torques = [archive(name, **state) for name in ("torque_1", "torque_2")]
        np.testing.assert_allclose(torques, controller(vector(state)), rtol=1e-13)


def test_a_constant_torque_is_written_out(models):
    model = Model("constant", models["gravity"].behaviour, ConstantTorque((-1.35, -0.18)), CompassWalker())
    archive = Archive(keymaerax(model))
    assert (archive("torque_1"), archive("torque_2")) == (-1.35, -0.18)


def test_a_phase_is_where_the_behaviour_says(models, states):
    archive, behaviour = Archive(keymaerax(models["gravity"])), models["gravity"].behaviour
    for state in states:
        here = [name for name in (*behaviour.phase_names, "outside") if archive(name, **state)]
        assert here == [behaviour.phase_at(state) or "outside"]


def test_neighbours_share_their_boundary(models):
    archive = Archive(keymaerax(models["gravity"]))
    between = {"theta_1": 0.1, "theta_2": 0.0, "dtheta_1": -1.0, "dtheta_2": 1.0}
    assert archive("O1", **between)
    assert archive("O2", **between)
    assert archive("outside", **between)


@pytest.mark.usefixtures("x64")
def test_a_touchdown_takes_the_edge_or_leads_outside_and_lets_the_plant_jump(models):
    archive, walker = Archive(keymaerax(models["policy"])), CompassWalker()
    touchdown = archive.branches[-2]
    x = {"theta_1": -0.3, "theta_2": 0.3, "dtheta_1": -1.5, "dtheta_2": -0.9}
    before = x | {"location": 3.0, "leads": 1.0, "foot": 0.5, "t": 0.004, "u_1": -1.0, "u_2": 0.0}
    ends = archive.after(touchdown, before)
    assert [end["location"] for end in ends] == [0, 4]
    for end in ends:
        np.testing.assert_allclose(vector(end), walker.impact(vector(x)), rtol=1e-13)
        assert end["foot"] == pytest.approx(0.5 + float(walker.step_length(vector(x))))
        assert (end["leads"], end["t"]) == (0, 0.01)  # the clock restarts, so a sample is due
    for change in ({"leads": 0.0}, {"theta_2": 0.31}, {"dtheta_2": 1.6}):
        assert archive.after(touchdown, before | change) == []


def test_bare_a_touchdown_has_the_automatons_edges_alone(models):
    archive = Archive(keymaerax(models["bare"]))
    x = {"theta_1": -0.3, "theta_2": 0.3, "dtheta_1": -1.5, "dtheta_2": -0.9, "leads": 1.0, "foot": 0.0}
    ends = [archive.after(archive.branches[-2], x | {"location": float(at)}) for at in range(4)]
    assert [[end["location"] for end in each] for each in ends] == [[], [], [], [0]]


def test_a_network_is_its_bounds_and_the_archive_says_so(models):
    text = keymaerax(models["policy"])
    archive = Archive(text)
    _, within = archive.branches[0].find_data("test")
    for u_1, inside in ((-2.0, True), (0.0, True), (0.1, False), (-2.1, False)):
        assert archive.value(within.children[0], {"u_1": u_1, "u_2": -1.0}) == inside
    assert "The network is not in the model" in text


def test_any_predicate_is_closed_and_any_name_is_harmless():
    x = Signal("theta_1", "rad")
    odd = Any(
        Not(All(Comparison("theta_1", ">", 1e-7), Comparison("theta_1", "<", -0.25))),
        Comparison(2, ">", "theta_1"),
    )
    behaviour = Behaviour(
        'say "no" */',
        "back\\slash",
        (x,),
        (Phase("a b", 'x */ "', odd), Phase("P1", "", Not(odd))),
        (Edge("a b", "P1"),),
    )
    archive = Archive(keymaerax(Model('say "no" */', behaviour, None, CompassWalker())))
    state = dict.fromkeys(STATE_NAMES, 0.0)
    assert archive("phase_0", **state)
    assert not archive("P1", **state)
    assert archive("phase_0", **state | {"theta_1": 2.0})


def test_what_the_walker_does_not_have_is_refused(models):
    lamp = Behaviour("lamp", "", (Signal("light"),), (Phase("on", "", Comparison("light", ">", 0)),), ())
    with pytest.raises(ParameterError, match="no signal 'light'"):
        Model("lamp", lamp, None, CompassWalker())
    walking = models["bare"].behaviour
    ringing = Behaviour("x", "", walking.signals, walking.phases, (Edge("O1", "O2", "ring"),))
    with pytest.raises(BehaviourError, match="'ring'"):
        Model("ring", ringing, None, CompassWalker())


@pytest.mark.parametrize("value", [0.1, 1e-7, -2.0, 123456789.0, 1e22, 5e-324, 9.807])
def test_a_decimal_is_the_float(value):
    assert float(decimal(value)) == value
    assert "e" not in decimal(value)


def test_names_are_spelt_out_all_the_way():
    assert inlined("a1 + b_2", {"b_2": "c * a1", "a1": "x - y"}) == "(x - y) + (c * (x - y))"
