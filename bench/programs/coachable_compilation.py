"""The compilation of all that a study runs, from nothing or from the cache that an earlier one left."""

from __future__ import annotations

from dataclasses import replace

from coachable.experiments.experiment import Experiment
from coachable.experiments.layout import batch_sizes, num_cores
from coachable.experiments.plan import load_plan
from coachable.experiments.runner import set_up_jax
from coachable.experiments.trainers.compiled import Tasks, compile_programs
from coachable.learning.config import PPOConfig


def prepare(num_lanes: int):
    """Everything that a study of so many lanes compiles; the unit is the study."""
    set_up_jax()
    experiment = experiment_of(num_lanes)

    def work():
        tasks = Tasks.of(experiment)
        sizes = batch_sizes(num_lanes, num_cores())
        compile_programs(experiment, PPOConfig(), tasks, sizes, num_cores())

    return work, 1


def experiment_of(num_lanes: int) -> Experiment:
    """The paper's study with another number of lanes: its four setups where they go in evenly, else one."""
    experiment = load_plan("paper")
    setups = experiment.setups if num_lanes % len(experiment.setups) == 0 else experiment.setups[:1]
    return replace(experiment, setups=setups, num_seeds=num_lanes // len(setups))
