"""Run studies, and tell what came out: study, table, report, cite."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from coachable.cli.descriptions import warn_of_errors
from coachable.cli.options import Semantics, option
from coachable.foundation.errors import CoachableError


def study(
    plan: Annotated[
        Positional[str],
        arg(metavar="PLAN", help="paper, paper-100, certifiable, demo, or a TOML file of your own."),
    ],
    out: Annotated[Path | None, option("DIR", "The run folder.", otherwise="runs/PLAN")] = None,
    semantics: Annotated[
        Semantics | None,
        option("paper|released-code", "What the paper means, or what its code does, quirks included."),
    ] = None,
    reward_variant: Annotated[
        Literal["stay", "equation", "released"] | None,
        option(
            "stay|equation|released", "How the phase reward is read.", otherwise="as the semantics have it"
        ),
    ] = None,
    behaviour: Annotated[
        str | None, option("NAME|FILE", "The described behaviour.", otherwise="as the semantics have it")
    ] = None,
    clock: Annotated[
        Literal["free", "touchdown"] | None,
        option("free|touchdown", "Whether a touchdown restarts the sample clock."),
    ] = None,
    trainer: Annotated[
        Literal["ppo", "sb3-ppo", "sb3-sac", "sb3-td3"] | None,
        option("ppo|sb3-ppo|sb3-sac|sb3-td3", "Ours, or stable-baselines3's, which need the [sb3] extra."),
    ] = None,
    steps: Annotated[int | None, option("N", "Training steps a lane.")] = None,
    seeds: Annotated[int | None, option("N", "How many seeds each setup gets.")] = None,
    setups: Annotated[
        tuple[str, ...] | None, option("NAME [NAME …]", "Which reward setups, of the plan's or the paper's.")
    ] = None,
    allow_different_layout: Annotated[
        bool, arg(help="Go on with a run that was begun under other versions or on another machine.")
    ] = False,
) -> None:
    """Run a study, or go on with one, and print its table.

    Options replace what the plan says; the resolved plan is kept in the run folder. Stopped at any moment,
    the same command goes on from the last checkpoint and ends with the same bits. For example:

        coachable study demo
        coachable study paper --out runs/paper
        coachable study paper --semantics released-code --out runs/released
        coachable study mine.toml --setups orthant mine --seeds 5 --steps 100000
        coachable study paper --trainer sb3-ppo --setups orthant --seeds 5 --out runs/sb3
    """
    from coachable.experiments.plan import load_plan
    from coachable.experiments.runner import run_study

    resolved = load_plan(
        plan,
        semantics=semantics,
        reward_variant=reward_variant,
        behaviour=behaviour,
        clock=clock,
        trainer=trainer,
        steps=steps,
        seeds=seeds,
        setups=setups,
    )
    warn_of_errors(resolved.behaviour)
    folder = out or Path("runs") / resolved.name
    run_study(resolved, folder, allow_different_layout=allow_different_layout)
    table(folder)


def table(
    run: Annotated[Positional[Path], arg(metavar="RUN", help="A run folder, the --out of a study.")],
    out: Annotated[Path | None, option("DIR", "Where to write to.", otherwise="the run folder")] = None,
) -> None:
    """Print a run's table; write it as Markdown, with its figures as SVG and PNG.

    For example:

        coachable table runs/paper
        coachable table runs/paper --out docs/results/paper
    """
    from coachable.analysis.figures import draw_figures
    from coachable.analysis.measurements import measure
    from coachable.analysis.table import print_table, write_markdown
    from coachable.analysis.training_table import tell_training
    from coachable.experiments.run_folder.reader import TrainingRun, open_run

    opened = open_run(run)
    if isinstance(opened, TrainingRun):
        tell_training(opened, out or run)
        return
    measured = measure(opened)
    print_table(measured)
    folder = out or run
    for path in (*draw_figures(measured, folder), write_markdown(measured, folder)):
        print(f"wrote {path}")


def compare(
    run: Annotated[Positional[Path], arg(metavar="RUN", help="A run folder, the --out of a study.")],
    other: Annotated[Positional[Path], arg(metavar="RUN", help="Another one, with a setup in common.")],
    out: Annotated[Path, arg(aliases=["-o"], metavar="DIR", help="Where to write to.")] = Path("comparison"),
) -> None:
    """Lay the curves of two studies over each other, and test whether their runs differ.

    For example:

        coachable compare runs/paper runs/sb3 -o runs/paper-and-sb3
    """
    from coachable.analysis.comparison import tell_comparison
    from coachable.analysis.measurements import measure
    from coachable.experiments.run_folder.reader import load_run

    studies = {}
    for path in (run, other):
        opened = load_run(path)
        title = f"{opened.plan.name}, {opened.plan.trainer}"
        studies[title if title not in studies else f"{title}, {path.name}"] = measure(opened)
    tell_comparison(studies, out)


def report(
    runs: Annotated[
        Positional[tuple[Path, ...]],
        arg(metavar="RUN [RUN …]", help="Run folders, the --out of studies.", help_behavior_hint=""),
    ],
    out: Annotated[
        Path | None,
        option(
            "FILE",
            "The page or Markdown file, or the folder of the figures.",
            otherwise="report.html, report.md or figures, in the run folder or, of several, here",
            short=("-o",),
        ),
    ] = None,
    format: Annotated[
        Literal["html", "md", "pdf-figures"],
        arg(help="One page, the tables as Markdown, or the figures as PDF for a two-column paper."),
    ] = "html",
) -> None:
    """Write one HTML page that shows what was learned: claims, curves, walkers, every seed, and the numbers.

    The page needs no network and nothing beside it. Of a study that is under way it tells what there is; a
    folder that cannot be read is named, and the others are reported.

    For example:

        coachable report runs/paper
        coachable report runs/paper runs/released -o both.html
        coachable report runs/paper --format md -o paper.md
        coachable report runs/paper --format pdf-figures -o figures
    """
    if not runs:
        raise CoachableError("give at least one RUN: coachable report runs/paper")
    from rich.console import Console

    from coachable.analysis.citation import citation
    from coachable.analysis.report.formats import write

    console = Console(stderr=True)
    with console.status("reading") as status:
        written, problems = write(runs, out, format, bibtex=citation(), tell=status.update)
    for path in written:
        print(f"wrote {path}")
    for problem in problems:
        print(f"coachable: not in the report: {problem}", file=sys.stderr)


def cite() -> None:
    """Print what to cite, as BibTeX.

    For example:

        coachable cite >> references.bib
    """
    from coachable.analysis.citation import citation

    print(citation(), end="")
