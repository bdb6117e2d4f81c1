"""Our training as an experiment runs it: lane batches, worker threads, evaluations, logs, checkpoints."""

from __future__ import annotations

import tempfile
from itertools import accumulate, pairwise
from pathlib import Path

from bench.programs.coachable_compilation import experiment_of
from coachable.experiments.layout import batch_sizes, num_cores
from coachable.experiments.runner import set_up_jax
from coachable.experiments.trainers.compiled import Tasks, compile_programs
from coachable.experiments.trainers.lane_batch import LaneBatch
from coachable.experiments.trainers.workers import take_turns
from coachable.learning.config import PPOConfig


class Stint:
    """A batch that is done after some more updates: a `Job` for `take_turns`."""

    def __init__(self, batch: LaneBatch, num_updates: int):
        self._batch = batch
        self._end = batch.num_updates + num_updates

    @property
    def turns(self) -> int:
        """Updates so far."""
        return self._batch.num_updates

    @property
    def done(self) -> bool:
        """Whether the stint is over."""
        return self.turns >= self._end

    def take_turn(self) -> None:
        """One update, with the evaluations due."""
        self._batch.take_turn()


def prepare(num_lanes: int, num_updates: int):
    """`num_updates` updates of every lane and the evaluations due; units are training steps of a lane."""
    set_up_jax()
    experiment = experiment_of(num_lanes)
    tasks = Tasks.of(experiment)
    widths = batch_sizes(num_lanes, num_cores())
    programs = compile_programs(experiment, PPOConfig(), tasks, widths, num_cores())
    folder = Path(tempfile.mkdtemp())
    batches = [
        LaneBatch(
            experiment,
            experiment.lanes[start:end],
            tasks,
            programs[end - start],
            folder / f"{start}.safetensors",
        )
        for start, end in pairwise(accumulate(widths, initial=0))
    ]

    def work():
        take_turns([Stint(batch, num_updates) for batch in batches], num_cores(), watch=lambda: None)

    return work, num_lanes * num_updates * experiment.trainer.steps_an_update
