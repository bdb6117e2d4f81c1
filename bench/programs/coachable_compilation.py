"""The compilation of all that a study runs, from nothing or from the cache that an earlier one left."""

from __future__ import annotations

from dataclasses import replace

from coachable.behaviours.library import load_behaviour
from coachable.experiments.compiled import Tasks, compile_programs
from coachable.experiments.layout import group_widths, num_cores
from coachable.experiments.plan import Study, load_plan
from coachable.experiments.runner import set_up_jax


def prepare(num_lanes: int):
    """Everything that a study of so many lanes compiles; the unit is the study."""
    set_up_jax()
    study = study_of(num_lanes)

    def work():
        tasks = Tasks.of(study, load_behaviour(study.behaviour))
        compile_programs(study, tasks, group_widths(num_lanes, num_cores()), num_cores())

    return work, 1


def study_of(num_lanes: int) -> Study:
    """The paper's study with another number of lanes: its four setups where they go in evenly, else one."""
    study = load_plan("paper")
    setups = study.setups if num_lanes % len(study.setups) == 0 else study.setups[:1]
    return replace(study, setups=setups, num_seeds=num_lanes // len(setups))
