"""The lanes of a group know nothing of each other, of their thread, or of being saved and restored."""

from itertools import count

import numpy as np
import pytest

from coachable.behaviours import load_behaviour
from coachable.experiments import programs, survival
from coachable.experiments.lane_batch import Group
from coachable.experiments.plan import Lane, load_plan, with_options
from coachable.experiments.run_folder.checkpoint import arrays_of
from coachable.experiments.workers import take_turns
from coachable.rewards.setup import PAPER_SETUPS, TERM_NAMES

A, B, C = Lane("sparse", 3), Lane("forward+orthant", 3), Lane("sparse", 7)


@pytest.fixture(scope="module")
def make_group(small_plan, tmp_path_factory):
    """Groups of two lanes that train for four updates."""
    study = with_options(load_plan(small_plan), steps=4 * 64, evaluate_every=100)
    folder = tmp_path_factory.mktemp("checkpoints")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(survival, "NUM_STARTS", 20)
        tasks = programs.Tasks.of(study, load_behaviour(study.behaviour))
    number = count()
    compiled = programs.compile_programs(study, tasks, {2}, 2)

    def make_group(*lanes, name=None):
        path = folder / f"{name or f'unnamed-{next(number)}'}.safetensors"
        return Group(study, lanes, tasks, compiled[2], path)

    return make_group


def trained(group):
    while not group.done:
        group.take_turn()
    return group


def networks_of(group, lane):
    index = group.lanes.index(lane)
    return {name: array[index] for name, array in arrays_of(group.networks(), "").items()}


def logged(group, lane):
    tables = {name: group.table(name) for name in ("episodes", "evaluations", "survival")}
    return {
        f"{name}.{column}": values[table["lane"] == lane.name]
        for name, table in tables.items()
        for column, values in table.items()
    }


def assert_equal(one, other):
    assert one.keys() == other.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], err_msg=name)


def test_a_lane_is_the_same_beside_any_other(make_group):
    one, other = trained(make_group(A, B)), trained(make_group(C, A))
    assert_equal(networks_of(one, A), networks_of(other, A))
    assert_equal(logged(one, A), logged(other, A))
    assert not np.array_equal(
        networks_of(one, A)["['last'].first_weight"], networks_of(one, B)["['last'].first_weight"]
    )


def test_threads_change_nothing(make_group):
    alone = [trained(make_group(A, B, name="alone-0")), trained(make_group(C, B, name="alone-1"))]
    together = [make_group(A, B, name="together-0"), make_group(C, B, name="together-1")]
    take_turns(together, 2, lambda: None)
    for one, other in zip(alone, together, strict=True):
        for lane in one.lanes:
            assert_equal(networks_of(one, lane), networks_of(other, lane))
            assert_equal(logged(one, lane), logged(other, lane))


@pytest.mark.parametrize("turns", [0, 1, 4, 5, 6])
def test_saved_and_restored_after_any_turn_it_goes_on_the_same(make_group, turns):
    reference = trained(make_group(A, B))
    group = make_group(A, B, name=f"saved-{turns}")
    for _ in range(turns):
        group.take_turn()
    group.save()
    restored = make_group(A, B, name=f"saved-{turns}")
    assert restored.turns == turns
    trained(restored)
    for lane in (A, B):
        assert_equal(networks_of(reference, lane), networks_of(restored, lane))
        assert_equal(logged(reference, lane), logged(restored, lane))


def test_a_turn_that_breaks_off_is_not_saved(make_group, monkeypatch):
    group = make_group(A, B, name="broken")
    group.take_turn()
    group.save()
    monkeypatch.setattr(group, "_evaluate_if_due", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        group.take_turn()
    group.save()
    assert make_group(A, B, name="broken").turns == 1


def test_the_best_policy_has_the_highest_return(make_group):
    group = trained(make_group(A, B))
    evaluations = group.table("evaluations")
    assert evaluations["step"][evaluations["lane"] == A.name].tolist() == [100, 200, 256]
    for lane in group.lanes:
        highest = evaluations["return"][evaluations["lane"] == lane.name].max()
        walk = group.trajectories()[lane, "best"]
        weights = PAPER_SETUPS[lane.setup].weights
        terms = [walk.terms[name].sum(dtype=float) for name in TERM_NAMES]
        assert np.dot(weights, terms) == pytest.approx(highest, rel=1e-5)
