"""Loops whose gait is known, a small policy that walks and one that falls, and a run folder of them."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save

from coachable.behaviours.library import load_behaviour
from coachable.experiments.plan import Study
from coachable.experiments.run_folder.writer import RunFolder
from coachable.learning.policy import Policy
from coachable.plants.compass import START, STATE_NAMES, CompassWalker, VirtualGravity
from coachable.rewards.setup import RewardSetup
from coachable.verification.gait.closed_loop import ClosedLoop, in_double, stacked
from coachable.verification.gait.orbit import find_orbits
from coachable.verification.gait.walk import settle


def small_policy(seed, feedback, ankle=-1.35, hip=-0.18, hip_limit=0.0):
    """A network of four hidden units that asks for about these torques."""
    rng = np.random.default_rng(seed)
    return Policy(
        weights=(
            jnp.asarray(rng.normal(0, 0.5, (4, 4)), jnp.float32),
            jnp.asarray(feedback * rng.normal(0, 1, (2, 4)), jnp.float32),
        ),
        biases=(jnp.zeros(4, jnp.float32), jnp.array([ankle, hip], jnp.float32)),
        low=jnp.array([-2, -2], jnp.float32),
        high=jnp.array([0, hip_limit], jnp.float32),
        observation_names=STATE_NAMES,
    )


def loop_of(policy):
    """A policy in float64, sampled and held."""
    return in_double(ClosedLoop(CompassWalker(), policy))


WALKS = small_policy(12, 0.2, hip_limit=-0.14)
TWO_STEPS = small_policy(15, 0.1)
FALLS = small_policy(12, 0.2, -0.1, -0.1)


@pytest.fixture(scope="session")
def walker():
    """A policy that walks, its hip torque clipped in part of each stride."""
    with jax.enable_x64(True):
        return loop_of(WALKS)


@pytest.fixture(scope="session")
def slope_walker():
    """Continuous virtual gravity."""
    plant = CompassWalker()
    return ClosedLoop(plant, VirtualGravity(plant), hold="continuous")


@pytest.fixture(scope="session")
def settled(walker):
    """The policy's walks and orbits under both clocks."""
    with jax.enable_x64(True):
        loops = stacked([walker])
        walks = {clock: settle(loops, np.array([START]), clock)[0] for clock in ("free", "touchdown")}
        return {clock: (walk, find_orbits(loops, [walk], clock)[0]) for clock, walk in walks.items()}


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory):
    """A run under way: seed 0 walks, seed 1 falls, seed 2 has no policy yet, seed 3's is damaged."""
    folder = begun_run(tmp_path_factory.mktemp("runs") / "small", num_seeds=4)
    folder.write("policies/orthant-3-last.safetensors", b"not a policy")
    folder.write("policies/orthant-3-last.json", "{}")
    return folder.path


@pytest.fixture(scope="session")
def two_walkers(tmp_path_factory):
    """A run of two seeds, of which one walks and one falls."""
    return begun_run(tmp_path_factory.mktemp("runs") / "two", num_seeds=2).path


def begun_run(path, num_seeds):
    """A run folder in which the first two seeds have policies."""
    path.mkdir()
    study = Study(name="small", num_seeds=num_seeds, setups=(RewardSetup(name="orthant", orthant=0.01),))
    folder = RunFolder.begin(path, study, load_behaviour("compass-walking"), (num_seeds,), baseline={})
    for seed, policy in enumerate((WALKS, FALLS)):
        folder.write(f"policies/orthant-{seed}-last.safetensors", save(policy.tensors()))
        folder.write(f"policies/orthant-{seed}-last.json", json.dumps(policy.description()))
    return folder
