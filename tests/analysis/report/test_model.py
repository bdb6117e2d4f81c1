"""The page's model in JavaScript: its own tests, and the walker's geometry against the plant's."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.plants.compass import CompassParameters, CompassWalker


def test_the_scripts_own_tests_pass(node):
    done = node("--test", str(Path(__file__).with_name("model.test.js")))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.usefixtures("x64")
def test_hip_and_swing_foot_are_where_the_plant_has_them(in_node):
    plant = CompassWalker(CompassParameters(a=0.3, b=0.9))
    theta_1, theta_2, foot_x = np.random.default_rng(0).uniform(-1.5, 1.5, size=(3, 20))
    parts = in_node(
        "input.map(([a, b, x]) => limbs(a, b, x, { leg: 1.2, a: 0.3, b: 0.9 }))",
        np.stack([theta_1, theta_2, foot_x], axis=-1).tolist(),
    )
    x = jnp.stack([theta_1, theta_2, jnp.zeros(20), jnp.zeros(20)], axis=-1)
    for name, place in (("hip", plant.base), ("swing", plant.swing_foot)):
        expected = jax.vmap(place)(x, jnp.asarray(foot_x))
        np.testing.assert_allclose([part[name] for part in parts], expected, atol=1e-12)
