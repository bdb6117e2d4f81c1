"""Walks of plants are recorded, explained and measured as they were evaluated; laws for their numbers."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import coachable as co
from coachable import cli
from coachable.automata.trace_file import read_trace
from coachable.behaviours import load_behaviour
from coachable.experiments.plan import parse_plan
from coachable.experiments.recorded_episodes import recorded_walk
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import schemas
from coachable.experiments.run_folder.writer import RunFolder
from coachable.foundation.errors import PlanError
from coachable.foundation.tables import table_of
from coachable.gaits.measures import measures
from coachable.gaits.survey import survey
from coachable.plants import CompassWalker, ConstantTorque, VirtualGravity
from coachable.rewards.setup import TERM_NAMES
from tests.plants import rimless_wheel
from tests.plants.rimless_wheel import RimlessWheel

WHEEL = RimlessWheel()
KIND = f"{rimless_wheel.__name__}:RimlessWheel"
ROLLING = load_behaviour(Path(rimless_wheel.__file__).with_name("rolling.behaviour"))
TORQUE = 0.3


class Mute(RimlessWheel):
    """A wheel of which no more is known than has to be."""

    start_box = ()
    power = RimlessWheel.__base__.power
    weight = RimlessWheel.__base__.weight
    skeleton = RimlessWheel.__base__.skeleton


def made_up(path, trajectory, plant, behaviour):
    """The folder of a run whose only lane, all-0, goes along this trajectory."""
    plan = f'[setups.all]\nforward = 0.5\northant = 0.5\n[plant]\nkind = "{plant}"\n'
    plan = 'name = "made-up"\nbehaviour = "its own"\nseeds = { count = 1 }\n' + plan
    experiment = parse_plan(plan, "plan", described=behaviour)
    path.mkdir()
    folder, tables = RunFolder.begin(path, experiment, (1,), None), schemas(experiment)
    rows = {"lane": ["all-0"] * len(trajectory.time), "which": ["last"] * len(trajectory.time)}
    columns = {"trajectories": rows | trajectory.columns()}
    columns["evaluations"] = {"lane": ["all-0"], "step": [500]} | {
        name: [False] if name == "fell" else [1] for name in tables["evaluations"].names[2:]
    }
    for name, some in columns.items():
        folder.write_table(name, table_of(tables[name], some))
    folder.complete(columns)
    return Run.open(path)


@pytest.fixture(scope="module")
def rolling():
    """Ten seconds of the wheel, driven by a constant torque."""
    return co.rollout(ConstantTorque((TORQUE,)), plant=WHEEL, behaviour=ROLLING)


@pytest.fixture(scope="module")
def wheel(rolling, tmp_path_factory):
    return made_up(tmp_path_factory.mktemp("runs") / "wheel", rolling, KIND, ROLLING)


@pytest.fixture(scope="module")
def compass(tmp_path_factory):
    """Ten seconds of the compass walker under its baseline."""
    walk = co.rollout(VirtualGravity(CompassWalker()))
    behaviour = load_behaviour("compass-walking")
    return made_up(tmp_path_factory.mktemp("runs") / "compass", walk, "compass", behaviour)


def call(capsys, *arguments):
    try:
        cli.main([str(argument) for argument in arguments])
        status = 0
    except SystemExit as stopped:
        status = stopped.code
    return *capsys.readouterr(), status


def test_a_wheel_makes_the_steps_of_its_geometry_and_pays_for_its_torque(wheel):
    p = WHEEL.parameters
    walk = recorded_walk(wheel, "all", 0)
    found, step = measures(walk.trace), 2 * p.length * math.sin(p.half_angle)
    assert found["step_length"] == pytest.approx(step, rel=1e-5)
    assert found["speed"] == pytest.approx(step / found["step_time"], rel=0.1)
    # The torque does work τ · 2α a step, and the angle goes forward all the time.
    cost = TORQUE * 2 * p.half_angle / (p.mass * p.gravity * step)
    assert found["transport"] == pytest.approx(cost, rel=0.02)
    assert math.isnan(found["alternation"]), "it has ten legs"
    assert "10 legs" in walk.absent[0]


def test_touchdowns_are_where_the_foot_changes_and_one_leg_stands_at_a_time(compass):
    trace = recorded_walk(compass, "all", 0).trace
    changed = np.flatnonzero(np.diff(trace.values["stance_foot_x"])) + 1
    times = trace.values["touchdown_time"]
    assert len(changed) == 13
    assert (trace.time[changed - 1] < times[changed]).all()
    assert (times[changed] <= trace.time[changed]).all()
    assert np.isnan(times[: changed[0]]).all()
    assert (trace.values["leg_0_foot_contact"] + trace.values["leg_1_foot_contact"] == 1).all()
    assert trace.values["leg_0_foot_contact"][0] == 1


def test_a_walker_that_settles_alternates_with_equal_steps(compass):
    trace = recorded_walk(compass, "all", 0).trace
    found, times = measures(trace), np.unique(trace.values["touchdown_time"])[:13]
    assert np.ptp(np.diff(times)[-4:]) < 2e-3
    assert found["step_time"] == pytest.approx(np.diff(times).mean())
    assert found["step_length"] / found["step_time"] == pytest.approx(found["speed"], rel=0.05)
    assert found["alternation"] == 1
    assert found["lag"] == pytest.approx(0.5, abs=0.02)
    assert found["strides"] == 6
    assert 0 < found["asymmetry"] < 3
    assert 0.03 < found["transport"] < 0.3


def test_a_gait_is_surveyed_and_what_is_missing_has_a_sentence(compass, wheel, capsys):
    out, err, status = call(capsys, "gait", compass.path, "--episodes", "1", "--speed", "0.2")
    assert status == 0, err
    assert "1 walks" in out
    assert "step length [m]" in out
    assert "not measured" not in out
    assert (compass.path / "footfalls.png").exists()
    out, _, status = call(capsys, "gait", wheel.path, "--episodes", "1", "--trust")
    assert status == 0
    assert "1 moves" in out
    assert "not measured: the rimless wheel has 10 legs; alternation" in out
    assert math.isnan(wheel.columns("gaits")["asymmetry"][0])


def test_a_plant_that_defines_little_is_measured_by_what_it_does(rolling, tmp_path, capsys):
    kind = f"{__name__}:Mute"
    run = made_up(tmp_path / "mute", rolling, kind, ROLLING)
    surveyed = survey(run, 3)
    assert not surveyed.footfalls
    assert len(surveyed.absent) == 2
    assert any("skeleton" in sentence for sentence in surveyed.absent)
    assert any("cost of transport" in sentence for sentence in surveyed.absent)
    gaits = run.columns("gaits")
    assert len(gaits["lane"]) == 1, "all its episodes would be the same"
    assert gaits["gait"][0] == "moves"
    assert gaits["step_length"][0] == pytest.approx(2 * math.sin(WHEEL.parameters.half_angle), rel=1e-5)
    assert math.isnan(gaits["transport"][0])
    with pytest.raises(PlanError, match="gives no start_box"):
        recorded_walk(run, "all", 0, episode=1)


@pytest.mark.parametrize("which", ["last", "best"])
def test_a_record_is_the_evaluation_episode(small_run, which, tmp_path, capsys):
    path = tmp_path / "walk.csv"
    lane = ("--setup", "forward+orthant", "--seed", "4", "--which", which)
    out, _, status = call(capsys, "record", small_run.path, *lane, "-o", path)
    assert status == 0
    stored = small_run.trajectory("forward+orthant", 4, which)
    (trace,) = read_trace(path, small_run.behaviour.signals)
    np.testing.assert_array_equal(trace.time, stored["t"])
    for name, column in trace.values.items():
        np.testing.assert_array_equal(column, stored[name])
    evaluations = small_run.columns("evaluations")
    rows = np.flatnonzero(evaluations["lane"] == "forward+orthant-4")
    row = rows[-1] if which == "last" else rows[np.argmax(evaluations["return"][rows])]
    walk = recorded_walk(small_run, "forward+orthant", 4, which)
    assert walk.environment_return + walk.behaviour_return == pytest.approx(
        evaluations["return"][row], rel=1e-4
    )
    assert walk.fell == evaluations["fell"][row]
    assert ("it fell" in out) == walk.fell
    # What pays ±1 follows the behaviour where it pays +1.
    paid = np.sign(stored["orthant"][:-1])
    np.testing.assert_array_equal(walk.follows[1:], paid > 0)
    assert set(TERM_NAMES).isdisjoint(walk.trace.values)


def test_explaining_a_run_explains_what_is_recorded_of_it(small_run, tmp_path, capsys):
    lane = ("--setup", "sparse", "--seed", "4")
    call(capsys, "record", small_run.path, *lane, "-o", tmp_path / "walk.parquet")
    of_run, err, status = call(capsys, "explain", small_run.path, *lane, "--json")
    assert status == 1, err
    of_file, _, _ = call(capsys, "explain", "compass-walking", tmp_path / "walk.parquet", "--json")
    with_name, _, _ = call(capsys, "explain", "compass-walking", small_run.path, *lane, "--json")
    for one in (of_run, with_name):
        assert json.loads(one) | {"trace": ""} == json.loads(of_file) | {"trace": ""}
    evaluations = small_run.columns("evaluations")
    row = np.flatnonzero(evaluations["lane"] == "sparse-4")[-1]
    (cycle,) = json.loads(of_run)["cycles"]
    assert cycle["completed"] == evaluations["cycles"][row]
    text, _, _ = call(capsys, "explain", small_run.path, *lane)
    assert text.startswith(f"{small_run.path}, sparse-4, last policy, against 'compass-walking'")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["compass-walking"], "is no run folder, so name a TRACE"),
        (["compass-walking", "log.csv", "--seed", "3"], "are for a run"),
        (["RUN", "--dt", "0.1"], "a run has its own"),
        (["RUN", "--seed", "5"], "no seed 5"),
        (["perry-gait", "RUN"], "has no value"),
    ],
)
def test_what_cannot_be_explained_is_said(small_run, capsys, arguments, message):
    words = [str(small_run.path) if word == "RUN" else word for word in arguments]
    _, err, status = call(capsys, "explain", *words)
    assert status == 2
    assert message in err


def test_further_episodes_begin_in_the_start_box_the_same_for_every_lane(small_run, tmp_path):
    plant = small_run.experiment.problem.plant
    starts = []
    for setup, episode in (("sparse", 0), ("sparse", 1), ("forward+orthant", 1), ("sparse", 2)):
        values = recorded_walk(small_run, setup, 3, episode=episode).trace.values
        starts.append([values[name][0] for name in plant.state_names])
    np.testing.assert_allclose(starts[0], plant.start, rtol=1e-6)
    assert starts[1] == starts[2] != starts[3]
    assert (np.abs(np.subtract(starts, plant.start)) <= np.array(plant.start_box) + 1e-6).all()
    copy = Run.open(shutil.copytree(small_run.path, tmp_path / "run"))
    surveyed = survey(copy, 2)
    gaits = copy.columns("gaits")
    assert sorted(zip(gaits["lane"], gaits["episode"], strict=True)) == sorted(
        (lane.name, episode) for lane in copy.lanes for episode in (0, 1)
    )
    assert not surveyed.absent
    assert {name: len(walks) for name, walks in surveyed.footfalls.items()} == {
        "sparse": 2,
        "forward+orthant": 2,
    }
