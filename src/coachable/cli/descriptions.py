"""Work with descriptions: check, format, draw, diff, explain."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from coachable.cli.options import (
    BehaviourName,
    LaneSeed,
    LaneSetup,
    Trust,
    WhichPolicy,
    option,
    output,
    print_json,
    require_no_input,
    require_suffix,
    say_imports,
)
from coachable.foundation.data import whole_number
from coachable.foundation.errors import CoachableError

if TYPE_CHECKING:
    from coachable.automata.edges_at_impact import EdgeAtImpact
    from coachable.behaviours.behaviour import Behaviour

_DRAWINGS = (".svg", ".png", ".dot", ".mmd")


def check(
    behaviour: BehaviourName,
    json: Annotated[bool, arg(help="Print JSON, whose fields are in docs/findings.md.")] = False,
    strict: Annotated[bool, arg(help="Fail on warnings, too.")] = False,
    plant: Annotated[
        str | None,
        option(
            "NAME|MODULE:CLASS",
            "Ask also at which of a plant's touchdowns an edge is taken at once, such as compass.",
        ),
    ] = None,
) -> None:
    """Report what a description says that was not meant, each finding with a state that shows it.

    Exits 0 if there are no errors, 1 if there are, 2 if the file cannot be read. For example:

        coachable check walking.behaviour
        coachable check walking.behaviour --strict
        coachable check walking.behaviour --json
        coachable check compass-walking --plant compass
    """
    from rich.console import Console

    from coachable.behaviours.checking.check_report import print_report, to_json
    from coachable.behaviours.checking.checker import check as find
    from coachable.behaviours.library import find_behaviour
    from coachable.behaviours.text.document import read_document
    from coachable.rewards.audit import left_open

    document = read_document(find_behaviour(behaviour))
    crossings = () if plant is None else _crossings(document.behaviour, plant)
    report = find(document.behaviour).joined(left_open(document.behaviour))
    if json:
        findings = to_json(report, document.behaviour, behaviour, document.line_of)
        print_json(findings | ({"crossings": [one.data for one in crossings]} if plant else {}))
    else:
        print_report(report, document.behaviour, behaviour, document.line_of, Console(highlight=False))
        for one in crossings:
            print("", *one.sentences, sep="\n")
        if plant is not None and not crossings:
            print("\nNo edge is taken on touchdown: there is nothing to ask about the plant.")
    if not report.passes(strict):
        sys.exit(1)


def warn_of_errors(described: Behaviour, behaviour: str) -> None:
    """Print on stderr that a description, read from a shipped name or a file, has errors by `check`.

    It is no refusal: what is proven impossible is so for continuous signals, and a simulator's may jump.
    """
    from coachable.behaviours.library import SHIPPED

    if behaviour in SHIPPED:
        return
    from coachable.behaviours.checking.checker import check as find

    errors = [finding for finding in find(described).findings if finding.severity == "error"]
    if errors:
        count = f"{len(errors)} error{'s' * (len(errors) > 1)}"
        print(
            f"coachable: {behaviour} has {count}, the first: {errors[0].message} It is trained as it stands; "
            f"`coachable check {behaviour}` reports what to change.",
            file=sys.stderr,
        )


def _crossings(behaviour: Behaviour, plant: str) -> tuple[EdgeAtImpact, ...]:
    from coachable.automata.edges_at_impact import explain_edges_at_impact
    from coachable.automata.hybrid import HybridAutomaton
    from coachable.plants.named import make_plant

    return explain_edges_at_impact(HybridAutomaton.of(behaviour, make_plant(plant)))


def format(
    files: Annotated[
        Positional[tuple[Path, ...]], arg(metavar="FILE", help="Files that describe behaviours.")
    ],
    check: Annotated[bool, arg(help="Change nothing; exit 1 if a file is not formatted.")] = False,
) -> None:
    """Lay out behaviour files in the one way: indented, aligned, comments kept.

    A file with a mistake in it is left as it is, and the mistake reported. For example:

        coachable format walk.behaviour
        coachable format --check *.behaviour
    """
    from coachable.behaviours.text.document import formatted_file
    from coachable.foundation.files import replace_text

    if not files:
        raise CoachableError("name at least one file")
    mistakes, unformatted = [], []
    for path in files:
        try:
            text, formatted = formatted_file(path)
        except CoachableError as error:
            mistakes.append(str(error))
            continue
        if formatted != text:
            unformatted.append(path)
            if not check:
                replace_text(path, formatted)
    for path in unformatted:
        print(f"{path}: {'not formatted' if check else 'formatted'}")
    if mistakes:
        raise CoachableError("\n".join(mistakes))
    if check and unformatted:
        sys.exit(1)


def draw(
    behaviour: BehaviourName,
    out: Annotated[Path, output("FILE", "x.svg or x.png; x.dot (Graphviz) or x.mmd (Mermaid).")],
    reward: Annotated[
        Literal["stay", "equation", "released", "schedule"] | None,
        option("stay|equation|released|schedule", "Draw what this form of the reward pays, instead."),
    ] = None,
) -> None:
    """Draw a behaviour: its automaton, or what its reward pays.

    For example:

        coachable draw compass-walking -o walking.svg
        coachable draw mine.behaviour -o mine.png
        coachable draw compass-walking --reward stay -o reward.svg
        coachable draw compass-walking-timed --reward schedule -o schedule.svg
        coachable draw compass-walking -o automaton.mmd
    """
    from coachable.behaviours.library import find_behaviour, load_behaviour
    from coachable.foundation.files import write_atomic

    suffixes = _DRAWINGS if reward is None else _DRAWINGS[:2]
    suffix = require_suffix(out, suffixes)
    file = find_behaviour(behaviour)
    require_no_input(out, file, file.parent)
    described = load_behaviour(behaviour)
    if suffix in _DRAWINGS[2:]:
        from coachable.diagram.plain_text import automaton_dot, automaton_mermaid

        text = automaton_dot(described) if suffix == ".dot" else automaton_mermaid(described)
    elif reward is None:
        from coachable.diagram.draw import MOST_PHASES, automaton_svg

        if (number := len(described.phases)) > MOST_PHASES:
            raise CoachableError(
                f"{behaviour} has {number} phases, and at most {MOST_PHASES} are drawn; "
                "give x.dot or x.mmd, which name any number"
            )
        text = automaton_svg(described)
    else:
        from coachable.rewards.picture import reward_svg

        text = reward_svg(described, reward)
    if suffix == ".png":
        from coachable.diagram.raster import svg_to_png

        write_atomic(out, svg_to_png(text))
    else:
        write_atomic(out, text)
    print(f"{out}: {described.name}")


def diff(
    behaviour: BehaviourName,
    other: Annotated[Positional[str], arg(metavar="BEHAVIOUR", help="The one to compare it with.")],
    json: Annotated[bool, arg(help="Print JSON.")] = False,
) -> None:
    """Report how two descriptions differ in meaning, with states in which they disagree.

    Exits 0 if they mean the same, 1 if they differ, 2 if one cannot be read. For example:

        coachable diff compass-walking compass-walking-released
        coachable diff mine.behaviour yours.behaviour --json
    """
    from coachable.behaviours.library import load_behaviour
    from coachable.rewards.difference import as_json, as_text, differences

    first, second = load_behaviour(behaviour), load_behaviour(other)
    found = differences(first, second)
    print(as_json(found) if json else as_text(found, (*second.signals, *first.signals)))
    sys.exit(int(any(difference.matters for difference in found)))


def explain(
    behaviour: Annotated[
        Positional[str],
        arg(
            metavar="FILE|RUN",
            help="A .behaviour file, the name of one that ships, or a run folder for the run's own.",
        ),
    ],
    trace: Annotated[
        Positional[Path | None],
        arg(
            metavar="TRACE",
            help="Recorded signals, a column each, and the time: CSV (also .csv.gz) or Parquet; or RUN.",
            help_behavior_hint="(default: a walk of RUN)",
        ),
    ] = None,
    setup: LaneSetup = None,
    seed: LaneSeed = None,
    which: WhichPolicy = "last",
    dt: Annotated[
        float | None, option("SECONDS", "Time between two rows.", otherwise="the column t or time")
    ] = None,
    limit: Annotated[int, arg(metavar="N", help="How many violations to show.")] = 20,
    all: Annotated[bool, arg(help="Show all violations.")] = False,
    out: Annotated[
        Path | None, output("FILE", "x.csv, the phase at each moment.", otherwise="not written")
    ] = None,
    json: Annotated[bool, arg(help="Print JSON.")] = False,
    trust: Trust = False,
) -> None:
    """Report where a recorded trace follows a behaviour, and where and why it does not.

    Column names are the behaviour's signals, with or without their unit: dtheta_1 or "dtheta_1 [rad/s]".
    Of a run, the trace is a lane's evaluation episode, with --setup, --seed and --which. Where each phase on
    a cycle has a limit, the expected run of the reward form schedule is beside it. Exits 0 if the trace
    follows the behaviour, 1 if it does not, 2 if something cannot be read. For example:

        coachable explain compass-walking log.csv
        coachable explain mine.behaviour log.csv.gz --dt 0.002 --limit 5
        coachable explain mine.behaviour log.parquet --json -o phases.csv
        coachable explain runs/paper --setup orthant --seed 3
        coachable explain mine.behaviour runs/walker2d --setup both --which best
    """
    from rich.console import Console

    from coachable.automata.explanation import as_json, as_text, explain_parts
    from coachable.automata.explanation import explain as watch_trace
    from coachable.behaviours.library import find_behaviour, load_behaviour
    from coachable.rewards.expected_run import ExpectedRunFollower
    from coachable.rewards.expected_run import as_json as run_as_json
    from coachable.rewards.expected_run import as_text as run_as_text

    if out is not None:
        require_suffix(out, (".csv",))
    source = Path(behaviour) if trace is None else trace
    is_run = source.is_dir()
    if trace is None and not is_run:
        raise CoachableError(
            f"{behaviour} is no run folder, so name a TRACE too: explain {behaviour} log.csv"
        )
    if not is_run and (setup is not None or seed is not None or which != "last"):
        raise CoachableError(
            f"--setup, --seed and --which are for a run, and {source} is none; leave them out"
        )
    if is_run and dt is not None:
        raise CoachableError("--dt is for a file without times, and a run has its own; leave it out")
    require_no_input(out, source, *([] if trace is None else [find_behaviour(behaviour)]))
    described = None if trace is None else load_behaviour(behaviour)
    shown = None if all else whole_number(limit, "limit", CoachableError, 0)
    with Console(stderr=True).status("") as status:
        if is_run:
            from coachable.experiments.recorded_episodes import recorded_walk
            from coachable.experiments.run_folder.reader import open_run

            say_imports(trust, source)
            run = open_run(source)
            lane = run.lane(setup, seed)
            walk = recorded_walk(run, lane.setup, lane.seed, which)
            title = f"{source}, {lane.name}, {which} policy,"
            described = described or run.behaviour
            follower = ExpectedRunFollower.of(described)
            parts = [walk.trace] if follower is None else follower.following([walk.trace])
            explanation = explain_parts(described, parts, title, shown, out)
        else:
            described = described or load_behaviour(behaviour)
            follower = ExpectedRunFollower.of(described)
            explanation = watch_trace(
                described,
                source,
                dt,
                shown,
                out,
                lambda report: status.update(f"{report.samples:,} rows, up to t = {report.end:.3f} s"),
                *([] if follower is None else [follower.following]),
            )
    expected = None if follower is None else follower.run()
    if json:
        print_json(
            as_json(explanation) | ({} if expected is None else {"expected_run": run_as_json(expected)})
        )
    else:
        print(as_text(explanation))
        if expected is not None:
            print(run_as_text(expected))
    if not explanation.report.follows:
        sys.exit(1)
