"""Three lines to anything: train an experiment by its name, roll a policy out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import jax

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.rollout import Trajectory
from coachable.envs.rollout import rollout as roll_out
from coachable.envs.walking_task import NO_BOX, make_task
from coachable.experiments.experiment import Experiment
from coachable.experiments.plan import load_plan, with_options
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.runner import run_experiment
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.plants.plant import Controller, Plant
from coachable.plants.sampled import Clock
from coachable.rewards.controller_memory import ControllerMemory
from coachable.rewards.setup import PAPER_SETUPS, Semantics


def train(
    plan: str | Path | Experiment | None = None,
    out: str | Path | None = None,
    *,
    track: bool = False,
    progress: bool = True,
    workers: int | None = None,
    **options: Any,
) -> Run:
    """Train an experiment, or go on with it, and return its run; what `coachable train` does.

    **Arguments:**
        plan: the name of one that ships, a TOML file, an `Experiment`, or nothing but options.
        out: the run folder, by default `runs/` and the experiment's name.
        track, progress, workers: as in `run_experiment`.
        options: keys of a plan, which replace its own: `env`, `behaviour`, `trainer`, `settings`,
        `steps`,
            `evaluate_every`, `seeds` (a count), `setups` (names or tables), `semantics`, `reward_variant`,
            `clock`, `plant`, `weight`, …

    **Raises:** `PlanError` for a plan that makes no sense, `RunFolderError` for a folder of another plan.
    """
    resolved = with_options(plan, **options) if isinstance(plan, Experiment) else load_plan(plan, **options)
    folder = Path("runs") / resolved.name if out is None else out
    return run_experiment(resolved, folder, track=track, progress=progress, workers=workers)


def rollout(
    controller: Controller,
    seconds: float = 10.0,
    *,
    semantics: Semantics = "paper",
    clock: Clock | None = None,
    plant: Plant | str = "compass",
    behaviour: Behaviour | None = None,
) -> Trajectory:
    """Roll out a policy, or any controller x ↦ u, from a plant's start until a fall or the end of the time.

    **Arguments:** `controller`, from the plant's state to its control, in JAX, of the compass walker from
    (θ1, θ2, θ̇1, θ̇2) [rad, rad/s] to the torques (ankle, hip) [N m]; `seconds` at most; `clock`, by default
    the policy's own, else `free`; `plant`, or its name; `behaviour`, whose phases the trajectory names, by
    default the one that ships for the plant, or the one that a policy with a memory remembers of.

    **Raises:** `ParameterError` for more seconds than 100,000, and what `make_task` raises.

    **Returns:** NumPy arrays by name: time, state, control, foot, phase, and the reward's terms without
    weights.
    """
    real_number(seconds, "seconds", ParameterError, least=0.01, most=100_000)
    setup, memory = PAPER_SETUPS["sparse"], ControllerMemory.of(controller)
    if memory is not None:
        behaviour = behaviour or memory.form.behaviour
        setup = replace(setup, observe="memory", reward_variant=memory.form.form.to_data())
    task = make_task(
        setup,
        semantics,
        clock=clock or getattr(controller, "clock", "free"),
        plant=plant,
        behaviour=behaviour,
        seconds=seconds,
        box=NO_BOX,
    )
    return Trajectory.of(task, jax.jit(lambda: roll_out(task, controller))())
