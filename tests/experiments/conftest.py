"""A small experiment, run once: two setups with two seeds, trained for twenty short updates."""

import pytest

from coachable.experiments import survival
from coachable.experiments.plan import load_plan
from coachable.experiments.runner import run_experiment

SMALL = """
name = "small"
steps = 1250
evaluate_every = 250
setups = ["sparse", "forward+orthant"]
[seeds]
first = 3
count = 2
[ppo]
n_steps = 64
batch_size = 32
n_epochs = 2
hidden_sizes = [8, 8]
"""


@pytest.fixture(scope="session")
def small_plan(tmp_path_factory):
    """The small experiment's plan file."""
    path = tmp_path_factory.mktemp("plans") / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture(scope="session")
def small_run(tmp_path_factory, small_plan):
    """The finished run of the small experiment; not to be written to."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(survival, "NUM_STARTS", 20)
        return run_experiment(
            load_plan(small_plan), tmp_path_factory.mktemp("runs") / "small", progress=False
        )
