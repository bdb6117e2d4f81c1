"""A controller with a memory: its loop is the task's, and if it ignores the memory, a state feedback's."""

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coachable as co
from coachable.behaviours.library import load_behaviour
from coachable.behaviours.text.printer import to_text
from coachable.plants.compass import START, CompassWalker
from coachable.rewards.forms import Schedule
from coachable.verification.falsification.resimulation import resimulate
from coachable.verification.gait.closed_loop import ClosedLoop, stacked
from coachable.verification.gait.orbit import find_orbits, follow
from coachable.verification.gait.stability import stabilities
from coachable.verification.gait.walk import settle
from tests.verification.conftest import WALKS, loop_of

BEHAVIOUR = load_behaviour("compass-walking-timed")
FORM = Schedule(skip_fine=1.0)
NAMES = FORM.bind(BEHAVIOUR, 0.01).observation_names
TIME = NAMES.index("time over")
MEMORY = json.dumps({"behaviour": to_text(BEHAVIOUR), "reward_variant": FORM.to_data()}, sort_keys=True)


def seeing(weights):
    """The policy that walks, whose first layer sees the memory through these weights."""
    first, *others = WALKS.weights
    first = jnp.concatenate([first, jnp.asarray(weights, jnp.float32)], axis=1)
    return replace(
        WALKS,
        weights=(first, *others),
        observation_names=(*WALKS.observation_names, *NAMES),
        memory=MEMORY,
    )


IGNORES = seeing(np.zeros((4, len(NAMES))))
LISTENS = seeing(0.2 * np.random.default_rng(3).normal(size=(4, len(NAMES))))


@pytest.fixture(scope="module")
def walked():
    """Walks with the touchdown clock of both, their orbits, and how stable these are."""
    with jax.enable_x64(True):
        loops = stacked([loop_of(IGNORES), loop_of(LISTENS)])
        walks = settle(loops, np.array([START, START]), "touchdown")
        orbits = find_orbits(loops, walks, "touchdown")
        return walks, orbits, stabilities(loops, orbits)


def test_ignoring_the_memory_is_state_feedback(x64, settled, walked):
    walks, orbits, stable = walked
    alone, orbit = settled["touchdown"]
    np.testing.assert_allclose(walks[0].x[:200], alone.x[:200], atol=1e-9)
    np.testing.assert_allclose(orbits[0].points, orbit.points, atol=1e-9)
    assert orbits[0].num_steps == orbit.num_steps
    expected = stabilities(stacked([loop_of(WALKS)]), [orbit])[0]
    size = len(expected.multipliers)
    np.testing.assert_allclose(stable[0].multipliers[:size], expected.multipliers, atol=1e-7)
    # What is remembered of the time is forgotten within a step.
    np.testing.assert_allclose(stable[0].multipliers[size:], 0, atol=1e-7)
    assert stable[0].num_clipped == expected.num_clipped


def test_what_is_remembered_feeds_back(x64, walked):
    _, orbits, stable = walked
    orbit = orbits[1]
    assert orbit.kind == "periodic"
    assert np.abs(np.subtract(orbit.points[0], orbits[0].points[0])).max() > 1e-3
    assert orbit.residual < 1e-11
    assert len(orbit.memories) == orbit.num_steps
    assert stable[1].disagreement < 1e-5
    point = np.array([*orbit.points[0], *orbit.memories[0]])
    after, _, _ = follow(stacked([loop_of(LISTENS)]), point[None], np.array([orbit.num_steps]))
    np.testing.assert_allclose(after[0], point, atol=1e-11)


def test_the_derivative_holds_the_time_that_is_remembered(x64):
    loop = loop_of(seeing(np.where(np.arange(len(NAMES)) == TIME, 1.0, 0.0) * np.ones((4, 1))))
    x = loop.plant.from_section(jnp.array([0.31, -1.17, -0.17]))
    begun = loop.begun(x)
    late = begun._replace(form=begun.form._replace(phase=0 * begun.form.phase, time=jnp.asarray(0.043)))
    start = np.asarray(loop.point(x, late))
    one = np.array([1])
    _, jacobian, _ = follow(stacked([loop]), start[None], one)
    column = int(np.flatnonzero(loop.continuous)[3])
    step = 1e-6 * np.eye(len(start))[column]
    ahead, back = (follow(stacked([loop]), (start + way * step)[None], one)[0][0] for way in (1, -1))
    np.testing.assert_allclose(jacobian[0][:, column], (ahead - back) / 2e-6, atol=1e-5)
    assert np.abs(jacobian[0][:3, column]).max() > 1e-3


@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_the_loop_is_what_the_task_rolls_out_and_what_scipy_walks(x64, clock):
    seconds = 2.0
    loop = loop_of(LISTENS)
    walk = settle(stacked([loop]), np.array([START]), clock, seconds)[0]
    trajectory = co.rollout(loop.controller, seconds, clock=clock)
    control = np.stack([trajectory.controls[name] for name in CompassWalker.control_names], axis=-1)
    np.testing.assert_allclose(walk.control, control[:-1], atol=1e-6)
    again = resimulate(CompassWalker().restated(), LISTENS, np.array(START), np.zeros((1, 2)), clock, seconds)
    np.testing.assert_allclose(again.states, walk.x, atol=1e-6)
    np.testing.assert_allclose(again.controls[:-1], walk.control, atol=1e-6)


def test_numbers_are_all_that_is_remembered(x64):
    loop = ClosedLoop(CompassWalker(), LISTENS)
    x = jnp.asarray(START)
    recall = loop.after(loop.begun(x), x, jnp.asarray(0.01))
    again = loop.recalled(loop.numbers(recall, x) + 1e-6)
    for one, two in zip(jax.tree.leaves(recall), jax.tree.leaves(again), strict=True):
        assert one.dtype == two.dtype
        np.testing.assert_allclose(one, two, atol=2e-6)
