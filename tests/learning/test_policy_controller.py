"""A policy is run outside of an environment as it is evaluated in one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coachable as co
from coachable.envs.symmetry.phase_mirror import PhaseMirror
from coachable.foundation.errors import ParameterError
from coachable.learning.policy import Policy
from tests.learning.mirrored_walk import DT, mirrored_walk


@pytest.mark.parametrize("observe", ["memory", "nothing"])
@pytest.mark.parametrize("form", ["schedule", "stay"])
def test_it_does_what_evaluations_do(form, observe):
    pytest.importorskip("mujoco")
    walk = mirrored_walk(form, observe)
    controller, memory = co.PolicyController(walk.policy), None
    assert controller.signal_names == controller.memory.form.behaviour.signal_names
    mirror = PhaseMirror.from_json(walk.policy.mirror)
    mirrored = np.array(mirror.phases)[walk.phases]
    assert 20 < mirrored.sum() < 600, "both halves must have been met"
    plain = controller.begin, controller.step
    compiled = [jax.jit(function) for function in plain]
    for row, begins in enumerate(walk.begins):
        # In NumPy, too, for as long as that takes no time.
        for begin, step in (compiled, plain) if row < 60 else (compiled,):
            seen = walk.observations[row], walk.signals[row]
            action, after = begin(*seen) if begins else step(memory, *seen, DT)
            np.testing.assert_allclose(action, walk.actions[row], atol=1e-5, err_msg=f"row {row}")
        memory = after
    if observe == "nothing":
        alone = jax.vmap(walk.policy)(jnp.asarray(walk.observations[mirrored]))
        assert np.abs(walk.actions[mirrored] - alone).max(1).min() > 0.01


def test_it_can_be_mapped():
    pytest.importorskip("mujoco")
    walk = mirrored_walk("schedule", "memory")
    controller = co.PolicyController(walk.policy)
    step = jax.jit(jax.vmap(controller.step, (0, 0, 0, None)))
    starts = np.flatnonzero(walk.begins)
    seen = jnp.asarray(walk.observations), jnp.asarray(walk.signals)
    _, memory = jax.vmap(controller.begin)(seen[0][starts], seen[1][starts])
    for row in range(1, 100):
        actions, memory = step(memory, seen[0][starts + row], seen[1][starts + row], DT)
        np.testing.assert_allclose(actions, walk.actions[starts + row], atol=1e-5)


def test_a_policy_that_remembers_nothing_goes_by_what_it_observes():
    policy = Policy((jnp.array([[1.0, 2.0]]),), (jnp.zeros(1),), -jnp.ones(1), jnp.ones(1))
    controller = co.PolicyController(policy)
    assert controller.signal_names == ()
    action, memory = controller.begin([0.1, 0.2])
    assert (float(action[0]), memory) == (pytest.approx(0.5), None)
    action, memory = controller.step(memory, [0.1, 0.1], [], elapsed=0.1)
    assert (float(action[0]), memory) == (pytest.approx(0.3), None)


def test_what_has_another_size_is_named():
    pytest.importorskip("mujoco")
    walk = mirrored_walk("stay", "memory")
    controller, seen, signals = co.PolicyController(walk.policy), walk.observations[0], walk.signals[0]
    with pytest.raises(ParameterError, match=r"observation must be 17 numbers; got shape \(16,\)"):
        controller.begin(seen[1:], signals)
    with pytest.raises(
        ParameterError, match=r"signals must be \d numbers: .*forward_speed.*; got shape \(1,\)"
    ):
        controller.begin(seen, signals[:1])
    with pytest.raises(ParameterError, match="call begin"):
        controller.step(None, seen, signals, DT)
