"""What a finished run holds, and that its parts agree with each other."""

import dataclasses
import json
import shutil

import jax
import numpy as np
import pytest

import coachable as co
from coachable.automata.cycle_progress import completed_cycles
from coachable.experiments import runner
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import DIAGNOSTICS, schemas
from coachable.foundation.errors import RunFolderError
from coachable.learning.ppo import Diagnostics
from coachable.plants.compass import STATE_NAMES
from coachable.rewards.setup import TERM_NAMES

LANES = ("sparse-3", "sparse-4", "forward+orthant-3", "forward+orthant-4")


@pytest.fixture
def copied_run(small_run, tmp_path):
    """A folder that may be damaged."""
    return shutil.copytree(small_run.path, tmp_path / "run")


def test_a_study_leaves_jax_as_it_was(small_plan, tmp_path, monkeypatch):
    """Its own cache of programs is not that of the program that calls it."""
    monkeypatch.setattr(runner, "roll_out_baseline", lambda experiment: ({}, None))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    within = []

    def stopped(*arguments):
        within.append(dict(jax.config.values))
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "_train", stopped)
    before = dict(jax.config.values)
    with pytest.raises(KeyboardInterrupt):
        co.train(small_plan, tmp_path / "run", progress=False)
    assert within[0]["jax_compilation_cache_dir"] == str(tmp_path / "cache" / "coachable" / "jax")
    assert dict(jax.config.values) == before


def test_the_folder_is_complete_and_holds_nothing_else(small_run):
    files = {
        path.relative_to(small_run.path).as_posix() for path in small_run.path.rglob("*") if path.is_file()
    }
    policies = {
        f"policies/{lane}-{w}.{e}"
        for lane in LANES
        for w in ("last", "best")
        for e in ("safetensors", "json")
    }
    tables = {f"{name}.parquet" for name in schemas(small_run.experiment)}
    assert files == {"plan.toml", "manifest.json", "behaviour.behaviour", "automaton.svg", *tables, *policies}
    assert small_run.status == "complete"
    assert small_run.manifest["format_version"] == 2
    assert set(small_run.manifest["files"]) == files - {"manifest.json"}
    assert sum(small_run.manifest["device_layout"]["batch_sizes"]) == 4
    assert [lane.name for lane in small_run.lanes] == list(LANES)


def test_tables_have_their_columns_and_every_lane(small_run):
    for name, schema in schemas(small_run.experiment).items():
        table = small_run.table(name)
        assert table.schema.equals(schema, check_metadata=True)
        lanes = list(dict.fromkeys(table["lane"].to_pylist()))
        assert lanes == [*LANES, "virtual-gravity"] if name == "trajectories" else list(LANES)


def test_evaluations_come_when_the_plan_says(small_run):
    evaluations = small_run.columns("evaluations")
    for lane in LANES:
        steps = evaluations["step"][evaluations["lane"] == lane]
        assert steps.tolist() == [250, 500, 750, 1000, 1250, 1280]


def test_training_episodes_fill_the_training_without_gaps(small_run):
    episodes = small_run.columns("episodes")
    for lane in LANES:
        mine = {name: column[episodes["lane"] == lane] for name, column in episodes.items()}
        assert len(mine["end_step"]) > 1
        assert np.array_equal(np.diff(mine["end_step"], prepend=0), mine["length"])
        assert mine["end_step"][-1] <= 1280


def test_an_episode_has_the_diagnostics_of_the_update_after_its_rollout(small_run):
    assert {field.name for field in dataclasses.fields(Diagnostics)} == set(DIAGNOSTICS)
    episodes = small_run.columns("episodes")
    update = (episodes["end_step"] - 1) // 64
    for lane in small_run.lanes:
        mine = episodes["lane"] == lane.name
        for number in np.unique(update[mine]):
            for name in DIAGNOSTICS:
                values = episodes[name][mine & (update == number)]
                assert np.isfinite(values).all()
                assert len(np.unique(values)) == 1
    assert len(np.unique(episodes["value_loss"])) > 4
    assert (episodes["approx_kl"] > -1e-6).all()
    assert (episodes["explained_variance"] <= 1).all()


@pytest.mark.parametrize("which", ["last", "best"])
def test_evaluations_trajectories_and_policies_tell_the_same_walk(small_run, which):
    evaluations = small_run.columns("evaluations")
    for lane in small_run.lanes:
        rows = np.flatnonzero(evaluations["lane"] == lane.name)
        returns = evaluations["return"][rows]
        row = rows[-1] if which == "last" else rows[np.argmax(returns)]
        walk = small_run.trajectory(lane.setup, lane.seed, which)
        setup = small_run.experiment.setup(lane.setup)
        sums = [walk[name].sum(dtype=float) for name in TERM_NAMES]
        assert len(walk["t"]) == evaluations["length"][row] + 1
        assert walk["foot_x"][-1] == evaluations["foot_x"][row]
        assert np.allclose(sums, [evaluations[name][row] for name in TERM_NAMES], rtol=1e-5)
        assert np.isclose(np.dot(setup.weights, sums), evaluations["return"][row], rtol=1e-4)
        assert evaluations["cycles"][row] == completed_cycles(small_run.behaviour, walk["phase"])
        assert np.mean(walk["phase"][1:] < 4) == pytest.approx(evaluations["share_in_cycle"][row], rel=1e-5)


@pytest.mark.parametrize("which", ["last", "best"])
def test_a_policy_does_what_its_trajectory_shows(small_run, which):
    walk = small_run.trajectory("forward+orthant", 3, which)
    policy = small_run.policy("forward+orthant", 3, which)
    states = np.stack([walk[name] for name in STATE_NAMES], axis=1)[:-1]
    applied = np.stack([walk["u1"], walk["u2"]], axis=1)[:-1]
    assert np.allclose(jax.vmap(policy)(states), applied, atol=1e-6)
    again = co.rollout(policy)
    assert again.theta_1[:30] == pytest.approx(walk["theta_1"][:30], abs=1e-4)


def test_the_baseline_in_the_folder_is_the_papers(small_run):
    walk = small_run.baseline_trajectory()
    assert small_run.baseline["hip_x"] == pytest.approx(7.8334, abs=5e-5)
    assert small_run.baseline["returns"]["sparse"] == pytest.approx(7.832, abs=5e-4)
    assert small_run.baseline["returns"]["forward+orthant"] == pytest.approx(17.582, abs=5e-4)
    assert walk["foot_x"][-1] == pytest.approx(7.6517, abs=5e-5)
    assert len(walk["t"]) == 1001


def test_survival_is_in_its_bounds_and_falls_are_falls(small_run):
    survival, evaluations = small_run.columns("survival"), small_run.columns("evaluations")
    final = evaluations["step"] == 1280
    assert survival["lane"].tolist() == evaluations["lane"][final].tolist()
    assert ((survival["perturbed_up"] >= 0) & (survival["perturbed_up"] <= 1)).all()
    assert ((survival["seconds_up"] > 0) & (survival["seconds_up"] <= 100)).all()
    assert np.array_equal(survival["seconds_up"] < 10, evaluations["fell"][final])


def test_reading_names_what_is_not_there(small_run, tmp_path):
    with pytest.raises(RunFolderError, match="is not a folder"):
        Run.open(tmp_path / "nowhere")
    with pytest.raises(RunFolderError, match=r"no manifest\.json"):
        Run.open(tmp_path)
    with pytest.raises(RunFolderError, match="no setup 'sprase'; did you mean 'sparse'"):
        small_run.policy("sprase", 3)
    with pytest.raises(RunFolderError, match="no seed 5; it has 3 to 4"):
        small_run.trajectory("sparse", 5)
    with pytest.raises(RunFolderError, match="no table 'evaluation'; did you mean 'evaluations'"):
        small_run.table("evaluation")


@pytest.mark.parametrize(
    "name", ["plan.toml", "behaviour.behaviour", "evaluations.parquet", "policies/sparse-3-last.safetensors"]
)
@pytest.mark.parametrize("damage", ["cut", "changed", "removed"])
def test_a_damaged_file_is_named(copied_run, name, damage):
    path = copied_run / name
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    if damage == "removed":
        path.unlink()
    else:
        path.write_bytes(bytes(data) if damage == "changed" else bytes(data[: len(data) // 2]))

    def read_everything():
        run = Run.open(copied_run)
        run.table("evaluations")
        run.policy("sparse", 3)

    with pytest.raises(RunFolderError, match=name):
        read_everything()


def test_a_manifest_of_another_format_or_in_pieces_is_refused(copied_run):
    manifest = copied_run / "manifest.json"
    text = manifest.read_text()
    manifest.write_text(json.dumps(json.loads(text) | {"format_version": 3}))
    with pytest.raises(RunFolderError, match="format_version 3"):
        Run.open(copied_run)
    manifest.write_text(json.dumps({"format_version": 1}))
    with pytest.raises(RunFolderError, match=r"manifest\.json is damaged: it lacks 'status'"):
        Run.open(copied_run)
    manifest.write_text(text[:100])
    with pytest.raises(RunFolderError, match=r"manifest\.json is damaged"):
        Run.open(copied_run)
