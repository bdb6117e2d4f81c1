"""The return map is that of the plant's equations, and three ways of taking its derivative agree."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from coachable.plants.compass import CompassParameters, CompassWalker, VirtualGravity
from coachable.verification.gait.closed_loop import stacked
from coachable.verification.gait.orbit import follow

SLOPE = -0.07


def random_states(count=50):
    rng = np.random.default_rng(0)
    return jnp.asarray(rng.uniform([-0.5, -0.5, -2, -3], [0.5, 0.5, 2, 3], (count, 4)))


def test_the_section_is_where_both_feet_are_on_the_ground(x64):
    plant, y = CompassWalker(), jnp.array([0.3, -1.1, -0.2])
    x = plant.from_section(y)
    np.testing.assert_array_equal(plant.to_section(x), y)
    assert plant.guard(x) == 0
    assert plant.on_section(x)
    assert not plant.on_section(plant.from_section(-y))
    assert not plant.on_section(x + jnp.array([1e-3, 0, 0, 0]))


def test_virtual_gravity_is_passive_walking_down_a_slope_in_stronger_gravity(x64):
    flat = CompassWalker()
    controller = VirtualGravity(flat, slope=SLOPE)
    steeper = CompassWalker(CompassParameters(gravity=9.807 / np.cos(SLOPE)))
    changes = dict(steeper.disturbances().nominal) | {"slope": SLOPE}
    slope = steeper.disturbed({name: jnp.asarray(value) for name, value in changes.items()})
    (touchdown,) = slope.events
    x = random_states()
    upright = x + SLOPE * jnp.array([[1.0, 1.0, 0.0, 0.0]])

    def both(of_flat, of_slope, atol):
        np.testing.assert_allclose(jax.vmap(of_flat)(x), jax.vmap(of_slope)(upright), rtol=1e-13, atol=atol)

    both(lambda x: flat.flow(x, controller(x)), lambda x: slope.flow(x, jnp.zeros(2)), 1e-12)
    both(flat.guard, touchdown.guard, 1e-15)
    both(flat.step_length, touchdown.displacement, 1e-15)
    both(lambda x: flat.impact(x)[2:], lambda x: touchdown.reset(x)[2:], 1e-13)


def scipy_stride(loop, y):
    """P(y) and DP(y): the variational equation by DOP853, and an explicit saltation matrix at touchdown."""
    plant, continuous = loop.plant, loop.hold == "continuous"

    @jax.jit
    def derivative(state, held):
        x, by_start, by_held = state[:4], state[4:20].reshape(4, 4), state[20:].reshape(4, 2)
        u = loop.controller(x) if continuous else held
        slope, by_torque = jax.jacfwd(plant.flow)(x, u), jax.jacfwd(plant.flow, argnums=1)(x, u)
        if continuous:
            slope += by_torque @ jax.jacfwd(loop.controller)(x)
        parts = (plant.flow(x, u), (slope @ by_start).ravel(), (slope @ by_held + by_torque).ravel())
        return jnp.concatenate(parts)

    @jax.jit
    def look(x):
        return plant.guard(x), loop.controller(x), jax.jacfwd(loop.controller)(x)

    def comes_down(_, state, held):
        return float(look(state[:4])[0]) if state[1] > state[0] else 1.0

    comes_down.terminal, comes_down.direction = True, -1
    x = np.asarray(plant.from_section(jnp.asarray(y)))
    jacobian = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, 1]])
    for _ in range(200):
        _, held, feedback = map(np.asarray, look(x))
        solved = solve_ivp(
            lambda _, state, held: np.asarray(derivative(state, held)),
            (0, loop.control_dt),
            np.concatenate([x, np.eye(4).ravel(), np.zeros(8)]),
            "DOP853",
            args=(held,),
            events=comes_down,
            rtol=1e-10,
            atol=1e-11,
        )
        end = solved.y[:, -1]
        by_start, by_held = end[4:20].reshape(4, 4), end[20:].reshape(4, 2)
        jacobian = (by_start if continuous else by_start + by_held @ feedback) @ jacobian
        x = end[:4]
        if solved.status == 1:
            velocity, normal = (
                np.asarray(derivative(end, held))[:4],
                np.asarray(jax.grad(plant.guard)(jnp.asarray(x))),
            )
            projection = np.eye(4) - np.outer(velocity, normal) / (normal @ velocity)
            at = jnp.asarray(x)
            saltation = np.asarray(jax.jacfwd(plant.impact)(at)) @ projection
            to_section = np.array([[0.5, -0.5, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
            return to_section @ np.asarray(plant.impact(at)), to_section @ saltation @ jacobian
    raise AssertionError("no touchdown")


@pytest.mark.parametrize("name", ["walker", "slope_walker"])
def test_the_return_map_and_its_derivative_agree_with_scipy_and_differences(request, x64, name):
    loop = request.getfixturevalue(name)
    loops, y, one = stacked([loop]), np.array([0.31, -1.17, -0.17]), np.array([1])
    after, jacobian, (strides,) = follow(loops, y[None], one)
    assert strides[0].landed
    expected, expected_jacobian = scipy_stride(loop, y)
    np.testing.assert_allclose(after[0], expected, atol=2e-7)
    np.testing.assert_allclose(jacobian[0], expected_jacobian, atol=1e-6)
    for column, step in enumerate(1e-5 * np.eye(3)):
        ahead, back = (follow(loops, (y + way * step)[None], one)[0][0] for way in (1, -1))
        np.testing.assert_allclose(jacobian[0][:, column], (ahead - back) / 2e-5, atol=1e-6)


def test_halving_the_integration_steps_divides_the_derivatives_error_by_sixteen(x64, walker):
    loops, y, one = stacked([walker]), np.array([[0.31, -1.17, -0.17]]), np.array([1])
    coarse, finer, finest = (follow(loops, y, one, refinement)[1] for refinement in (1, 2, 8))
    assert 10 < np.linalg.norm(coarse - finest) / np.linalg.norm(finer - finest) < 25


def test_where_nobody_touches_down_there_is_no_derivative(x64, walker):
    after, jacobian, (strides,) = follow(stacked([walker]), np.array([[0.3, 3.0, 0.0]]), np.array([2]))
    assert not strides[0].landed
    assert np.isnan(after).all()
    assert np.isnan(jacobian).all()
