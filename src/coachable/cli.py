"""The command line: parses, calls, prints."""

from __future__ import annotations

import inspect
import json
import math
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast, get_args

import tyro
from tyro.conf import Positional, arg

import coachable
from coachable.behaviours.suggestion import suggestion
from coachable.errors import CoachableError

if TYPE_CHECKING:
    from coachable.behaviours.behaviour import Behaviour
    from coachable.plants.compass import CompassParameters

_FILMS, _PICTURES = (".gif", ".mp4"), (".png", ".svg", ".pdf")
_DRAWINGS = (".svg", ".png", ".dot", ".mmd")
STORED_SECONDS = 10.0
"""How long the walks in a run folder are."""
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
    seed: Annotated[int | None, _option("N", "The lane's seed.", otherwise="the plan's first")] = None,
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
        coachable watch runs/paper --setup sparse --which best -o gait.png
        coachable watch virtual-gravity -o gait.gif
    """
    suffix = out.suffix.lower()
    if suffix not in (*_PICTURES, *_FILMS):
        raise CoachableError(f"{out}: give a file that ends in {', '.join((*_FILMS, *_PICTURES))}")
    if run in get_args(ControllerName):
        walk, parameters, behaviour, who = _baseline_walk(run, semantics, seconds)
    else:
        walk, parameters, behaviour, who = _lane_walk(Path(run), setup, seed, which, seconds)
    if suffix in _PICTURES:
        from coachable.viewing.strobe import write_strobe as write
    else:
        from coachable.viewing.animation import animate as write
    write(walk, out, behaviour.phases, parameters)
    print(f"{out}: {who}")


def draw(
    behaviour: Annotated[
        Positional[str], arg(metavar="FILE", help="A behaviour: a shipped name or a file of your own.")
    ],
    out: Annotated[
        Path,
        arg(aliases=["-o"], metavar="PICTURE", help="x.svg or x.png; x.dot (Graphviz) or x.mmd (Mermaid)."),
    ],
    reward: Annotated[
        Literal["stay", "equation", "released"] | None,
        _option("stay|equation|released", "Draw what the phase reward pays, read this way, instead."),
    ] = None,
) -> None:
    """Draw a behaviour: its automaton, or what its reward pays.

    For example:

        coachable draw compass-walking -o walking.svg
        coachable draw mine.behaviour -o mine.png
        coachable draw compass-walking --reward stay -o reward.svg
    """
    from coachable.behaviours.library import load_behaviour

    suffixes = _DRAWINGS if reward is None else _DRAWINGS[:2]
    if (suffix := out.suffix.lower()) not in suffixes:
        raise CoachableError(f"{out}: give a file that ends in {', '.join(suffixes)}")
    described = load_behaviour(behaviour)
    if suffix in _DRAWINGS[2:]:
        from coachable.automata.plain_text import automaton_dot, automaton_mermaid

        text = automaton_dot(described) if suffix == ".dot" else automaton_mermaid(described)
    elif reward is None:
        from coachable.automata.draw import automaton_svg

        text = automaton_svg(described)
    else:
        from coachable.rewards.picture import reward_svg

        text = reward_svg(described, reward)
    if suffix == ".png":
        from coachable.automata.raster import svg_to_png

        out.write_bytes(svg_to_png(text))
    else:
        out.write_text(text, encoding="utf-8")
    print(f"{out}: {described.name}")


def diff(
    first: Annotated[Positional[str], arg(metavar="A", help="A behaviour: a shipped name or a file.")],
    second: Annotated[Positional[str], arg(metavar="B", help="The behaviour to compare it with.")],
    json: Annotated[bool, arg(help="Print JSON.")] = False,
) -> None:
    """Tell how two descriptions differ in meaning, with states in which they disagree.

    Exits 0 if they mean the same, 1 if they differ, 2 if one cannot be read. For example:

        coachable diff compass-walking compass-walking-released
        coachable diff mine.behaviour yours.behaviour --json
    """
    from coachable.behaviours.library import load_behaviour
    from coachable.rewards.difference import as_json, as_text, differences

    one, other = load_behaviour(first), load_behaviour(second)
    found = differences(one, other)
    print(as_json(found) if json else as_text(found, (*other.signals, *one.signals)))
    sys.exit(int(any(difference.matters for difference in found)))


def crossing(
    behaviour: Annotated[
        Positional[str], arg(metavar="FILE", help="A behaviour: a shipped name or a file of your own.")
    ],
    plant: Annotated[Literal["compass"], arg(help="What the behaviour is bound to.")] = "compass",
    json: Annotated[bool, arg(help="Print JSON.")] = False,
) -> None:
    """Tell for which states before touchdown an edge is taken at once.

    For example:

        coachable crossing compass-walking
    """
    from coachable.automata.crossing import explain_crossings
    from coachable.automata.hybrid import HybridAutomaton
    from coachable.behaviours.library import load_behaviour
    from coachable.plants.compass import CompassWalker

    answers = explain_crossings(HybridAutomaton.of(load_behaviour(behaviour), CompassWalker()))
    if json:
        print(_json({"plant": plant, "crossings": [answer.data for answer in answers]}))
    else:
        print("\n".join(line for answer in answers for line in answer.sentences))


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
    "watch": watch,
    "baseline": baseline,
    "draw": draw,
    "diff": diff,
    "crossing": crossing,
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
            "  coachable watch runs/paper --setup orthant --seed 3 -o gait.gif",
            "",
            *(f"  {name:<10}{summary}" for name, summary in summaries.items()),
            "",
            "coachable COMMAND --help tells more, with examples.",
        ]
    )


def _baseline_walk(
    name: str, semantics: Semantics, seconds: float
) -> tuple[object, CompassParameters, Behaviour, str]:
    from coachable.behaviours.library import load_behaviour
    from coachable.envs.baselines import baseline as walk
    from coachable.plants.compass import PAPER_PARAMETERS

    behaviour = load_behaviour("compass-walking" if semantics == "paper" else "compass-walking-released")
    report = walk(cast(ControllerName, name), semantics, seconds=seconds)
    return report.trajectory, PAPER_PARAMETERS, behaviour, f"{name}, {report.hip_x:.2f} m"


def _lane_walk(
    path: Path, setup: str | None, seed: int | None, which: Literal["last", "best"], seconds: float
) -> tuple[object, CompassParameters, Behaviour, str]:
    """A lane's stored walk as far as it goes, a fresh one if that is not far enough."""
    from coachable.studies.store import load_run

    run = load_run(path)
    setup = run.plan.setups[0].name if setup is None else setup
    seed = run.plan.seeds[0] if seed is None else seed
    stored = run.trajectory(setup, seed, which)
    who = f"{setup}, seed {seed}, {which} policy"
    if seconds <= STORED_SECONDS:
        walk = {name: column[stored["t"] <= seconds + 1e-6] for name, column in stored.items()}
        return walk, run.plan.plant, run.behaviour, who
    from coachable.studies.api import rollout

    study = run.plan
    walk = rollout(
        run.policy(setup, seed, which),
        seconds,
        semantics=study.semantics,
        parameters=study.plant,
        behaviour=run.behaviour,
    )
    return walk, study.plant, run.behaviour, who


def _json(numbers: dict) -> str:
    finite = {key: None if isinstance(n, float) and not math.isfinite(n) else n for key, n in numbers.items()}
    return json.dumps(finite, indent=2)


if __name__ == "__main__":
    main()
