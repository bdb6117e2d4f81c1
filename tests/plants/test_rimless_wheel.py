"""The rimless wheel, a plant that only the tests have: its laws, its gait, and that it can be trained."""

from functools import partial
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours import load_behaviour
from coachable.envs.baselines import baseline
from coachable.envs.gymnasium_env import PlantEnv
from coachable.envs.rollout import Trajectory, rollout, summary
from coachable.envs.walking_task import make_task
from coachable.foundation.errors import ParameterError
from coachable.learning import ppo
from coachable.learning.config import PPOConfig
from coachable.plants import ChatterRule, CompassParameters, NoTorque, Outcome, advance, rk4
from coachable.plants.named import make_plant, parameters_from, plant_class
from coachable.rewards.setup import RewardSetup
from tests.plants.rimless_wheel import RimlessWheel, WheelParameters

WHEEL = RimlessWheel()
NAME = "tests.plants.rimless_wheel:RimlessWheel"
SHRINK = np.cos(2 * WHEEL.parameters.half_angle) ** 2
ROLLING = load_behaviour(Path(__file__).with_name("rolling.behaviour"))
SETUP = RewardSetup("roll", forward=0.5, orthant=0.5)


def next_section_point(y):
    x = WHEEL.from_section(y)
    moved = advance(WHEEL, x, jnp.zeros(()), jnp.zeros(1), 2.0, num_substeps=400, stop_at_touchdown=True)
    return WHEEL.to_section(moved.x), moved


def test_the_flow_conserves_energy_and_torque_does_its_work(x64):
    x, torque = jnp.array([-0.2, 1.3]), jnp.array([0.7])
    for control in (jnp.zeros(1), torque):
        end, h = x, jnp.asarray(1e-3)
        for _ in range(200):
            end = rk4(WHEEL.flow, end, control, h)
        work = float(control[0] * (end[0] - x[0]))
        assert float(WHEEL.energy(end) - WHEEL.energy(x)) == pytest.approx(work, abs=1e-10)


def test_a_touchdown_keeps_the_angular_momentum_about_the_new_contact(x64):
    p = WHEEL.parameters
    before = jnp.array([p.half_angle, 1.7])
    after = WHEEL.events[0].reset(before)
    hub = np.array([-np.sin(p.half_angle), np.cos(p.half_angle)]) * p.length  # from the new contact
    velocity = 1.7 * p.length * np.array([np.cos(p.half_angle), -np.sin(p.half_angle)])
    clockwise = hub[1] * velocity[0] - hub[0] * velocity[1]
    assert float(after[1]) * p.length**2 == pytest.approx(clockwise, rel=1e-14)
    left, right = WHEEL.base(before, jnp.zeros(())), WHEEL.base(after, WHEEL.events[0].displacement(before))
    np.testing.assert_allclose(left, right, atol=1e-15)


def test_the_return_map_is_the_analytic_one(x64):
    gain = WHEEL.fixed_point**2 * (1 - SHRINK) / SHRINK
    for speed in (1.0, 1.5, WHEEL.fixed_point):
        after, moved = jax.jit(next_section_point)(jnp.array([speed]))
        assert (moved.touchdowns, moved.touchdown_time) == (1, moved.elapsed)
        np.testing.assert_allclose(moved.foot_x, 2 * np.sin(WHEEL.parameters.half_angle))
        np.testing.assert_allclose(moved.x[0], -WHEEL.parameters.half_angle, atol=1e-14)
        np.testing.assert_allclose(after**2, SHRINK * (speed**2 + gain), rtol=1e-9)


def test_the_floquet_multiplier_is_cos_squared_of_the_angle_between_spokes(x64):
    """In ω² the return map is affine with this slope; at the fixed point the slope in ω is the same."""
    multiplier = jax.jit(jax.jacfwd(lambda y: next_section_point(y)[0]))(jnp.array([WHEEL.fixed_point]))
    np.testing.assert_allclose(multiplier, [[SHRINK]], rtol=1e-7)


def test_it_rolls_on_through_many_touchdowns_in_one_step(x64):
    x = WHEEL.from_section(jnp.array([WHEEL.fixed_point]))
    _, one = jax.jit(next_section_point)(jnp.array([WHEEL.fixed_point]))
    moved = advance(
        WHEEL,
        x,
        jnp.zeros(()),
        jnp.zeros(1),
        5.5 * float(one.elapsed),
        num_substeps=600,
        chatter=ChatterRule(max_touchdowns=None),
    )
    assert moved.touchdowns == 5
    np.testing.assert_allclose(moved.touchdown_time, 5 * one.elapsed, rtol=1e-8)
    np.testing.assert_allclose(moved.foot_x, 5 * one.foot_x)


def test_one_that_is_too_slow_falls_back(x64):
    moved = advance(WHEEL, jnp.array([-0.25, 0.1]), jnp.zeros(()), jnp.zeros(1), 2.0, num_substeps=200)
    assert (moved.outcome, moved.touchdowns) == (Outcome.FELL, 0)


@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_it_rolls_in_a_task_and_settles_to_its_gait(x64, clock):
    task = make_task(SETUP, behaviour=ROLLING, clock=clock, plant=WHEEL)
    assert (task.observation_size, task.action_size) == (2, 1)

    @jax.jit
    def roll():
        episode = rollout(task, NoTorque(1))
        return episode, summary(task, episode)

    episode, numbers = roll()
    assert not numbers.fell
    assert numbers.share_in_cycle == 1
    trajectory = Trajectory.of(task, episode)
    assert set(trajectory.columns()) >= {"t", "theta", "dtheta", "torque", "foot_x", "phase"}
    np.testing.assert_array_equal(trajectory.dtheta, trajectory.states["dtheta"])
    np.testing.assert_array_equal(trajectory.phase[1:], trajectory.theta[1:] >= 0)
    with pytest.raises(AttributeError, match=r"'thta'.*'theta'"):
        _ = trajectory.thta


def test_its_baseline_has_the_period_and_the_step_of_its_gait():
    report = baseline("none", behaviour=ROLLING, plant=NAME)
    with jax.enable_x64(True):
        _, one = jax.jit(next_section_point)(jnp.array([WHEEL.fixed_point]))
    assert report.period == pytest.approx(float(one.elapsed), rel=1e-4)
    assert report.step_length == pytest.approx(2 * np.sin(0.3), rel=1e-12)
    with pytest.raises(ParameterError, match=r"'virtual-gravity'.*'none'"):
        baseline("virtual-gravity", behaviour=ROLLING, plant=WHEEL)


def test_it_learns_to_roll_on_the_flat_where_it_would_stop():
    flat = parameters_from(plant_class(NAME), {"slope": 0.0})
    task = make_task(SETUP, parameters=flat, behaviour=ROLLING, seconds=6.0, plant=NAME)
    config = PPOConfig(n_steps=512, batch_size=128, learning_rate=3e-3, hidden_sizes=(16, 16))
    update = jax.jit(partial(ppo.update, task, config))
    walk = eqx.filter_jit(lambda actor: summary(task, rollout(task, actor)))
    state = ppo.init(jax.random.key(0), task, config)
    before = walk(NoTorque(1))
    for _ in range(20):
        state, *_ = update(state)
    after = walk(state.networks.actor())
    assert before.fell
    assert not after.fell
    assert after.hip_x > before.hip_x + 1


def test_it_is_a_gymnasium_environment():
    env = PlantEnv(SETUP, behaviour=ROLLING, plant=NAME, start_noise=(0.01, 0.1))
    assert env.action_space.shape == (1,)
    first, _ = env.reset(seed=3)
    second, reward, _, _, info = env.step(np.zeros(1, np.float32))
    assert env.observation_space.contains(second)
    assert second[0] > first[0]
    assert reward == pytest.approx(1.0)
    assert info["hip_x"] > 0


def test_a_plant_is_refused_with_the_reason():
    for name, reason in (
        ("compas", "'compass'"),
        ("nowhere:Wheel", "'nowhere' cannot be imported"),
        ("tests.plants.rimless_wheel:RimlessWheal", "'RimlessWheel'"),
        ("tests.plants.rimless_wheel:WheelParameters", "'WheelParameters'"),
    ):
        with pytest.raises(ParameterError, match=reason):
            plant_class(name)
    with pytest.raises(ParameterError, match=r"'slop'.*'slope'"):
        parameters_from(RimlessWheel, {"slop": 0.1})
    with pytest.raises(ParameterError, match="half_angle must be positive"):
        parameters_from(RimlessWheel, {"half_angle": -0.1})
    with pytest.raises(ParameterError, match=r"WheelParameters, not CompassParameters"):
        make_plant(NAME, CompassParameters())
    with pytest.raises(ParameterError, match=r"rimless wheel has no 'released-code' semantics"):
        make_task(SETUP, "released-code", behaviour=ROLLING, plant=WHEEL)
    with pytest.raises(ParameterError, match="no behaviour ships for the rimless wheel"):
        make_task(SETUP, plant=WHEEL)
    with pytest.raises(ParameterError, match=r"no signal 'theta_1'.*'theta'"):
        make_task(SETUP, behaviour=load_behaviour("compass-walking"), plant=WHEEL)


def test_a_plant_with_numbers_missing_is_refused():
    class Nameless(RimlessWheel):
        start = (0.0,)

    class Boxless(RimlessWheel):
        action_box = ((-1.0, -1.0), (1.0, 1.0))

    with pytest.raises(ParameterError, match="start has 1 entries, but needs 2"):
        Nameless()
    with pytest.raises(ParameterError, match="action_box"):
        Boxless()


def test_parameters_may_be_replaced_in_a_plant():
    assert make_plant(WHEEL, WheelParameters(slope=0.1)).parameters.slope == 0.1
