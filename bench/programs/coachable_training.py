"""Our training as a study runs it: groups of lanes, worker threads, evaluations, logs and checkpoints."""

from __future__ import annotations

import tempfile
from itertools import accumulate, pairwise
from pathlib import Path

from bench.programs.coachable_compilation import study_of
from coachable.behaviours.library import load_behaviour
from coachable.experiments.compiled import Tasks, compile_programs
from coachable.experiments.lane_batch import Group
from coachable.experiments.layout import group_widths, num_cores
from coachable.experiments.runner import set_up_jax
from coachable.experiments.workers import take_turns


class Stint:
    """A group that is done after some more updates: a `Job` for `take_turns`."""

    def __init__(self, group: Group, num_updates: int):
        self._group = group
        self._end = group.num_updates + num_updates

    @property
    def turns(self) -> int:
        """Updates so far."""
        return self._group.num_updates

    @property
    def done(self) -> bool:
        """Whether the stint is over."""
        return self.turns >= self._end

    def take_turn(self) -> None:
        """One update, with the evaluations due."""
        self._group.take_turn()


def prepare(num_lanes: int, num_updates: int):
    """`num_updates` updates of every lane and the evaluations due; units are training steps of a lane."""
    set_up_jax()
    study = study_of(num_lanes)
    tasks = Tasks.of(study, load_behaviour(study.behaviour))
    widths = group_widths(num_lanes, num_cores())
    programs = compile_programs(study, tasks, widths, num_cores())
    folder = Path(tempfile.mkdtemp())
    groups = [
        Group(study, study.lanes[start:end], tasks, programs[end - start], folder / f"{start}.safetensors")
        for start, end in pairwise(accumulate(widths, initial=0))
    ]

    def work():
        take_turns([Stint(group, num_updates) for group in groups], num_cores(), watch=lambda: None)

    return work, num_lanes * num_updates * study.ppo.n_steps
