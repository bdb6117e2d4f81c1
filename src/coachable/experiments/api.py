"""Three lines to anything: run a study by its name, roll a policy out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import jax
from jaxtyping import Array, Float

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.rollout import Trajectory
from coachable.envs.rollout import rollout as roll_out
from coachable.envs.walking_task import NO_BOX, Clock, make_task
from coachable.experiments.plan import Study, load_plan, with_options
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.runner import run_study
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters
from coachable.rewards.forms import Variant
from coachable.rewards.setup import PAPER_SETUPS, Semantics


def study(
    plan: str | Path | Study,
    out: str | Path,
    *,
    seeds: int | None = None,
    setups: Sequence[str] | None = None,
    steps: int | None = None,
    semantics: Semantics | None = None,
    reward_variant: Variant | None = None,
    behaviour: str | Path | None = None,
    clock: Clock | None = None,
    progress: bool = True,
) -> Run:
    """Run a study, or go on with it, and return its run; what `coachable study PLAN --out OUT` does.

    **Arguments:** `plan`, the name of one that ships, a TOML file, or a `Study`; `out`, the run folder;
    `seeds`, how many seeds each setup gets; `setups`, which of the plan's or the paper's; `steps` a lane; the
    rest as in `Study`. What is given replaces what the plan says. `progress`: whether to show how it goes on
    stderr.

    **Raises:** `PlanError` for a plan that makes no sense, `RunFolderError` for a folder of another plan.
    """
    options = {
        "seeds": seeds,
        "setups": setups,
        "steps": steps,
        "semantics": semantics,
        "reward_variant": reward_variant,
        "behaviour": None if behaviour is None else str(behaviour),
        "clock": clock,
    }
    resolved = with_options(plan, **options) if isinstance(plan, Study) else load_plan(plan, **options)
    return run_study(resolved, out, progress=progress)


def rollout(
    controller: Callable[[Float[Array, "4"]], Float[Array, "2"]],
    seconds: float = 10.0,
    *,
    semantics: Semantics = "paper",
    clock: Clock | None = None,
    parameters: CompassParameters = PAPER_PARAMETERS,
    behaviour: Behaviour | None = None,
) -> Trajectory:
    """Let a policy, or any controller x ↦ u, walk from the paper's start until it falls or the time is over.

    **Arguments:** `controller`, from the state (θ1, θ2, θ̇1, θ̇2) [rad, rad/s] to the torques (ankle, hip) [N
    m], in JAX; `seconds` at most; `clock`, by default the policy's own, else `free`; `behaviour`, whose
    phases the trajectory names, by default the semantics' compass walking.

    **Returns:** NumPy arrays by name: time, state, torque, foot, phase, and the reward's terms without
    weights.
    """
    task = make_task(
        PAPER_SETUPS["sparse"],
        semantics,
        clock=clock or getattr(controller, "clock", "free"),
        parameters=parameters,
        behaviour=behaviour,
        seconds=seconds,
        box=NO_BOX,
    )
    return Trajectory.of(task, jax.jit(lambda: roll_out(task, controller))())
