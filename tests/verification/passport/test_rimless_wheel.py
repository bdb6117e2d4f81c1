"""A plant that only the tests have gets a passport, and its numbers are those known in closed form."""

import io
import math
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest
from rich.console import Console

from coachable.behaviours.library import load_behaviour
from coachable.foundation.errors import ParameterError
from coachable.plants.controllers import ConstantTorque
from coachable.verification.export.model import Model
from coachable.verification.falsification.falsify import falsify
from coachable.verification.falsification.perturbation import HeldTorques
from coachable.verification.passport import verify as verify_module
from coachable.verification.passport.closed_loop import baseline_subject
from coachable.verification.passport.passport import read_passport
from coachable.verification.passport.text import print_passport
from coachable.verification.passport.verify import verify
from coachable.verification.robustness import pushes as pushes_module
from coachable.verification.robustness.pushes import pushes
from tests.plants import rimless_wheel
from tests.plants.rimless_wheel import RimlessWheel

WHEEL = RimlessWheel()
ROLLING = load_behaviour(Path(rimless_wheel.__file__).with_name("rolling.behaviour"))
MULTIPLIER = math.cos(2 * WHEEL.parameters.half_angle) ** 2
SUBJECT = baseline_subject("none", WHEEL, behaviour=ROLLING)


@pytest.fixture(scope="module")
def passport(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verify_module, "NUM_STARTS", {"quick": 60, "full": 60})
        folder = tmp_path_factory.mktemp("passports")
        (made,) = verify([SUBJECT], "quick", folder)
        assert read_passport(folder / "none.json").verdict == made.verdict
        assert (folder / "none-automaton.svg").exists()
    return made


def test_it_rolls_as_described(passport):
    seen = passport.adherence
    assert seen.up
    assert seen.seconds == pytest.approx(100.0, abs=0.011)
    assert seen.follows
    assert seen.share_in_phases == 1
    ((_, cycles),) = seen.cycles.items()
    assert cycles == pytest.approx(100 / passport.orbits.touchdown.period, abs=2)


def test_its_orbit_is_the_one_known(passport):
    p, orbit = WHEEL.parameters, passport.orbits.touchdown
    assert (orbit.kind, orbit.num_steps) == ("periodic", 1)
    assert orbit.points[0] == pytest.approx((WHEEL.fixed_point,), abs=1e-9)
    assert orbit.step_length == pytest.approx(2 * p.length * math.sin(p.half_angle), abs=1e-12)
    assert orbit.cost_of_transport == 0  # nobody drives it
    assert passport.orbits.free.points[0] == pytest.approx((WHEEL.fixed_point,), abs=1e-6)


def test_its_multiplier_is_the_one_known(passport):
    found = passport.stability
    (multiplier,) = found.multipliers
    assert multiplier == pytest.approx(MULTIPLIER, abs=1e-8)
    assert found.verdict == "stable"
    assert found.norm == pytest.approx(MULTIPLIER, abs=1e-8)
    assert found.num_clipped == (0,)


def test_it_falls_back_where_it_does_not_get_over_the_first_spoke(passport):
    around, section = passport.basins
    assert around.fell.count == 0  # upright it is over the spoke already
    # From −α it gets over the spoke, at −γ, if its kinetic energy is enough.
    p = WHEEL.parameters
    least = math.sqrt(2 * p.gravity / p.length * (1 - math.cos(p.half_angle - p.slope)))
    ((low, high),) = WHEEL.section_box
    assert section.fell.interval[0] <= (least - low) / (high - low) <= section.fell.interval[1]
    assert section.reached.share > 0.5


def test_its_passport_is_printed_in_its_own_names(passport):
    console = Console(file=io.StringIO(), width=120)
    print_passport(passport, WHEEL, console)
    text = console.file.getvalue()
    assert "none: walks and settles to a gait that repeats every step" in text
    assert f"θ̇ = {WHEEL.fixed_point:.6f} rad/s" in text
    assert "ankle" not in text
    assert "(0.6 … 2)" in text


def test_driven_it_pays_for_its_way(monkeypatch):
    driven = replace(SUBJECT, controller=ConstantTorque((0.2,)))
    monkeypatch.setattr(verify_module, "NUM_STARTS", {"quick": 4, "full": 4})
    (found,) = verify([driven], "quick", None)
    orbit = found.orbits.touchdown
    # The torque works over an angle of 2α a step.
    p = WHEEL.parameters
    work = 0.2 * 2 * p.half_angle
    assert orbit.cost_of_transport == pytest.approx(work / (WHEEL.weight * orbit.step_length), rel=1e-6)


def test_it_is_kicked_along_its_velocity_and_nothing_else(passport, monkeypatch):
    for name, value in (("SECONDS", 2.0), ("_LEVELS", 4), ("_REFINEMENTS", 1), ("NOISE_SEEDS", 2)):
        monkeypatch.setattr(pushes_module, name, value)
    point = np.array(passport.orbits.touchdown.points[0])
    with jax.enable_x64(False):
        found = pushes(SUBJECT.loop, "free", point)
    assert [one.what for one in found.tolerances] == ["kick, dtheta up", "kick, dtheta down", "torque noise"]
    up, down, _ = found.tolerances
    assert up.amount == up.tried
    assert down.amount < down.tried
    console = Console(file=io.StringIO(), width=120)
    print_passport(replace(passport, pushes=found), WHEEL, console)
    assert "no constants of the rimless wheel were changed" in console.file.getvalue()


def test_what_it_does_not_give_is_a_sentence():
    with pytest.raises(ParameterError, match="the rimless wheel has no second statement for SciPy"):
        falsify(WHEEL, SUBJECT.controller, HeldTorques(0.1), budget=16)
    with pytest.raises(ParameterError, match="the rimless wheel gives no equations as text"):
        Model("wheel", ROLLING, None, WHEEL)
