"""A disturbed walker is the one with other parameters; limits are among the amounts that are tried."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.plants.compass import CompassParameters, CompassWalker
from coachable.verification.gait.closed_loop import ClosedLoop
from coachable.verification.robustness import pushes as pushes_module
from coachable.verification.robustness.pushes import pushes
from tests.verification.conftest import WALKS


def other(**changes):
    """A walker that is other than nominal in these ways."""
    walker = CompassWalker()
    nominal = dict(walker.disturbances().nominal)
    return walker.disturbed({name: jnp.asarray(value) for name, value in (nominal | changes).items()})


@pytest.mark.parametrize(("mass", "length", "gravity"), [(1.0, 1.0, 1.0), (3.0, 0.5, 1.0), (0.7, 1.3, 0.2)])
def test_it_is_the_walker_with_these_parameters(x64, mass, length, gravity):
    scaled = CompassParameters(1.0 * mass, 0.5 * mass, 0.5 * length, 0.5 * length, 9.807 * gravity)
    expected, got = CompassWalker(scaled), other(mass=mass, length=length, gravity=gravity)
    x = jnp.asarray(np.random.default_rng(0).uniform(-1, 1, (50, 4)))
    torque = jnp.array([-1.0, 0.3])
    for one, two in (
        (lambda x: got.flow(x, torque), lambda x: expected.flow(x, torque)),
        (got.events[0].reset, expected.impact),
        (got.events[0].guard, expected.guard),
        (got.fall_margin, expected.fall_margin),
    ):
        np.testing.assert_allclose(jax.vmap(one)(x), jax.vmap(two)(x), rtol=1e-11, atol=1e-11)


def test_a_slope_changes_the_ground_and_not_the_fall(x64):
    walker, flat = other(slope=0.1), CompassWalker()
    x = jnp.array([0.4, -0.2, -1.0, 0.5])
    np.testing.assert_allclose(walker.flow(x, jnp.zeros(2)), flat.flow(x, jnp.zeros(2)), rtol=1e-14)
    # Both feet are on rising ground where the legs' mean is its angle.
    assert walker.events[0].guard(x) == pytest.approx(0.0, abs=1e-15)
    assert flat.guard(x) > 0


def test_limits_are_of_the_amounts_that_are_tried(settled, monkeypatch):
    walk, _ = settled["free"]
    for name, value in (("SECONDS", 2.0), ("_LEVELS", 4), ("_REFINEMENTS", 2), ("NOISE_SEEDS", 4)):
        monkeypatch.setattr(pushes_module, name, value)
    found = pushes(ClosedLoop(CompassWalker(), WALKS), "free", walk.section[-1])
    limits = {one.what: one for one in found.tolerances}
    assert len(limits) == len(found.tolerances) == 17
    assert all(0 <= one.amount <= one.tried for one in found.tolerances)
    assert limits["kick, swing leg back"].amount > 0
    assert limits["slope up"].amount < 0.3
    assert limits["kick, stance leg back"].amount < 3.0
    assert found.delay_survived
