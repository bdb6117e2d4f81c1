"""The compass walker obeys mechanics: derived here from point masses, not from the formulas in the plant."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.foundation.errors import ParameterError
from coachable.plants import CompassParameters, CompassWalker, ConstantTorque, VirtualGravity, rk4

PAPER = CompassParameters()
WALKERS = [
    PAPER,
    CompassParameters(hip_mass=10.0, leg_mass=5.0, a=0.3, b=0.7, gravity=9.81),
    CompassParameters(hip_mass=0.2, leg_mass=3.0, a=1.1, b=0.4, gravity=1.62),
]
each_walker = pytest.mark.parametrize("parameters", WALKERS)
sizes = st.floats(0.05, 20.0)
any_walker = st.builds(CompassParameters, hip_mass=sizes, leg_mass=sizes, a=sizes, b=sizes, gravity=sizes)


def random_walkers(seed, num):
    values = 10 ** np.random.default_rng(seed).uniform(-1, 1, (num, 5))
    return [CompassParameters(*map(float, row)) for row in values]


pytestmark = pytest.mark.usefixtures("x64")


def random_states(seed, num=20):
    scale = np.array([1.0, 1.0, 3.0, 3.0])
    return jnp.asarray(np.random.default_rng(seed).uniform(-scale, scale, (num, 4)))


def random_torques(seed, num=20):
    return jnp.asarray(np.random.default_rng(seed).uniform(-3, 3, (num, 2)))


def masses(p):
    return jnp.array([p.leg_mass, p.hip_mass, p.leg_mass])


def positions(p, theta):
    """Stance leg's mass, hip, swing leg's mass; the stance foot is the origin."""
    stance, swing = theta
    up = jnp.array([-jnp.sin(stance), jnp.cos(stance)])
    down = jnp.array([jnp.sin(swing), -jnp.cos(swing)])
    hip = (p.a + p.b) * up
    return jnp.stack([p.a * up, hip, hip + p.b * down])


def velocities(p, theta, dtheta):
    return jax.jvp(lambda t: positions(p, t), (theta,), (dtheta,))[1]


def lagrangian(p, theta, dtheta):
    kinetic = jnp.sum(masses(p)[:, None] * velocities(p, theta, dtheta) ** 2) / 2
    return kinetic - p.gravity * jnp.sum(masses(p) * positions(p, theta)[:, 1])


def lagrange_accelerations(p, theta, dtheta, control):
    """Solve d/dt ∂L/∂θ̇ − ∂L/∂θ = Q, where Q does the work of an ankle and of a hip motor."""
    mass = jax.hessian(lagrangian, 2)(p, theta, dtheta)
    mixed = jax.jacfwd(jax.grad(lagrangian, 2), 1)(p, theta, dtheta)
    ankle, hip = control
    work = jax.grad(lambda t: ankle * t[0] + hip * (t[0] - t[1]))(theta)
    return jnp.linalg.solve(mass, work + jax.grad(lagrangian, 1)(p, theta, dtheta) - mixed @ dtheta)


@each_walker
def test_terms_of_the_equation_of_motion_are_the_lagrangians(parameters):
    walker = CompassWalker(parameters)

    @jax.jit
    @jax.vmap
    def compare(x):
        theta, dtheta = x[:2], x[2:]
        mass = jax.hessian(lagrangian, 2)(parameters, theta, dtheta)
        mixed = jax.jacfwd(jax.grad(lagrangian, 2), 1)(parameters, theta, dtheta)
        bias = mixed @ dtheta - jax.grad(lagrangian, 1)(parameters, theta, dtheta)
        at_rest = -jax.grad(lagrangian, 1)(parameters, theta, 0 * dtheta)
        return (
            walker.mass_matrix(x) - mass,
            walker.coriolis(x) @ dtheta + walker.gravity_torque(x) - bias,
            walker.gravity_torque(x) - at_rest,
        )

    for difference in compare(random_states(0)):
        np.testing.assert_allclose(difference, 0, atol=1e-12)


@each_walker
def test_flow_solves_the_equation_of_motion(parameters):
    walker = CompassWalker(parameters)
    states, torques = random_states(1), random_torques(2)
    flow = jax.jit(jax.vmap(walker.flow))(states, torques)
    np.testing.assert_array_equal(flow[:, :2], states[:, 2:])
    expected = jax.jit(jax.vmap(lambda x, u: lagrange_accelerations(parameters, x[:2], x[2:], u)))(
        states, torques
    )
    np.testing.assert_allclose(flow[:, 2:], expected, rtol=1e-11, atol=1e-11)

    def residual(x, u, dx):
        left = walker.mass_matrix(x) @ dx[2:] + walker.coriolis(x) @ x[2:] + walker.gravity_torque(x)
        return left - walker.input_matrix() @ u

    np.testing.assert_allclose(jax.vmap(residual)(states, torques, flow), 0, atol=1e-11)


@each_walker
def test_coriolis_does_no_work(parameters):
    walker = CompassWalker(parameters)

    def skew(x):
        mass_rate = jax.jvp(walker.mass_matrix, (x,), (jnp.concatenate([x[2:], jnp.zeros(2)]),))[1]
        return mass_rate - 2 * walker.coriolis(x)

    differences = jax.vmap(skew)(random_states(3))
    np.testing.assert_allclose(differences + jnp.swapaxes(differences, 1, 2), 0, atol=1e-12)


@each_walker
def test_energy_is_that_of_the_point_masses(parameters):
    walker = CompassWalker(parameters)
    for x in random_states(4, num=5):
        kinetic, potential = walker.energy(x)
        np.testing.assert_allclose(kinetic - potential, lagrangian(parameters, x[:2], x[2:]), atol=1e-11)
        resting_kinetic, resting_potential = walker.energy(x.at[2:].set(0))
        assert resting_kinetic == 0
        assert resting_potential == potential


@each_walker
def test_energy_changes_by_the_motors_power_alone(parameters):
    walker = CompassWalker(parameters)

    def energy_rate(x, u):
        return jax.jvp(lambda x: sum(walker.energy(x)), (x,), (walker.flow(x, u),))[1]

    states, torques = random_states(5), random_torques(6)
    power = jnp.sum(torques @ walker.input_matrix().T * states[:, 2:], axis=1)
    np.testing.assert_allclose(jax.vmap(energy_rate)(states, torques), power, rtol=1e-10, atol=1e-10)
    ankle_and_hip = torques[:, 0] * states[:, 2] + torques[:, 1] * (states[:, 2] - states[:, 3])
    np.testing.assert_allclose(power, ankle_and_hip, rtol=1e-12, atol=1e-12)


def test_energy_is_constant_along_a_passive_swing():
    walker = CompassWalker()
    x = jnp.array([0.25, -0.3, -1.4, 0.2])
    before = sum(walker.energy(x))

    def swing(_, x):
        return rk4(walker.flow, x, jnp.zeros(2), jnp.array(1e-3))

    x = jax.jit(lambda x: jax.lax.fori_loop(0, 600, swing, x))(x)
    assert abs(sum(walker.energy(x)) - before) < 1e-11


def angular_momenta(p, about, points, velocities):
    arms = points - about[None]
    return masses(p) * (arms[:, 0] * velocities[:, 1] - arms[:, 1] * velocities[:, 0])


def touchdown_states(seed, num=200):
    rng = np.random.default_rng(seed)
    half_angles = rng.uniform(0.01, 1.2, num)
    return jnp.asarray(np.column_stack([-half_angles, half_angles, rng.uniform(-4, 4, (num, 2))]))


@pytest.mark.parametrize("parameters", WALKERS + random_walkers(seed=0, num=4))
def test_impact_conserves_angular_momentum_and_never_adds_energy(parameters):
    p, walker = parameters, CompassWalker(parameters)

    @jax.jit
    @jax.vmap
    def across(x):
        after = walker.impact(x)
        new_foot = jnp.stack([walker.step_length(x), jnp.zeros(())])
        old, old_velocities = positions(p, x[:2]), velocities(p, x[:2], x[2:])
        new, new_velocities = positions(p, after[:2]) + new_foot[None], velocities(p, after[:2], after[2:])
        whole = [
            angular_momenta(p, new_foot, old, old_velocities).sum(),
            angular_momenta(p, new_foot, new, new_velocities).sum(),
        ]
        old_leg = [
            angular_momenta(p, old[1], old, old_velocities)[0],
            angular_momenta(p, new[1], new, new_velocities)[2],
        ]
        return after, new[::-1] - old, whole, old_leg, walker.energy(x), walker.energy(after)

    states = touchdown_states(12)
    after, moved, whole, old_leg, before_energy, after_energy = across(states)
    np.testing.assert_array_equal(after[:, :2], states[:, 1::-1])
    np.testing.assert_allclose(moved, 0, atol=1e-12)  # nothing moves; the legs only swap roles
    for before, afterwards in (whole, old_leg):
        scale = float(jnp.abs(before).max())
        np.testing.assert_allclose(afterwards, before, rtol=1e-11, atol=1e-12 * scale)
    assert (after_energy[0] <= before_energy[0] * (1 + 1e-12)).all()
    assert (after_energy[0] < 0.9 * before_energy[0]).any()
    np.testing.assert_allclose(after_energy[1], before_energy[1], rtol=1e-11, atol=1e-12)


def test_an_impact_at_rest_moves_nothing():
    x = jnp.array([-0.3, 0.3, 0.0, 0.0])
    np.testing.assert_array_equal(CompassWalker().impact(x)[2:], 0)


@each_walker
def test_flow_is_mirror_and_time_symmetric(parameters):
    walker = CompassWalker(parameters)
    states, torques = random_states(7), random_torques(8)
    flow = jax.vmap(walker.flow)
    np.testing.assert_allclose(flow(-states, -torques), -flow(states, torques), atol=1e-12)
    reversed_in_time = states.at[:, 2:].multiply(-1)
    np.testing.assert_allclose(
        flow(reversed_in_time, torques)[:, 2:], flow(states, torques)[:, 2:], atol=1e-12
    )


@settings(max_examples=25)
@given(any_walker, st.integers(0, 1000))
def test_any_positive_parameters_make_a_walker(parameters, seed):
    walker = CompassWalker(parameters)
    x, u = random_states(seed, num=1)[0], random_torques(seed, num=1)[0]
    accelerations = walker.flow(x, u)[2:]
    mass = walker.mass_matrix(x)
    assert mass[0, 0] > 0
    assert jnp.linalg.det(mass) > 0
    left = mass @ accelerations + walker.coriolis(x) @ x[2:] + walker.gravity_torque(x)
    np.testing.assert_allclose(left, walker.input_matrix() @ u, atol=1e-8 * (1 + float(jnp.abs(mass).max())))


@each_walker
def test_kinematics_are_those_of_the_point_masses(parameters):
    walker = CompassWalker(parameters)
    foot_x = jnp.array(1.7)
    for x in random_states(9, num=5):
        hip = walker.base(x, foot_x)
        expected = positions(parameters, x[:2])
        np.testing.assert_allclose(hip, expected[1] + jnp.array([foot_x, 0.0]), atol=1e-12)
        leg = parameters.leg_length / parameters.b * (expected[2] - expected[1])
        np.testing.assert_allclose(walker.swing_foot(x, foot_x), hip + leg, atol=1e-12)
        np.testing.assert_allclose(
            walker.swing_foot(x, foot_x)[0] - foot_x, walker.step_length(x), atol=1e-12
        )


def test_guard_has_the_sign_of_the_leading_swing_foots_height():
    walker, released = CompassWalker(), CompassWalker(backward_passing_counts=True)
    states = random_states(10, num=200)
    heights = jax.vmap(lambda x: walker.swing_foot(x, jnp.zeros(()))[1])(states)
    leads = jax.vmap(walker.can_touch_down)(states)
    np.testing.assert_array_equal(leads, states[:, 1] > states[:, 0])
    guard = jax.vmap(walker.guard)(states)
    np.testing.assert_array_equal((guard > 0)[leads], (heights > 0)[leads])
    np.testing.assert_array_equal(jax.vmap(released.guard)(states) > 0, (heights > 0) & leads)


@each_walker
def test_virtual_gravity_on_the_flat_is_passive_walking_down_a_slope(parameters):
    slope = -0.07
    walker = CompassWalker(parameters)
    controller = VirtualGravity(walker, slope)
    steeper = CompassParameters(
        parameters.hip_mass,
        parameters.leg_mass,
        parameters.a,
        parameters.b,
        parameters.gravity / float(np.cos(slope)),
    )
    passive = CompassWalker(steeper)
    tilt = jnp.array([slope, slope, 0.0, 0.0])
    states = random_states(11)
    flat = jax.vmap(lambda x: walker.flow(x, controller(x)))(states)
    downhill = jax.vmap(lambda x: passive.flow(x + tilt, jnp.zeros(2)))(states)
    np.testing.assert_allclose(flat, downhill, rtol=3e-14, atol=3e-13)


def test_released_virtual_gravity_reads_the_wrong_coordinate():
    walker = CompassWalker()
    right, released = VirtualGravity(walker), VirtualGravity(walker, released=True)
    alike = jnp.array([0.1, 0.8, 0.8, -1.0])
    np.testing.assert_allclose(right(alike), released(alike))
    assert not np.allclose(right(alike.at[2].set(0)), released(alike.at[2].set(0)))


@pytest.mark.parametrize("number", [math.nan, math.inf, 2.0])
def test_a_controller_without_a_finite_torque_is_refused(number):
    with pytest.raises(ParameterError, match="slope must be"):
        VirtualGravity(CompassWalker(), slope=number)
    if not math.isfinite(number):
        with pytest.raises(ParameterError, match="torque must be"):
            ConstantTorque((0.0, number))
