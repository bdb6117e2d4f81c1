"""The lanes of a batch know nothing of each other, of their thread, or of being saved and restored."""

from itertools import count

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.experiments import survival
from coachable.experiments.experiment import Lane
from coachable.experiments.plan import load_plan, with_options
from coachable.experiments.trainers import compiled
from coachable.experiments.trainers.lane_batch import LaneBatch
from coachable.experiments.trainers.workers import take_turns
from coachable.foundation.trees import arrays_of
from coachable.rewards.setup import PAPER_SETUPS, TERM_NAMES

A, B, C = Lane("sparse", 3), Lane("forward+orthant", 3), Lane("sparse", 7)


@pytest.fixture(scope="module")
def make_batch(small_plan, tmp_path_factory):
    """Batches of two lanes that train for four updates."""
    experiment = with_options(load_plan(small_plan), steps=4 * 64, evaluate_every=100)
    folder = tmp_path_factory.mktemp("checkpoints")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(survival, "NUM_STARTS", 20)
        tasks = compiled.Tasks.of(experiment)
    number = count()
    programs = compiled.compile_programs(experiment, experiment.trainer.config, tasks, {2}, 2)

    def make_batch(*lanes, name=None):
        path = folder / f"{name or f'unnamed-{next(number)}'}.safetensors"
        return LaneBatch(experiment, lanes, tasks, programs[2], path)

    return make_batch


def trained(batch):
    while not batch.done:
        batch.take_turn()
    return batch


def networks_of(batch, lane):
    index = batch.lanes.index(lane)
    return {name: array[index] for name, array in arrays_of(batch.networks(), "").items()}


def logged(batch, lane):
    tables = {name: batch.table(name) for name in ("episodes", "evaluations", "survival")}
    return {
        f"{name}.{column}": values[table["lane"] == lane.name]
        for name, table in tables.items()
        for column, values in table.items()
    }


def assert_equal(one, other):
    assert one.keys() == other.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], err_msg=name)


def test_a_lane_is_the_same_beside_any_other(make_batch):
    one, other = trained(make_batch(A, B)), trained(make_batch(C, A))
    assert_equal(networks_of(one, A), networks_of(other, A))
    assert_equal(logged(one, A), logged(other, A))
    assert not np.array_equal(
        networks_of(one, A)["['last'].first_weight"], networks_of(one, B)["['last'].first_weight"]
    )


def test_threads_change_nothing(make_batch):
    alone = [trained(make_batch(A, B, name="alone-0")), trained(make_batch(C, B, name="alone-1"))]
    together = [make_batch(A, B, name="together-0"), make_batch(C, B, name="together-1")]
    take_turns(together, 2, lambda: None)
    for one, other in zip(alone, together, strict=True):
        for lane in one.lanes:
            assert_equal(networks_of(one, lane), networks_of(other, lane))
            assert_equal(logged(one, lane), logged(other, lane))


@pytest.mark.parametrize("turns", [0, 1, 4, 5, 6])
def test_saved_and_restored_after_any_turn_it_goes_on_the_same(make_batch, turns):
    reference = trained(make_batch(A, B))
    batch = make_batch(A, B, name=f"saved-{turns}")
    for _ in range(turns):
        batch.take_turn()
    batch.save()
    restored = make_batch(A, B, name=f"saved-{turns}")
    assert restored.turns == turns
    trained(restored)
    for lane in (A, B):
        assert_equal(networks_of(reference, lane), networks_of(restored, lane))
        assert_equal(logged(reference, lane), logged(restored, lane))


def test_a_turn_that_breaks_off_is_not_saved(make_batch, monkeypatch):
    batch = make_batch(A, B, name="broken")
    batch.take_turn()
    batch.save()
    monkeypatch.setattr(batch, "_evaluate_if_due", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        batch.take_turn()
    batch.save()
    assert make_batch(A, B, name="broken").turns == 1


def test_the_best_policy_has_the_highest_return(make_batch):
    batch = trained(make_batch(A, B))
    evaluations = batch.table("evaluations")
    assert evaluations["step"][evaluations["lane"] == A.name].tolist() == [100, 200, 256]
    for lane in batch.lanes:
        highest = evaluations["return"][evaluations["lane"] == lane.name].max()
        walk = batch.trajectories()[lane, "best"]
        weights = PAPER_SETUPS[lane.setup].weights
        terms = [walk.terms[name].sum(dtype=float) for name in TERM_NAMES]
        assert np.dot(weights, terms) == pytest.approx(highest, rel=1e-5)


def test_a_lane_that_diverged_is_kept_as_it_is(make_batch):
    batch = make_batch(A, B)
    nowhere = jax.tree.map(lambda leaf: leaf * jnp.nan, batch._states.networks)
    batch._states = eqx.tree_at(lambda state: state.networks, batch._states, nowhere)
    policy = batch.policies()[A, "last"]
    assert np.isnan(policy.weights[0]).all()
    assert policy.observation_names == ("theta_1", "theta_2", "dtheta_1", "dtheta_2")
