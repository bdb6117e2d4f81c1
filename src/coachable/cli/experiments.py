"""Train experiments: train."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from coachable.cli.descriptions import warn_of_errors
from coachable.cli.options import (
    Semantics,
    Trust,
    option,
    output,
    say_imports,
)
from coachable.cli.results import show_table

if TYPE_CHECKING:
    from coachable.experiments.experiment import Experiment


def train(
    plan: Annotated[
        Positional[str | None],
        arg(
            metavar="[PLAN]",
            help="paper, paper-100, beyond-paper, certifiable, demo, or a TOML file; options override it.",
            help_behavior_hint="",
        ),
    ] = None,
    out: Annotated[Path | None, output("DIR", "The run folder.", otherwise="runs/NAME")] = None,
    env: Annotated[
        str | None,
        option("ID", "What gymnasium.make takes; MODULE:ID imports a module of yours first."),
    ] = None,
    behaviour: Annotated[
        str | None,
        option("NAME|FILE", "The described behaviour.", otherwise="the plan's, or as the semantics have it"),
    ] = None,
    trainer: Annotated[
        str | None,
        option(
            "NAME",
            "ppo is ours; sb3-ppo, sb3-sac and sb3-td3 are stable-baselines3's and need "
            "the [sb3] extra; MODULE:CLASS is one of yours.",
            otherwise="ppo",
        ),
    ] = None,
    settings: Annotated[
        str | None,
        option("NAME|FILE", "The trainer's settings as TOML: ppo-walker2d, sac-mujoco, … or your file."),
    ] = None,
    setups: Annotated[
        tuple[str, ...] | None, option("NAME [NAME …]", "Which reward setups, of the plan's or the paper's.")
    ] = None,
    weight: Annotated[
        float | None, option("W", "In an --env, factor of the behaviour's reward.", otherwise="1")
    ] = None,
    semantics: Annotated[
        Semantics | None,
        option("paper|released-code", "What the paper means, or what its code does, quirks included."),
    ] = None,
    reward_variant: Annotated[
        Literal["stay", "equation", "released", "schedule"] | None,
        option(
            "stay|equation|released|schedule",
            "How a plant's phase reward is read.",
            otherwise="as the semantics have it",
        ),
    ] = None,
    deterministic: Annotated[
        Literal["clipped-mean", "expected-action"] | None,
        option(
            "clipped-mean|expected-action",
            "What policies do when they do not explore: their mean, clipped, or the mean of the actions that "
            "they apply.",
            otherwise="the plan's, else clipped-mean",
        ),
    ] = None,
    clock: Annotated[
        Literal["free", "touchdown"] | None,
        option("free|touchdown", "Whether a touchdown restarts a plant's sample clock."),
    ] = None,
    steps: Annotated[int | None, option("N", "Training steps a lane.", otherwise="the plan's")] = None,
    evaluate_every: Annotated[
        int | None, option("N", "Training steps between two evaluations.", otherwise="the plan's")
    ] = None,
    seeds: Annotated[
        int | None, option("N", "How many seeds each setup gets.", otherwise="the plan's")
    ] = None,
    track: Annotated[
        Literal["tensorboard", "none"],
        arg(help="Whether to write events for TensorBoard, which needs the [track] extra, into the folder."),
    ] = "none",
    workers: Annotated[
        int | None, option("N", "How many lanes, or batches of them, at once.", otherwise="one a core")
    ] = None,
    allow_different_layout: Annotated[
        bool, arg(help="Go on with a run that was begun under other versions or on another machine.")
    ] = False,
    trust: Trust = False,
) -> None:
    """Train an experiment, or go on with one, and print its table.

    Give a plan, or options, which override it; the resolved plan is kept in the run
    folder. Stopped at any moment, the same command goes on from the last checkpoint. For example:

        coachable train demo
        coachable train paper -o runs/paper
        coachable train paper --semantics released-code -o runs/released
        coachable train demo --behaviour compass-walking-timed --reward-variant schedule
        coachable train mine.toml --setups orthant mine --seeds 5 --steps 100000
        coachable train --env Walker2d-v5 --behaviour walk
        coachable train --env Hopper-v5 --behaviour mine.behaviour --trainer sb3-sac --settings sac-mujoco
        coachable train --env coachable/CompassWalker-v0 --behaviour compass-walking --trainer sb3-ppo
    """
    from coachable.experiments.named_modules import modules_named
    from coachable.experiments.plan import load_plan, trainer_settings
    from coachable.experiments.runner import run_experiment
    from coachable.foundation.errors import PlanError

    if plan is None and env is None:
        raise PlanError("train what? Give a plan, such as paper or demo, or --env and --behaviour")
    say_imports(trust, plan, settings)
    experiment = load_plan(
        plan,
        env=env,
        behaviour=behaviour,
        trainer=trainer,
        settings=None if settings is None else trainer_settings(settings),
        setups=setups,
        weight=weight,
        semantics=semantics,
        reward_variant=reward_variant,
        deterministic=deterministic,
        clock=clock,
        steps=steps,
        evaluate_every=evaluate_every,
        seeds=seeds,
    )
    warn_of_errors(experiment.behaviour, experiment.described_by)
    warn_of_paid_endings(experiment)
    folder = out or Path("runs") / experiment.name
    say_imports(trust, folder, known=modules_named(experiment.to_data()))
    run_experiment(
        experiment,
        folder,
        track=track == "tensorboard",
        workers=workers,
        allow_different_layout=allow_different_layout,
    )
    show_table(folder, folder)


def warn_of_paid_endings(experiment: Experiment) -> None:
    """Print on stderr which setups pay a step so little that ending the episode can pay more."""
    from coachable.envs.own_reward import ALIVE
    from coachable.envs.problem import EnvironmentProblem
    from coachable.rewards.setup import DescribedSetup

    problem = experiment.problem
    for setup in experiment.setups:
        if not isinstance(problem, EnvironmentProblem) or not isinstance(setup, DescribedSetup):
            continue
        least = problem.least_pay(setup)
        if least is not None and least < 0:
            instead = " in place of `replace`" if setup.replace else ""
            enough = (0.0 if setup.replace else setup.terms[ALIVE]) - least
            print(
                f"coachable: {setup.name} can pay {least:g} for a step. Where falling ends an episode, that "
                f"teaches to fall; `terms = {{ {ALIVE} = {enough:g} }}`{instead} lets no step cost anything.",
                file=sys.stderr,
            )
