"""The command line: parses, calls, prints."""

from __future__ import annotations

import inspect
import json
import math
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import Positional, arg

import coachable
from coachable.behaviours.suggestion import suggestion
from coachable.errors import CoachableError

_STYLE = (tyro.conf.FlagCreatePairsOff,)

Semantics = Literal["paper", "released-code"]
ControllerName = Literal["virtual-gravity", "constant-torque", "none"]


def _option(metavar: str, help: str, *, otherwise: str = "", short: tuple[str, ...] = ()) -> object:
    """How an option that may be left out is shown: what to write, what it means, what holds without it."""
    hint = f"(default: {otherwise})" if otherwise else ""
    return arg(metavar=metavar, help=help, help_behavior_hint=hint, aliases=short)


def study(
    plan: Annotated[
        Positional[str], arg(metavar="PLAN", help="paper, paper-100, demo, or a TOML file of your own.")
    ],
    out: Annotated[Path | None, _option("DIR", "The run folder.", otherwise="runs/PLAN")] = None,
    semantics: Annotated[
        Semantics | None,
        _option("paper|released-code", "What the paper means, or what its code does, quirks included."),
    ] = None,
    reward_variant: Annotated[
        Literal["stay", "equation", "released"] | None,
        _option(
            "stay|equation|released", "How the phase reward is read.", otherwise="as the semantics have it"
        ),
    ] = None,
    behaviour: Annotated[
        str | None, _option("NAME|FILE", "The described behaviour.", otherwise="as the semantics have it")
    ] = None,
    clock: Annotated[
        Literal["free", "touchdown"] | None,
        _option("free|touchdown", "Whether a touchdown restarts the sample clock."),
    ] = None,
    steps: Annotated[int | None, _option("N", "Training steps a lane.")] = None,
    seeds: Annotated[int | None, _option("N", "How many seeds each setup gets.")] = None,
    setups: Annotated[
        tuple[str, ...] | None, _option("NAME [NAME …]", "Which reward setups, of the plan's or the paper's.")
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
    """
    from coachable.studies.plan import load_plan
    from coachable.studies.runner import run_study

    resolved = load_plan(
        plan,
        semantics=semantics,
        reward_variant=reward_variant,
        behaviour=behaviour,
        clock=clock,
        steps=steps,
        seeds=seeds,
        setups=setups,
    )
    folder = out or Path("runs") / resolved.name
    run_study(resolved, folder, allow_different_layout=allow_different_layout)
    table(folder)


def table(
    run: Annotated[Positional[Path], arg(metavar="RUN", help="A run folder, the --out of a study.")],
    out: Annotated[Path | None, _option("DIR", "Where to write to.", otherwise="the run folder")] = None,
) -> None:
    """Print a run's table; write it as Markdown, with its figures as SVG and PNG.

    For example:

        coachable table runs/paper
        coachable table runs/paper --out docs/results/paper
    """
    from coachable.analysis.figures import draw_figures
    from coachable.analysis.measurements import measure
    from coachable.analysis.table import print_table, write_markdown
    from coachable.studies.store import load_run

    measured = measure(load_run(run))
    print_table(measured)
    folder = out or run
    for path in (*draw_figures(measured, folder), write_markdown(measured, folder)):
        print(f"wrote {path}")


def report(
    runs: Annotated[
        Positional[tuple[Path, ...]],
        arg(metavar="RUN [RUN …]", help="Run folders, the --out of studies.", help_behavior_hint=""),
    ],
    out: Annotated[
        Path | None,
        _option(
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

    from coachable.analysis.report.formats import write
    from coachable.studies.citation import citation

    console = Console(stderr=True)
    with console.status("reading") as status:
        written, problems = write(runs, out, format, bibtex=citation(), tell=status.update)
    for path in written:
        print(f"wrote {path}")
    for problem in problems:
        print(f"coachable: not in the report: {problem}", file=sys.stderr)


def baseline(
    controller: Annotated[
        ControllerName,
        arg(help="Virtual gravity (slope −0.07), the constant torque (−1.35, −0.18) N m, or no torque."),
    ] = "virtual-gravity",
    semantics: Annotated[
        Semantics, arg(help="What the paper means, or what its code does, quirks included.")
    ] = "paper",
    json: Annotated[bool, arg(help="Print JSON.")] = False,
) -> None:
    """Walk a baseline for ten seconds, in float64, and print how it does.

    For example:

        coachable baseline
        coachable baseline --controller constant-torque --json
        coachable baseline --semantics released-code
    """
    from coachable.envs.baselines import baseline as walk

    report = walk(controller, semantics)
    numbers = {
        "controller": controller,
        "semantics": semantics,
        "hip_x": report.hip_x,
        "foot_x": report.foot_x,
        "touchdowns": report.touchdowns,
        "period": report.period,
        "step_length": report.step_length,
        "speed": report.speed,
        "share_in_cycle": report.share_in_cycle,
        "fell": report.fell,
        "rewards": dict(report.rewards),
    }
    if json:
        print(_json(numbers))
        return
    print(f"{controller}, {semantics} semantics, 10 s" + (": it fell" if report.fell else ""))
    for what, value, digits, unit in (
        ("hip distance", report.hip_x, 4, "m"),
        ("foot distance", report.foot_x, 4, "m"),
        ("touchdowns", report.touchdowns, 0, ""),
        ("period", report.period, 4, "s"),
        ("step length", report.step_length, 4, "m"),
        ("speed", report.speed, 3, "m/s"),
        ("in the cycle", 100 * report.share_in_cycle, 1, "% of samples"),
        *((f"reward, {name}", reward, 3, "") for name, reward in report.rewards.items()),
    ):
        print(f"  {what:<24}{value:>10.{digits}f} {unit}".rstrip())


def watch(
    run: Annotated[
        Positional[str],
        arg(metavar="RUN", help="A run folder, or a baseline: virtual-gravity, constant-torque, none."),
    ],
    out: Annotated[
        Path,
        arg(aliases=["-o"], metavar="FILE", help="gait.gif, gait.mp4 (needs the [video] extra) or gait.png."),
    ],
    setup: Annotated[str | None, _option("NAME", "The lane's setup.", otherwise="the plan's first")] = None,
    seed: Annotated[
        tuple[int, ...] | None,
        _option("N [N …]", "The lane's seed; several walk side by side.", otherwise="the plan's first"),
    ] = None,
    which: Annotated[
        Literal["last", "best"],
        arg(help="The policy after the last update, or the one with the best evaluation return."),
    ] = "last",
    seconds: Annotated[float, arg(help="How much of the walk.")] = 10.0,
    semantics: Annotated[Semantics, arg(help="Of a baseline; a run has its own.")] = "paper",
) -> None:
    """Draw a walk: the walker on the ground, its phase in colour.

    For example:

        coachable watch runs/paper --setup orthant --seed 3 -o gait.gif
        coachable watch runs/paper --setup sparse --seed 1 2 3 --which best -o gaits.mp4
        coachable watch runs/paper --setup sparse -o gait.png
        coachable watch virtual-gravity -o gait.gif
    """
    from coachable.viewing.watch import draw_walks, require_drawable

    require_drawable(out)
    from coachable.envs.baselines import CONTROLLER_NAMES
    from coachable.studies.walks import walk_of_baseline, walk_of_lane

    if run in CONTROLLER_NAMES:
        walks = [walk_of_baseline(run, semantics, seconds)]
        who = walks[0].title
    else:
        from coachable.studies.store import load_run

        opened = load_run(run)
        setup = setup or opened.plan.setups[0].name
        seeds = dict.fromkeys(seed or (opened.plan.first_seed,))
        walks = [walk_of_lane(opened, setup, number, which, seconds) for number in seeds]
        who = f"{setup}, seed{'s' * (len(walks) > 1)} {', '.join(map(str, seeds))}, {which} policy"
    titles = [walk.title if len(walks) > 1 else "" for walk in walks]
    trajectories = {title: walk.trajectory for title, walk in zip(titles, walks, strict=True)}
    draw_walks(trajectories, out, walks[0].behaviour.phases, walks[0].parameters)
    print(f"{out}: {who}")


def explain(
    behaviour: Annotated[
        Positional[str], arg(metavar="FILE", help="A .behaviour file, or the name of one that ships.")
    ],
    trace: Annotated[
        Positional[Path],
        arg(
            metavar="TRACE",
            help="Recorded signals, a column each, and the time: CSV (also .csv.gz) or Parquet.",
        ),
    ],
    dt: Annotated[
        float | None, _option("SECONDS", "Time between two rows.", otherwise="the column t or time")
    ] = None,
    limit: Annotated[int, arg(metavar="N", help="How many violations to show.")] = 20,
    all: Annotated[bool, arg(help="Show all violations.")] = False,
    phases: Annotated[
        Path | None, _option("OUT.csv", "Write the phase at each moment there.", otherwise="do not")
    ] = None,
    json: Annotated[bool, arg(help="Print JSON.")] = False,
) -> None:
    """Tell where a recorded trace follows a behaviour, and where and why it does not.

    Column names are the behaviour's signals, with or without their unit: dtheta_1 or "dtheta_1 [rad/s]".
    Exits 0 if the trace follows the behaviour, 1 if it does not, 2 if something cannot be read. For example:

        coachable explain compass-walking log.csv
        coachable explain mine.behaviour log.csv.gz --dt 0.002 --limit 5
        coachable explain mine.behaviour log.parquet --json --phases phases.csv
    """
    from rich.console import Console

    from coachable.automata.explanation import as_json, as_text
    from coachable.automata.explanation import explain as watch_trace
    from coachable.behaviours.library import load_behaviour

    described = load_behaviour(behaviour)
    with Console(stderr=True).status("") as status:
        explanation = watch_trace(
            described,
            trace,
            dt,
            None if all else limit,
            phases,
            lambda report: status.update(f"{report.samples:,} rows, up to t = {report.end:.3f} s"),
        )
    print(_json(as_json(explanation)) if json else as_text(explanation))
    if not explanation.report.follows:
        sys.exit(1)


def check(
    file: Annotated[Positional[Path], arg(metavar="FILE", help="A description, NAME.behaviour.")],
    json: Annotated[bool, arg(help="Print JSON; docs/findings.md tells its fields.")] = False,
    strict: Annotated[bool, arg(help="Fail on warnings, too.")] = False,
) -> None:
    """Tell what a description says that was not meant, each with a state that shows it.

    Exits 0 if there are no errors, 1 if there are, 2 if the file cannot be read. For example:

        coachable check walking.behaviour
        coachable check walking.behaviour --strict
        coachable check walking.behaviour --json
    """
    from rich.console import Console

    from coachable.behaviours.check_report import print_report, to_json
    from coachable.behaviours.checker import check as find
    from coachable.behaviours.document import read_document

    document = read_document(file)
    report = find(document.behaviour)
    if json:
        print(_json(to_json(report, document.behaviour, str(file), document.line_of)))
    else:
        print_report(report, document.behaviour, str(file), document.line_of, Console(highlight=False))
    if not report.passes(strict):
        sys.exit(1)


def cite() -> None:
    """Print what to cite, as BibTeX.

    For example:

        coachable cite >> references.bib
    """
    from coachable.studies.citation import citation

    print(citation(), end="")


COMMANDS = {
    "study": study,
    "table": table,
    "report": report,
    "watch": watch,
    "baseline": baseline,
    "check": check,
    "explain": explain,
    "cite": cite,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exits 2 after a user's mistake, 130 after Ctrl-C."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    try:
        _run(arguments)
    except CoachableError as error:
        print(f"coachable: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        if error.filename is None:
            raise
        print(f"coachable: {error.filename}: {error.strerror}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        command = shlex.join(["coachable", *arguments])
        print(f"\nStopped. Nothing is lost; go on with:\n  {command}", file=sys.stderr)
        sys.exit(130)


def _run(arguments: list[str]) -> None:
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_overview())
        return
    name, *rest = arguments
    if name not in COMMANDS:
        raise CoachableError(f"there is no command {name!r}; {suggestion(name, COMMANDS)}")
    command = COMMANDS[name]
    description = inspect.getdoc(command)
    tyro.cli(command, prog=f"coachable {name}", description=description, args=rest, config=_STYLE)


def _overview() -> str:
    summaries = {
        name: (inspect.getdoc(command) or "").partition("\n")[0] for name, command in COMMANDS.items()
    }
    return "\n".join(
        [
            (coachable.__doc__ or "").partition("\n")[0],
            "",
            "  coachable study demo                                        two minutes, to see it work",
            "  coachable study paper --out runs/paper                      the paper's whole study",
            "  coachable report runs/paper                                 one page: what was learned",
            "  coachable watch runs/paper --setup orthant --seed 3 -o gait.gif",
            "",
            *(f"  {name:<10}{summary}" for name, summary in summaries.items()),
            "",
            "coachable COMMAND --help tells more, with examples.",
        ]
    )


def _json(numbers: dict) -> str:
    finite = {key: None if isinstance(n, float) and not math.isfinite(n) else n for key, n in numbers.items()}
    return json.dumps(finite, indent=2)


if __name__ == "__main__":
    main()
