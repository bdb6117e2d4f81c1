import csv
import subprocess
import sys
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from coachable.envs.baselines import baseline
from coachable.experiments.api import rollout
from coachable.plants.compass import CompassWalker
from coachable.plants.controllers import NoTorque
from coachable.verification.export.model import Model
from coachable.verification.export.python_script import python_script

NUMBERS = ("t", "theta_1", "theta_2", "dtheta_1", "dtheta_2", "u_1", "u_2", "foot_x", "hip_x")


def walked(model, tmp_path, *arguments):
    """The walk that the exported program prints, run without this package or any other."""
    path = tmp_path / "walker.py"
    path.write_text(python_script(model), encoding="utf-8")
    command = [sys.executable, "-I", "-S", "-W", "error", str(path), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(done.stdout.splitlines()))
    return {name: np.array([float(row[name]) for row in rows]) for name in NUMBERS} | {
        "location": [row["location"] for row in rows]
    }


def assert_same_walk(walk, trajectory, names, atol):
    for column, theirs in (
        ("t", trajectory.time),
        ("hip_x", trajectory.hip_x),
        ("foot_x", trajectory.foot_x),
    ):
        np.testing.assert_allclose(walk[column], theirs, rtol=0, atol=atol)
    for column in ("theta_1", "theta_2", "dtheta_1", "dtheta_2"):
        np.testing.assert_allclose(walk[column], getattr(trajectory, column), rtol=0, atol=100 * atol)
    np.testing.assert_allclose(walk["u_1"], trajectory.u1, rtol=0, atol=100 * atol)
    assert walk["location"] == [names[phase] for phase in trajectory.phase]


def test_virtual_gravity_walks_the_same_ten_seconds(models, tmp_path):
    walk = walked(models["gravity"], tmp_path)
    names = (*models["gravity"].behaviour.phase_names, "outside")
    assert_same_walk(walk, baseline("virtual-gravity").trajectory, names, atol=1e-6)
    assert walk["hip_x"][-1] == pytest.approx(7.8334, abs=1e-4)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_a_learned_policy_walks_the_same_with_its_weights_inside(models, policy, tmp_path, clock):
    model = Model("policy", models["policy"].behaviour, policy, CompassWalker(), clock)
    theirs = rollout(policy, 3.0, clock=clock)
    walk = walked(model, tmp_path, "3")
    assert len(set(walk["foot_x"])) > 1  # it takes a step at least
    assert_same_walk(walk, theirs, (*model.behaviour.phase_names, "outside"), atol=1e-6)


@pytest.mark.usefixtures("x64")
def test_a_policy_that_gives_its_expected_action_walks_the_same(models, policy, tmp_path):
    acting = replace(policy, std=jnp.array([0.5, 0.2])).acting("expected-action")
    model = Model("policy", models["policy"].behaviour, acting, CompassWalker())
    walk = walked(model, tmp_path, "1")
    assert_same_walk(walk, rollout(acting, 1.0), (*model.behaviour.phase_names, "outside"), atol=1e-6)
    assert np.abs(walk["u_1"][:20] - walked(models["policy"], tmp_path, "1")["u_1"][:20]).max() > 0.01


@pytest.mark.usefixtures("x64")
def test_a_fall_ends_the_walk_at_the_same_moment(models, tmp_path):
    model = Model("falls", models["bare"].behaviour, NoTorque(2), CompassWalker())
    theirs = rollout(NoTorque(2), 10.0)
    walk = walked(model, tmp_path)
    assert walk["t"][-1] < 10
    assert_same_walk(walk, theirs, (*model.behaviour.phase_names, "outside"), atol=1e-6)


def test_bare_it_is_a_frame_for_a_controller(models, tmp_path):
    walk = walked(models["bare"], tmp_path, "0.2")
    assert not walk["u_1"].any()
    assert len(walk["t"]) == 21
