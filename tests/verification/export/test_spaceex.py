from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours.behaviour import Behaviour, Phase
from coachable.behaviours.expressions import Call, Variable
from coachable.behaviours.predicates import Any, Comparison
from coachable.foundation.errors import ParameterError
from coachable.plants.compass import STATE_NAMES, CompassWalker
from coachable.verification.export.model import Model
from coachable.verification.export.spaceex import spaceex
from tests.verification.export.composition import BadModel, Composition

GOLDEN = Path(__file__).parent / "golden"
PARAM = '    <param name="{}" local="false" type="real" d1="1" d2="1" dynamics="{}" controlled="{}" />\n'


@pytest.mark.parametrize("driven", ["bare", "gravity", "policy"])
def test_every_name_is_declared_and_the_file_is_as_it_was(models, driven):
    text = spaceex(models[driven])
    Composition(text)
    assert text == (GOLDEN / f"{driven}.xml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("there", "instead", "said"),
    [
        (PARAM.format("g", "const", "true"), "", "walker: g is not declared"),
        (PARAM.format("foot", "any", "true"), "", "walker: foot is not declared"),
        (PARAM.format("t", "any", "true"), "", "sampler: t is not declared"),
        ("theta_1' == dtheta_1", "theta_3' == dtheta_1", "walker: theta_3 is not declared"),
        ("<invariant>t &lt;= period", "<invariant>t &lt;= pause", "sampler: pause is not declared"),
        ("theta_1 := theta_2", "hipmass := theta_2", "walker: hipmass is not its to change"),
        ("u_1' == 0", "theta_1' == 0", "sampler: theta_1 is not its to change"),
        ("t := 0 &amp;", "t := 0 &amp;&amp;", "assignment"),
        ("theta_2 &lt;= theta_1", "theta_2 = theta_1", "invariant"),
        ('<map key="g">9.807</map>', "", "'g'} is not bound"),
        ('<map key="g">9.807</map>', '<map key="g">nine</map>', "g is bound to nine"),
        ('<map key="foot">foot</map>', '<map key="foot">fuss</map>', "foot is bound to fuss"),
        ('source="3" target="2"', 'source="3" target="7"', "target 7 is no location"),
        ('<param name="touchdown" local="false" type="label" />', "", "touchdown is not declared"),
        ('name="O1"', 'name="O 1"', "'O 1' is no name"),
        ('<location id="2" name="O2">', '<location id="1" name="O2">', "two locations have one id"),
        ('<bind component="sampler"', '<bind component="walker"', "not bound"),
        ("initially: ", "<flow>a' == 1</flow>", "flow in .*note"),
    ],
)
def test_a_broken_file_is_refused(models, there, instead, said):
    text = spaceex(models["gravity"])
    assert there in text
    with pytest.raises(BadModel, match=said):
        Composition(text.replace(there, instead))


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("driven", ["bare", "gravity", "policy"])
def test_the_walker_flows_and_jumps_as_the_plant_does(models, states, driven):
    plant, composition = CompassWalker(), Composition(spaceex(models[driven]))
    for state in states:
        x, u = (jnp.array([state[name] for name in names]) for names in (STATE_NAMES, ("u_1", "u_2")))
        for side in ("behind", "ahead", "below"):
            rates = composition.flow("walker", side, state)
            np.testing.assert_allclose([rates[name] for name in STATE_NAMES], plant.flow(x, u), rtol=1e-12)
            assert rates["foot"] == 0
        jump = composition.assigned("walker", "touchdown", state | {"foot": 0.5})
        np.testing.assert_allclose([jump[name] for name in STATE_NAMES], plant.impact(x), rtol=1e-12)
        np.testing.assert_allclose(jump["foot"], 0.5 + plant.step_length(x), rtol=1e-12)


@pytest.mark.usefixtures("x64")
def test_a_sample_asks_for_what_the_controller_does(models, states):
    composition = Composition(spaceex(models["gravity"]))
    for state in states:
        sample = composition.assigned("sampler", None, state)
        torques = models["gravity"].controller(jnp.array([state[name] for name in STATE_NAMES]))
        np.testing.assert_allclose([sample["u_1"], sample["u_2"]], torques, rtol=1e-13)
        assert sample["t"] == 0


def test_a_network_is_any_torque_within_its_bounds(models):
    text = spaceex(models["policy"])
    composition = Composition(text)
    sample = composition.assigned("sampler", None, {"any_1": -1.5, "any_2": -0.5, "t": 0.01})
    assert sample == {"t": 0, "u_1": -1.5, "u_2": -0.5}
    assert "-2 &lt;= any_1 &amp; any_1 &lt;= 0" in text
    assert "The network is not in the model" in text
    assert composition.assigned("sampler", "touchdown", {}) == {"t": 0.01}


def test_what_spaceex_could_not_read_is_refused(models):
    signals = models["bare"].behaviour.signals
    low = Comparison("theta_1", "<", 0)
    for predicate in (
        Any(low, Comparison("theta_2", ">", 0)),
        Comparison(Call("sin", Variable("theta_1")), "<", 0),
    ):
        behaviour = Behaviour("odd", "", signals, (Phase("P1", "", predicate),), ())
        with pytest.raises(ParameterError, match=r"'P1' of 'odd'.*\.kyx"):
            spaceex(Model("odd", behaviour, None, CompassWalker()))
