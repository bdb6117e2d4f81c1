"""Other masses, lengths and gravity do what dimensions say; limits are survived and what is beyond is not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.plants.compass import CompassWalker
from coachable.verification import pushes as pushes_module
from coachable.verification.disturbance import disturbed_walker, undisturbed
from coachable.verification.pushes import pushes
from coachable.verification.section import Loop

from .conftest import WALKS

NO_TORQUE = jnp.zeros(2)


def flows(x, control, **changes):
    """The accelerations of a disturbed walker, in states side by side."""
    values = undisturbed()
    disturbance = type(values)(**{**vars(values), **{k: jnp.asarray(v) for k, v in changes.items()}})
    return jax.vmap(lambda x: disturbed_walker(CompassWalker(), disturbance).flow(x, control))(x)


@pytest.fixture
def x():
    return jnp.asarray(np.random.default_rng(0).uniform(-1, 1, (20, 4)), jnp.float32)


def test_without_a_disturbance_nothing_changes(x):
    plant, torque = CompassWalker(), jnp.array([-1.0, 0.3])
    np.testing.assert_allclose(flows(x, torque), jax.vmap(lambda x: plant.flow(x, torque))(x), rtol=1e-5)


def test_masses_do_not_matter_to_falling_and_are_pushed_harder_to_move_the_same(x):
    np.testing.assert_allclose(flows(x, NO_TORQUE, mass=3.0), flows(x, NO_TORQUE), rtol=1e-4, atol=1e-4)
    torque = jnp.array([-1.0, 0.3])
    np.testing.assert_allclose(flows(x, 3 * torque, mass=3.0), flows(x, torque), rtol=1e-4, atol=1e-4)


def test_longer_legs_in_stronger_gravity_swing_the_same(x):
    same = flows(x, NO_TORQUE, length=2.0, gravity=2.0)
    np.testing.assert_allclose(same, flows(x, NO_TORQUE), rtol=1e-4, atol=1e-4)


def test_a_slope_changes_the_ground_and_not_the_fall():
    disturbance = undisturbed()
    tilted = type(disturbance)(**{**vars(disturbance), "slope": jnp.asarray(0.1)})
    walker, flat = disturbed_walker(CompassWalker(), tilted), CompassWalker()
    x = jnp.array([0.4, -0.2, -1.0, 0.5])
    np.testing.assert_array_equal(walker.flow(x, NO_TORQUE), flat.flow(x, NO_TORQUE))
    # Both feet are on rising ground where the legs' mean is its angle.
    assert walker.guard(x) == pytest.approx(0.0, abs=1e-7)
    assert flat.guard(x) > 0


def test_limits_are_of_the_amounts_that_are_tried(settled, monkeypatch):
    walk, _ = settled["free"]
    for name, value in (("SECONDS", 2.0), ("_LEVELS", 4), ("_REFINEMENTS", 2), ("NOISE_SEEDS", 4)):
        monkeypatch.setattr(pushes_module, name, value)
    found = pushes(Loop(CompassWalker(), WALKS), "free", walk.section[-1])
    limits = {one.what: one for one in found.tolerances}
    assert len(limits) == len(found.tolerances) == 17
    assert all(0 <= one.amount <= one.tried for one in found.tolerances)
    assert limits["kick, swing leg back"].amount > 0
    assert limits["slope up"].amount < 0.3
    assert limits["kick, stance leg back"].amount < 3.0
    assert found.delay_survived
