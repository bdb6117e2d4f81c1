"""How a study's lanes are laid out over the machine and over time: groups, keys, evaluations."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping

import jax
from jaxtyping import PRNGKeyArray

from coachable.experiments.plan import Lane, Study
from coachable.experiments.training import Training

WIDEST_GROUP = 16
"""Lanes that one program trains side by side: they fill the processor's vectors and fit into its cache."""


def num_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def group_widths(num_lanes: int, cores: int) -> tuple[int, ...]:
    """Into groups of how many lanes a study is cut.

    Groups are as wide as `WIDEST_GROUP` and a share for every core allow. A somewhat smaller width (down to
    half) that leaves no remainder is preferred, since each width is a program to be compiled. Results depend
    on these widths in their last bits, so a resumed study keeps the ones it began with.
    """
    widest = min(WIDEST_GROUP, -(-num_lanes // cores))
    exact = [width for width in range(widest, (widest + 1) // 2 - 1, -1) if num_lanes % width == 0]
    width = exact[0] if exact else widest
    whole, rest = divmod(num_lanes, width)
    return (width,) * whole + ((rest,) if rest else ())


def lane_key(lane: Lane) -> PRNGKeyArray:
    """The lane's random key: a function of its seed and its setup's name, whatever runs beside it."""
    name = int.from_bytes(hashlib.sha256(lane.setup.encode()).digest()[:4], "big")
    return jax.random.fold_in(jax.random.PRNGKey(lane.seed), name)


def evaluation_steps(study: Study | Training) -> Mapping[int, tuple[int, ...]]:
    """After how many updates a lane is evaluated, and as which training steps those evaluations count.

    Evaluation k stands for step k · `evaluate_every` ≤ `steps` and uses the weights after
    ⌊step / steps_an_update⌋ updates; the final one comes after the last update, at the step that has then
    been reached.
    """
    schedule: dict[int, tuple[int, ...]] = {}
    for step in sorted(
        {*range(study.evaluate_every, study.steps + 1, study.evaluate_every), study.total_steps}
    ):
        update = step // study.steps_an_update
        schedule[update] = (*schedule.get(update, ()), step)
    return schedule
