import ast
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.envs.rollout import rollout
from coachable.envs.walking_task import NO_BOX, make_task
from coachable.foundation.errors import MissingExtraError, ParameterError
from coachable.learning.policy import Policy
from coachable.plants import restated
from coachable.plants.compass import START, CompassParameters, CompassWalker, VirtualGravity
from coachable.plants.compass import restated as restated_compass
from coachable.plants.controllers import ConstantTorque, NoTorque
from coachable.rewards.setup import PAPER_SETUPS
from coachable.verification.falsification import falsify as falsification
from coachable.verification.falsification import resimulation
from coachable.verification.falsification.fall_margin import endurance
from coachable.verification.falsification.falsify import falsify, search_for_falls
from coachable.verification.falsification.perturbation import HeldTorques, SectionBox, StartBox
from coachable.verification.falsification.resimulation import Resimulation, numpy_controller, resimulate
from tests.verification import planted as planted_walkers

WALKER = CompassWalker()
STRIDE = 0.7
"""Less than a stride of the walker with the constant torque [s]: nobody comes by the corner a second time."""


box = pytest.fixture(scope="module")(planted_walkers.box)
steady = pytest.fixture(scope="module")(planted_walkers.steady)
trapped = pytest.fixture(scope="module")(planted_walkers.trapped)


@pytest.fixture(scope="module")
def planted(trapped, box):
    told = []
    result = falsify(
        WALKER,
        trapped,
        box,
        clock="touchdown",
        seconds=STRIDE,
        budget=200,
        progress=lambda *done: told.append(done),
    )
    return result, told


def test_a_planted_fault_is_found_and_confirmed(planted):
    result, _ = planted
    cma_es, _ = result.searches
    assert result.falsified
    assert cma_es.falls
    assert cma_es.least_margin <= 0
    assert not result.unconfirmed
    for one in result.counterexamples:
        assert one.fall.point @ [3, -1, -1] > 4
        assert one.walk.fell
        assert one.walk.seconds == pytest.approx(one.fall.time, abs=1e-9)
    sizes = [one.size for one in result.counterexamples]
    assert sizes == sorted(sizes)


def test_a_robust_walker_is_not_falsified_and_nothing_is_proven(steady, box):
    result = falsify(WALKER, steady, box, clock="touchdown", seconds=STRIDE, budget=64)
    assert not result.falsified
    assert all(search.least_margin > 0 and search.first_fall is None for search in result.searches)


def test_the_same_seed_finds_the_same(planted, trapped, box):
    result, _ = planted
    again, other = (
        falsify(WALKER, trapped, box, clock="touchdown", seconds=STRIDE, budget=40, seed=seed)
        for seed in (0, 1)
    )
    for search, longer in zip(again.searches, result.searches, strict=True):
        assert [fall.time for fall in search.falls] == [fall.time for fall in longer.falls][
            : len(search.falls)
        ]
    assert again.searches[1].least_margin != other.searches[1].least_margin
    assert again.searches[0].least_margin != other.searches[0].least_margin


@pytest.mark.parametrize("budget", [1, 16, 37])
def test_both_searches_spend_their_budget_exactly(steady, box, monkeypatch, budget):
    walked, told = [], []

    def counted(*_):
        def walks(points):
            walked.append(len(points))
            return np.ones(len(points)), np.ones(len(points)), np.zeros(len(points), bool)

        return walks

    monkeypatch.setattr(falsification, "walks_of", counted)
    result = falsify(WALKER, steady, box, budget=budget, progress=lambda *done: told.append(done))
    assert [search.walks for search in result.searches] == [budget, budget]
    assert sum(walked) == 2 * budget
    assert told[-1] == (2 * budget, 2 * budget)
    assert [done for done, _ in told] == np.cumsum(walked).tolist()


def test_a_passport_tries_starts_the_section_and_torques(steady, monkeypatch):
    up = np.ones(16), np.ones(16), np.zeros(16, bool)
    monkeypatch.setattr(falsification, "walks_of", lambda *_: lambda points: up)
    for point, kinds in (
        ((0.3, -1.1, -0.2), [StartBox, SectionBox, HeldTorques]),
        (None, [StartBox, HeldTorques]),
    ):
        told = []
        results = search_for_falls(
            WALKER, steady, point, budget=16, progress=lambda *done, told=told: told.append(done)
        )
        assert [type(result.perturbation) for result in results] == kinds
        in_all = 32 * len(kinds)
        assert told == [(done, in_all) for done in range(16, in_all + 1, 16)]
    assert all(result.seconds == 10 for result in results)


def test_progress_is_told_to_the_end(planted):
    _, told = planted
    assert told[-1] == (400, 400)


def test_what_scipy_does_not_see_does_not_count(trapped, box, monkeypatch):
    up = Resimulation(np.zeros(1), np.zeros((1, 4)), np.zeros((1, 2)), np.zeros(1), fell=False)
    monkeypatch.setattr(falsification, "resimulate", lambda *_: up)
    result = falsify(WALKER, trapped, box, clock="touchdown", seconds=STRIDE, budget=200, keep=1)
    assert result.searches[0].falls
    assert not result.falsified
    assert result.unconfirmed


def test_nobody_starts_with_the_foot_in_the_ground_ahead(steady):
    buried = StartBox((0.01, 0.01, 0.1, 0.1), (-0.3, 0.2, -1.0, -1.0))
    result = falsify(WALKER, steady, buried, seconds=STRIDE, budget=16)
    assert [search.least_margin for search in result.searches] == [1, 1]
    assert not result.falsified


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_the_margin_is_at_most_zero_exactly_where_the_walker_falls(clock):
    controller = VirtualGravity(CompassWalker())
    generator = np.random.default_rng(1)
    starts = np.array(START) + generator.uniform(-1, 1, (40, 4)) * [0.1, 0.1, 0.2, 0.5]
    pushes = generator.uniform(-1, 1, (40, 50, 2))
    walk = jax.jit(jax.vmap(lambda x0, push: endurance(WALKER, controller, x0, push, clock, 3.0)))
    walked = walk(jnp.asarray(starts), jnp.asarray(pushes))
    margin, time, fell = (np.asarray(part) for part in (walked.margin, walked.time, walked.fell))
    assert 0 < fell.mean() < 1
    assert ((margin <= 0) == fell).all()
    np.testing.assert_allclose(margin[fell], time[fell] / 3.0 - 1)
    assert ((margin[~fell] > 0) & (margin[~fell] < 1)).all()
    np.testing.assert_allclose(time[~fell], 3.0, atol=0.01)

    for x0, push, its_time, it_fell in zip(starts[:6], pushes, time, fell, strict=False):
        again = resimulate(WALKER.restated(), controller, x0, push, clock, 3.0)
        assert again.fell == it_fell
        assert again.seconds == pytest.approx(its_time, abs=1e-7)


@pytest.mark.usefixtures("x64")
def test_scipy_walks_the_tasks_steps():
    controller = ConstantTorque((-1.35, -0.18))
    for clock in ("free", "touchdown"):
        task = make_task(PAPER_SETUPS["sparse"], clock=clock, seconds=2.0, box=NO_BOX)
        steps = jax.jit(lambda task=task: rollout(task, controller))()
        alive = np.asarray(steps.alive)
        walk = resimulate(WALKER.restated(), controller, np.array(START), np.zeros((1, 2)), clock, 2.0)
        np.testing.assert_allclose(walk.time[1:], np.asarray(steps.timesteps.time)[alive], atol=1e-9)
        np.testing.assert_allclose(walk.states[1:], np.asarray(steps.timesteps.observation)[alive], atol=1e-6)
        np.testing.assert_allclose(walk.foot_x[1:], np.asarray(steps.timesteps.foot_x)[alive], atol=1e-7)
        assert len(np.unique(walk.foot_x)) > 2


@pytest.mark.usefixtures("x64")
def test_controllers_are_the_same_in_numpy():
    plant = CompassWalker(CompassParameters(hip_mass=2.0, a=0.4, b=0.7))
    draw = np.random.default_rng(5).standard_normal
    network = {
        "weights": (jnp.asarray(draw((5, 4)), jnp.float32), jnp.asarray(draw((2, 5)), jnp.float32)),
        "biases": (jnp.asarray(draw(5), jnp.float32), jnp.asarray(draw(2), jnp.float32)),
        "low": jnp.array([-2.0, -1.0]),
        "high": jnp.array([0.0, 0.5]),
    }
    for controller in (
        Policy(**network),
        Policy(**network, squashing="tanh"),
        Policy(**network, std=jnp.array([0.6, 1.1]), deterministic="expected-action"),
        VirtualGravity(plant, slope=-0.1),
        VirtualGravity(plant, released=True),
        ConstantTorque((0.5, -0.25)),
        NoTorque(2),
    ):
        again = numpy_controller(controller)
        for x in draw((10, 4)):
            np.testing.assert_allclose(again(x), controller(jnp.asarray(x)), rtol=1e-12)


@pytest.mark.parametrize("module", [resimulation, restated, restated_compass])
def test_the_second_simulation_shares_no_equation_with_the_first(module):
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    used = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {alias.name for node in used for alias in node.names} | {
        getattr(node, "module", "") for node in used
    }
    assert not [name for name in names if name and name.split(".")[0] in ("jax", "equinox")]
    assert not names & {"advance", "CompassWalker", "rk4", "endurance", "coachable.plants.integrate"}
    ours = {name for name in names if name and name.startswith("coachable.plants.compass")}
    assert ours <= {"coachable.plants.compass.parameters"}  # the numbers alone


def test_points_of_the_cube_are_points_of_the_box():
    cube = np.array([[-1.0] * 4, [0.0] * 4, [1.0] * 4])
    starts, torques = StartBox((0.1, 0.2, 0.3, 0.4), START).at(WALKER, cube)
    np.testing.assert_allclose(starts[1], START)
    np.testing.assert_allclose(starts[2] - starts[0], [0.2, 0.4, 0.6, 0.8])
    assert not torques.any()
    (start,), _ = SectionBox((0.01, 0.1, 0.1), (0.3, -1.0, -0.2)).at(WALKER, np.array([[1.0, 0.0, -1.0]]))
    np.testing.assert_allclose(start, [0.31, -0.31, -1.0, -0.3])


def test_pushes_are_bounded_held_and_over_in_time():
    pushes = HeldTorques(0.5, seconds=0.3, hold=10)
    points = np.random.default_rng(0).uniform(-1, 1, (2, pushes.size(WALKER)))
    starts, torques = pushes.at(WALKER, points)
    assert torques.shape == (2, 30, 2)
    assert (starts == np.array(START)).all()
    assert np.abs(torques).max() <= 0.5
    for first in (0, 10, 20):
        assert (torques[:, first : first + 10] == torques[:, first : first + 1]).all()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: StartBox((0.0, 0.0, 0.0, 0.0), START), "not all zero"),
        (lambda: StartBox((-0.1, 0.0, 0.0, 0.0), START), "negative"),
        (lambda: StartBox((float("nan"), 0.0, 0.0, 0.0), START), "finite"),
        (lambda: SectionBox((0.4, 0.1, 0.1), (0.3, -1.0, -0.2)).size(WALKER), "on it everywhere"),
        (lambda: SectionBox((0.4, 0.1), (0.3, -1.0)).size(WALKER), "has 3 coordinates"),
        (lambda: HeldTorques(0.0), "positive"),
        (lambda: HeldTorques(1.0, seconds=0.01), "do not fit"),
        (lambda: HeldTorques(1.0, hold=0), "at least one"),
        (lambda: falsify(WALKER, NoTorque(2), HeldTorques(1.0), budget=0), "at least 1"),
        (lambda: falsify(WALKER, lambda x: x[:2], HeldTorques(1.0)), "without JAX"),
    ],
)
def test_what_makes_no_sense_is_refused(make, said):
    with pytest.raises(ParameterError, match=said):
        make()


def test_without_the_extra_the_pip_command_is_told(box, steady, monkeypatch):
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'coachable\[verify\]'"):
        falsify(WALKER, steady, box)
