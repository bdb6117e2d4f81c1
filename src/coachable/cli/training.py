"""Train a described behaviour in any environment: train."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from coachable.cli.descriptions import warn_of_errors
from coachable.cli.options import option
from coachable.foundation.errors import PlanError

COMPASS_WALKER = "coachable/CompassWalker-v0"


def train(
    plan: Annotated[
        Positional[Path | None],
        arg(metavar="[PLAN]", help="A TOML file; the options replace what it says.", help_behavior_hint=""),
    ] = None,
    env: Annotated[
        str | None,
        option("ID", "What gymnasium.make takes; MODULE:ID imports a module of yours first."),
    ] = None,
    behaviour: Annotated[str | None, option("NAME|FILE", "The described behaviour.")] = None,
    trainer: Annotated[
        Literal["ppo", "sb3-ppo", "sb3-sac", "sb3-td3"] | None,
        option(
            "ppo|sb3-ppo|sb3-sac|sb3-td3",
            "Ours is for the compass walker; the others are stable-baselines3's and need the [sb3] extra.",
            otherwise="sb3-ppo; for the compass walker ppo",
        ),
    ] = None,
    settings: Annotated[
        str | None,
        option("NAME|FILE", "The trainer's settings as TOML: ppo-walker2d, sac-mujoco, … or your file."),
    ] = None,
    weight: Annotated[
        float | None, option("W", "What the behaviour's reward is multiplied with.", otherwise="1")
    ] = None,
    setup: Annotated[
        str | None, option("NAME", "For the compass walker: the reward setup.", otherwise="orthant")
    ] = None,
    steps: Annotated[int | None, option("N", "Training steps a lane.", otherwise="1,000,000")] = None,
    evaluate_every: Annotated[
        int | None, option("N", "Training steps between two evaluations.", otherwise="20,000")
    ] = None,
    seeds: Annotated[int | None, option("N", "How many seeds each setup gets.", otherwise="1")] = None,
    track: Annotated[
        Literal["tensorboard", "none"],
        arg(help="Whether to write events for TensorBoard, which needs the [track] extra, into the folder."),
    ] = "none",
    out: Annotated[Path | None, option("DIR", "The run folder.", otherwise="runs/ENV")] = None,
    workers: Annotated[
        int | None, option("N", "How many lanes are trained at once.", otherwise="one a core")
    ] = None,
    allow_different_layout: Annotated[
        bool, arg(help="Go on with a run that was begun under other versions or on another machine.")
    ] = False,
) -> None:
    """Train a described behaviour in a Gymnasium environment, or go on with it, and print how it went.

    The environment's reward and the behaviour's, times the weight, are paid together; a plan can say more,
    and compare several setups. Stopped at any moment, the same command goes on from the last checkpoint.

    For example:

        coachable train --env Hopper-v5 --behaviour hops.behaviour --settings ppo-hopper --seeds 2
        coachable train --env Walker2d-v5 --behaviour perry-gait --trainer sb3-sac --steps 300000
        coachable train walker2d.toml --out runs/walker2d
        coachable train --env coachable/CompassWalker-v0 --behaviour compass-walking --seeds 5
    """
    if env is not None and _is_compass_walker(env):
        if plan is not None or weight is not None or workers is not None or track != "none":
            raise PlanError(
                "the compass walker takes no PLAN, --weight, --track or --workers; see `coachable study`"
            )
        said = {"trainer": trainer, "steps": steps, "evaluate_every": evaluate_every, "seeds": seeds}
        _train_compass_walker(behaviour, settings, setup, out, said, allow_different_layout)
        return
    from coachable.analysis.training_table import tell_training
    from coachable.experiments.training import load_training, trainer_settings
    from coachable.experiments.training_runner import run_training

    if setup is not None:
        raise PlanError("--setup is for the compass walker; name the setups of a training in its plan")
    training = load_training(
        plan,
        env=env,
        behaviour=behaviour,
        trainer=trainer,
        settings=None if settings is None else trainer_settings(settings),
        weight=weight,
        steps=steps,
        evaluate_every=evaluate_every,
        seeds=seeds,
    )
    if _is_compass_walker(training.env):
        raise PlanError(
            f"{training.env} has plans of its own, see `coachable study`; for one setup, name it by --env"
        )
    warn_of_errors(training.behaviour)
    run = run_training(
        training,
        out or Path("runs") / training.name,
        track=track == "tensorboard",
        workers=workers,
        allow_different_layout=allow_different_layout,
    )
    tell_training(run, run.path)


def _is_compass_walker(env: str) -> bool:
    return env.removeprefix("coachable.envs:") == COMPASS_WALKER


def _train_compass_walker(
    behaviour: str | None,
    settings: str | None,
    setup: str | None,
    out: Path | None,
    said: dict[str, Any],
    allow_different_layout: bool,
) -> None:
    """A study of one setup: the compass walker has a task, an evaluation and baselines of its own."""
    from coachable.cli.studies import table
    from coachable.experiments.plan import with_options
    from coachable.experiments.runner import run_study
    from coachable.experiments.study import Study
    from coachable.experiments.training import trainer_settings
    from coachable.rewards.setup import paper_setup

    if settings is not None:
        whose = "ppo" if said["trainer"] in (None, "ppo") else "sb3"
        said = {**said, whose: trainer_settings(settings)}
    study = with_options(
        Study(name="CompassWalker-v0", num_seeds=1, setups=(paper_setup(setup or "orthant"),)),
        behaviour=behaviour,
        **said,
    )
    warn_of_errors(study.behaviour)
    folder = out or Path("runs") / study.name
    run_study(study, folder, allow_different_layout=allow_different_layout)
    table(folder)
