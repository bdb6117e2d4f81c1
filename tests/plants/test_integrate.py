"""The integrator against theory, against SciPy, and against a hybrid system that is solved by hand."""

import importlib.util
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from coachable import plants
from coachable.plants import (
    PAPER_CHATTER,
    START,
    ChatterRule,
    CompassWalker,
    ConstantTorque,
    Dynamics,
    Event,
    Outcome,
    VirtualGravity,
    rk4,
)

compiled_advance = eqx.filter_jit(plants.advance)


def advance(plant, x, foot_x, control, duration, **options):
    """Compiled once for all durations and states."""
    x, duration = jnp.asarray(x), jnp.asarray(duration, jnp.asarray(x).dtype)
    options = {
        name: jnp.asarray(value) if name == "touchdowns_before" else value for name, value in options.items()
    }
    return compiled_advance(plant, x, foot_x, control, duration, **options)


spec = importlib.util.spec_from_file_location("oracle", Path(__file__).with_name("oracle.py"))
assert spec is not None
assert spec.loader is not None
oracle = importlib.util.module_from_spec(spec)
spec.loader.exec_module(oracle)


def walk(controller, num_steps, x=None, plant=None, **options):
    """States, hip positions and outcomes at the samples, in whatever precision is on."""
    plant = plant or CompassWalker()
    x = jnp.asarray(START) if x is None else x

    def step(carry, _):
        x, foot_x = carry
        moved = plants.advance(plant, x, foot_x, controller(x), 0.01, **options)
        return (moved.x, moved.foot_x), (moved.x, plant.base(moved.x, moved.foot_x)[0], moved.outcome)

    return jax.jit(lambda x: lax.scan(step, (x, jnp.zeros((), x.dtype)), length=num_steps)[1])(x)


@pytest.fixture(scope="module")
def exact():
    return oracle.walk(oracle.virtual_gravity, 1000)


def test_ten_seconds_of_walking_agree_with_dop853(x64, exact):
    states, hips = exact
    ours, our_hips, outcomes = walk(VirtualGravity(CompassWalker()), 1000)
    assert not outcomes.any()
    np.testing.assert_allclose(our_hips, hips[1:], rtol=0, atol=1e-7)
    np.testing.assert_allclose(ours, states[1:], rtol=0, atol=1e-7)


def test_ten_seconds_in_float32_agree_to_a_millimetre(exact):
    states, hips, outcomes = walk(VirtualGravity(CompassWalker()), 1000)
    assert states.dtype == jnp.float32
    assert not outcomes.any()
    np.testing.assert_allclose(hips, exact[1][1:], rtol=0, atol=1e-3)


@pytest.mark.parametrize(("seconds", "touchdowns"), [(0.3, 0), (1.2, 2)])
def test_order_is_four_also_through_touchdowns(x64, seconds, touchdowns):
    torque = np.array([-1.35, -0.18])
    exact = oracle.walk(lambda x: torque, 1, control_dt=seconds)[0][-1]
    num_substeps = (30, 60, 120, 240)
    errors = []
    for num in num_substeps:
        moved = advance(
            CompassWalker(), jnp.asarray(START), jnp.zeros(()), jnp.asarray(torque), seconds, num_substeps=num
        )
        assert (moved.touchdowns, moved.outcome) == (touchdowns, Outcome.WALKING)
        errors.append(np.abs(moved.x - exact).max())
    order = -np.polyfit(np.log(num_substeps), np.log(errors), 1)[0]
    assert order == pytest.approx(4, abs=0.3)


def touchdown_of(plant):
    return Event(
        name="touchdown",
        guard=plant.guard,
        admissible=plant.can_touch_down,
        reset=plant.impact,
        displacement=plant.step_length,
    )


class Ball(Dynamics):
    """Bounces on the ground and loses half its speed each time. State: height and velocity."""

    @property
    def events(self):
        return (touchdown_of(self),)

    def flow(self, x, control):
        return jnp.stack([x[1], jnp.full_like(x[0], -9.81) + control[0]])

    def guard(self, x):
        return x[0]

    def can_touch_down(self, x):
        return jnp.array(True)

    def impact(self, x):
        return jnp.stack([x[0], -x[1] / 2])

    def step_length(self, x):
        return jnp.ones_like(x[0])

    def fall_margin(self, x):
        return 5 - x[0]


def throw(duration, chatter=PAPER_CHATTER, height=0.05, **options):
    x = jnp.array([height, 0.0])
    return advance(Ball(), x, jnp.zeros(()), jnp.zeros(2), duration, chatter=chatter, **options)


class TestBouncingBall:
    """Its bounces come at t₁, 2 t₁, 2.5 t₁, 2.75 t₁, … with t₁ = √(2h/g) ≈ 0.101 s, and pile up at 3 t₁."""

    first = np.sqrt(2 * 0.05 / 9.81)

    def test_bounces_come_when_they_should(self, x64):
        moved = throw(0.22, num_substeps=3)
        assert (moved.touchdowns, moved.outcome) == (2, Outcome.WALKING)
        np.testing.assert_allclose(moved.touchdown_time, 2 * self.first, rtol=1e-12)
        since, speed = 0.22 - 2 * self.first, 9.81 * self.first / 4
        np.testing.assert_allclose(moved.x[0], speed * since - 9.81 * since**2 / 2, atol=1e-12)
        np.testing.assert_allclose(moved.segment_x, [0, speed], atol=1e-12)

    @pytest.mark.parametrize("num_substeps", [1, 7])
    def test_a_third_touchdown_in_a_step_is_chatter(self, x64, num_substeps):
        moved = throw(1.0, num_substeps=num_substeps)
        assert (moved.touchdowns, moved.outcome) == (3, Outcome.CHATTERED)
        np.testing.assert_allclose(moved.elapsed, 2.5 * self.first, rtol=1e-12)
        np.testing.assert_allclose(moved.x, [0, 9.81 * self.first / 8], atol=1e-12)

    def test_touchdowns_before_the_step_count(self, x64):
        assert throw(0.12, touchdowns_before=1).outcome == Outcome.WALKING
        moved = throw(0.12, touchdowns_before=2)
        assert (moved.touchdowns, moved.outcome) == (1, Outcome.CHATTERED)

    def test_a_touchdown_soon_after_the_first_is_chatter(self, x64):
        by_gap = {gap: throw(0.3, ChatterRule(None, gap * self.first), num_substeps=5) for gap in (0.9, 1.1)}
        assert by_gap[1.1].outcome == Outcome.CHATTERED
        assert by_gap[1.1].touchdowns == 2
        assert by_gap[0.9].outcome == Outcome.WALKING
        assert by_gap[0.9].touchdowns > 5

    def test_bounces_without_end_end_as_chatter(self):
        assert throw(1.0, ChatterRule(None)).outcome == Outcome.CHATTERED

    def test_a_step_that_stops_at_touchdown_stops_after_the_impact(self, x64):
        moved = throw(1.0, stop_at_touchdown=True)
        assert (moved.touchdowns, moved.outcome) == (1, Outcome.WALKING)
        np.testing.assert_allclose(moved.elapsed, self.first, rtol=1e-12)
        np.testing.assert_allclose(moved.x, [0, 9.81 * self.first / 2], atol=1e-12)

    def test_the_earlier_of_two_events_counts(self, x64):
        up = jnp.array([4.9, 3.0])
        moved = advance(Ball(), up, jnp.zeros(()), jnp.zeros(2), 3.0, num_substeps=50)
        assert (moved.outcome, moved.touchdowns) == (Outcome.FELL, 0)
        np.testing.assert_allclose(moved.x[0], 5, atol=1e-12)


def test_touchdown_is_symmetric_and_moves_nothing(x64):
    plant = CompassWalker()
    x = jnp.array([-0.28, 0.30, -1.46, -0.90])
    moved = advance(plant, x, jnp.array(0.4), jnp.zeros(2), 0.05, num_substeps=20, stop_at_touchdown=True)
    assert moved.touchdowns == 1
    np.testing.assert_allclose(moved.x[0], -moved.x[1], atol=1e-14)
    half_angle = moved.x[0]
    assert half_angle > 0
    np.testing.assert_allclose(moved.foot_x, 0.4 + 2 * jnp.sin(half_angle), atol=1e-14)
    np.testing.assert_allclose(plant.swing_foot(moved.x, moved.foot_x), [0.4, 0.0], atol=1e-14)


def test_a_fall_ends_with_the_hip_on_the_ground(x64):
    plant = CompassWalker()
    _, _, outcomes = walk(ConstantTorque((0.0, 0.0)), 400)
    assert outcomes.max() == Outcome.FELL
    x = jnp.array([1.55, 0.2, 3.0, 0.0])
    moved = advance(plant, x, jnp.array(0.7), jnp.zeros(2), 0.01)
    assert moved.outcome == Outcome.FELL
    assert 0 < moved.elapsed < 0.01
    np.testing.assert_allclose(plant.base(moved.x, moved.foot_x)[1], 0, atol=1e-12)
    np.testing.assert_array_equal(moved.segment_x, x)
    assert advance(plant, moved.x, moved.foot_x, jnp.zeros(2), 0.01).outcome == Outcome.FELL


def test_the_rest_of_a_step_after_touchdown_has_the_same_torque(x64):
    plant, u = CompassWalker(), jnp.array([-0.5, -0.3])
    x = jnp.array([-0.28, 0.30, -1.46, -0.90])
    whole = advance(plant, x, jnp.zeros(()), u, 0.05, num_substeps=40)
    first = advance(plant, x, jnp.zeros(()), u, 0.05, num_substeps=40, stop_at_touchdown=True)
    rest = advance(plant, first.x, first.foot_x, u, float(0.05 - first.elapsed), num_substeps=40)
    assert (whole.touchdowns, rest.touchdowns) == (1, 0)
    np.testing.assert_allclose(whole.x, rest.x, atol=1e-10)
    np.testing.assert_allclose(whole.segment_x, first.x, atol=1e-12)
    np.testing.assert_allclose(whole.elapsed, 0.05, rtol=1e-15)


BACKWARD = (0.2, 0.21, -0.1, -2.5)


def test_a_swing_foot_passing_backward_touches_down_only_in_the_released_code(x64):
    x = jnp.array(BACKWARD)
    paper = advance(CompassWalker(), x, jnp.zeros(()), jnp.zeros(2), 0.01)
    assert (paper.touchdowns, paper.outcome) == (0, Outcome.WALKING)
    assert paper.x[1] < paper.x[0]
    released = CompassWalker(backward_passing_counts=True)
    moved = advance(released, x, jnp.zeros(()), jnp.zeros(2), 0.01, stop_at_touchdown=True)
    assert moved.touchdowns == 1
    np.testing.assert_allclose(moved.x[0], moved.x[1], atol=1e-9)
    np.testing.assert_allclose(moved.foot_x, 0, atol=1e-9)


@pytest.mark.parametrize("released", [False, True])
def test_scuffing_while_the_leg_passes_forward_is_no_touchdown(x64, released):
    walker = CompassWalker(backward_passing_counts=released)
    x = jnp.array([0.1, -0.12, -1.2, 1.0])
    u = jnp.zeros(2)
    heights = []
    for _ in range(20):
        moved = advance(walker, x, jnp.zeros(()), u, 0.01)
        assert moved.touchdowns == 0
        x = moved.x
        heights.append(float(walker.swing_foot(x, moved.foot_x)[1]))
    assert min(heights) < 0
    assert x[1] > x[0]


@pytest.mark.parametrize("control", [[np.nan, 0.0], [np.inf, 0.0], [0.0, 1e300]])
def test_a_state_that_leaves_the_finite_numbers_is_flagged_and_held(x64, control):
    x, foot_x = jnp.asarray(START), jnp.array(0.3)
    moved = advance(CompassWalker(), x, foot_x, jnp.array(control), 0.01)
    assert moved.outcome == Outcome.NOT_FINITE
    assert jnp.isfinite(moved.x).all()
    np.testing.assert_array_equal(moved.foot_x, foot_x)


def test_vectorised_walkers_walk_like_single_ones(x64):
    """One walker's touchdown, fall or chatter must not touch the others of the batch."""
    plant = CompassWalker()
    states = jnp.array(
        [START, [-0.28, 0.30, -1.46, -0.90], [1.56, 0.2, 3.0, 0.0], BACKWARD, [np.nan, 0.0, 0.0, 0.0]]
    )

    def one(x):
        return plants.advance(plant, x, jnp.zeros(()), jnp.array([-0.5, -0.1]), 0.02)

    together, single = jax.jit(jax.vmap(one))(states), jax.jit(one)
    for index, x in enumerate(states):
        alone = single(x)
        jax.tree.map(
            lambda a, b, index=index: np.testing.assert_allclose(a, b[index], rtol=1e-13, atol=1e-13),
            alone,
            together,
        )
    assert together.outcome.tolist() == [0, 0, 1, 0, 3]


class ClosedLoop(Dynamics):
    """The walker with a controller that acts at every instant, not at samples."""

    plant: CompassWalker
    controller: VirtualGravity

    def flow(self, x, control):
        return self.plant.flow(x, self.controller(x))

    @property
    def events(self):
        return self.plant.events

    def fall_margin(self, x):
        return self.plant.fall_margin(x)


def test_golden_orbit_of_continuous_virtual_gravity(x64):
    """θ₁ = −θ₂ = 0.29917117, θ̇ = (−1.14151641, −0.21486579) right after impact; known to eight digits."""
    plant = ClosedLoop(CompassWalker(), VirtualGravity(CompassWalker()))
    golden = jnp.array([0.29917117, -1.14151641, -0.21486579])

    def stride(y):
        x = jnp.stack([y[0], -y[0], y[1], y[2]])
        moved = plants.advance(
            plant, x, jnp.zeros(()), jnp.zeros(2), 1.0, num_substeps=500, stop_at_touchdown=True
        )
        return moved.x[jnp.array([0, 2, 3])], moved

    after, moved = jax.jit(stride)(golden)
    np.testing.assert_allclose(after, golden, atol=2e-8)
    np.testing.assert_allclose(moved.elapsed, 0.7475839435, atol=2e-8)
    np.testing.assert_allclose(moved.foot_x, 0.5894565783, atol=2e-8)

    multipliers = np.linalg.eigvals(jax.jit(jax.jacfwd(lambda y: stride(y)[0]))(golden))
    expected = [-0.52453475 - 0.19816069j, -0.52453475 + 0.19816069j, 0.1117131]
    np.testing.assert_allclose(np.sort_complex(multipliers), np.sort_complex(expected), atol=1e-5)


def test_rk4_is_exact_for_polynomials_of_degree_four():
    exact = rk4(
        lambda x, u: jnp.stack([jnp.ones(()), u[0] * x[0] ** 3]),
        jnp.zeros(2),
        jnp.array([4.0]),
        jnp.array(0.5),
    )
    np.testing.assert_allclose(exact, [0.5, 0.5**4], rtol=1e-6)
