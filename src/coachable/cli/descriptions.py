"""Work with descriptions: check, format, explain."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from coachable.cli.options import json_text, option
from coachable.errors import CoachableError


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
        print(json_text(to_json(report, document.behaviour, str(file), document.line_of)))
    else:
        print_report(report, document.behaviour, str(file), document.line_of, Console(highlight=False))
    if not report.passes(strict):
        sys.exit(1)


def format(
    files: Annotated[
        Positional[tuple[Path, ...]], arg(metavar="FILE", help="Files that describe behaviours.")
    ],
    check: Annotated[bool, arg(help="Change nothing; exit 1 if a file is not formatted.")] = False,
) -> None:
    """Lay out behaviour files in the one way: indented, aligned, comments kept.

    A file with a mistake in it is left as it is, and the mistake told. For example:

        coachable format walk.behaviour
        coachable format --check *.behaviour
    """
    from coachable.behaviours.document import formatted_file
    from coachable.studies.files import replace_text

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
        float | None, option("SECONDS", "Time between two rows.", otherwise="the column t or time")
    ] = None,
    limit: Annotated[int, arg(metavar="N", help="How many violations to show.")] = 20,
    all: Annotated[bool, arg(help="Show all violations.")] = False,
    phases: Annotated[
        Path | None, option("OUT.csv", "Write the phase at each moment there.", otherwise="do not")
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
    print(json_text(as_json(explanation)) if json else as_text(explanation))
    if not explanation.report.follows:
        sys.exit(1)
