"""How lanes are laid out over the machine and over time: batches, keys, evaluations."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping

import jax
from jaxtyping import PRNGKeyArray

from coachable.experiments.experiment import Experiment, Lane

WIDEST_BATCH = 16
"""Lanes that one program trains side by side: they fill the processor's vectors and fit into its cache."""


def num_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def batch_sizes(num_lanes: int, num_workers: int) -> tuple[int, ...]:
    """Into batches of how many lanes an experiment is cut.

    Batches are as wide as `WIDEST_BATCH` and a share for every worker allow. A somewhat smaller width (down
    to half) that leaves no remainder is preferred, since each width is a program to be compiled. Results
    depend on these widths in their last bits, so a resumed run keeps the ones it began with.
    """
    widest = min(WIDEST_BATCH, -(-num_lanes // num_workers))
    exact = [width for width in range(widest, (widest + 1) // 2 - 1, -1) if num_lanes % width == 0]
    width = exact[0] if exact else widest
    whole, rest = divmod(num_lanes, width)
    return (width,) * whole + ((rest,) if rest else ())


def lane_key(lane: Lane) -> PRNGKeyArray:
    """The lane's random key: a function of its seed and its setup's name, whatever runs beside it."""
    name = int.from_bytes(hashlib.sha256(lane.setup.encode()).digest()[:4], "big")
    return jax.random.fold_in(jax.random.PRNGKey(lane.seed), name)


def evaluation_steps(experiment: Experiment) -> Mapping[int, tuple[int, ...]]:
    """After how many updates a lane is evaluated, and as which training steps those evaluations count.

    Evaluation k stands for step k · `evaluate_every` ≤ `steps` and uses the weights after
    ⌊step / steps_an_update⌋ updates; the final one comes after the last update, at the step that has then
    been reached.
    """
    schedule: dict[int, tuple[int, ...]] = {}
    for step in sorted(
        {
            *range(experiment.evaluate_every, experiment.steps + 1, experiment.evaluate_every),
            experiment.total_steps,
        }
    ):
        update = step // experiment.trainer.steps_an_update
        schedule[update] = (*schedule.get(update, ()), step)
    return schedule
