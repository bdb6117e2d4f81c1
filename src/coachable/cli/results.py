"""What came out of experiments: table, compare, report, cite."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from coachable.cli.options import (
    DeterministicRule,
    Json,
    RunFolder,
    Trust,
    option,
    output,
    print_json,
    refuse_out_with_json,
    require_folder,
    require_suffix,
    say_imports,
)
from coachable.foundation.errors import CoachableError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from coachable.analysis.report.formats import Format
    from coachable.envs.squashing import Deterministic


def table(
    run: RunFolder,
    out: Annotated[
        Path | None, output("DIR", "Where the table and the figures go.", otherwise="the run folder")
    ] = None,
    setups: Annotated[
        tuple[str, ...] | None, option("NAME [NAME …]", "Only these setups.", otherwise="all")
    ] = None,
    deterministic: DeterministicRule = None,
    json: Json = False,
    trust: Trust = False,
) -> None:
    """Print a run's table; write it as Markdown, with its figures as SVG and PNG.

    For example:

        coachable table runs/paper
        coachable table runs/paper -o docs/results/paper
        coachable table runs/paper --setups sparse orthant -o two
        coachable table runs/beyond-paper --deterministic clipped-mean -o clipped
        coachable table runs/paper --json
    """
    say_imports(trust, run)
    if json:
        from coachable.analysis.numbers import table_numbers
        from coachable.experiments.run_folder.reader import open_run

        refuse_out_with_json(out)
        if setups is not None:
            raise CoachableError("--json is of all setups; leave out --setups")
        print_json(table_numbers(open_run(run), deterministic))
        return
    require_folder(out)
    if setups is not None and out is None:
        raise CoachableError(f"{run} keeps the table of all setups; say with -o where that of some goes")
    show_table(run, out or run, deterministic, setups)


def show_table(
    run: Path,
    folder: Path,
    deterministic: Deterministic | None = None,
    setups: Sequence[str] | None = None,
) -> None:
    """Print a run's table, and write it with its figures into a folder.

    **Arguments:** `deterministic`, by which of its rules the policies act, by default the first; `setups`,
    the only ones that are shown.
    """
    from coachable.analysis.figures import draw_figures
    from coachable.analysis.measurements import measure, measure_so_far
    from coachable.analysis.table import diverged_lanes, print_table, write_markdown
    from coachable.experiments.run_folder.reader import open_run

    opened = open_run(run)
    # Of a study with claims nothing is decided before it has ended.
    looks_ahead = opened.status != "complete" and opened.baseline is None
    measured = measure_so_far(opened) if looks_ahead else measure(opened, deterministic)
    if looks_ahead:
        print(f"The run is {opened.status}; this is what there is so far.")
    others = []
    if deterministic is None and not looks_ahead:
        others = [measure(opened, rule) for rule in opened.experiment.deterministic[1:]]
    if setups is not None:
        measured, *others = (runs.of_setups(setups) for runs in (measured, *others))
    print_table(measured)
    for sentence in diverged_lanes(opened):
        print(sentence)
    for path in (*draw_figures(measured, folder, others), write_markdown(measured, folder)):
        print(f"wrote {path}")


def compare(
    run: RunFolder,
    other: Annotated[Positional[Path], arg(metavar="RUN", help="Another one, of the same problem.")],
    out: Annotated[
        Path | None, output("DIR", "Where the table and the figures go.", otherwise="comparison")
    ] = None,
    json: Json = False,
    trust: Trust = False,
) -> None:
    """Lay the curves of two studies over each other, and test whether their runs differ.

    Studies of one Gymnasium environment without a setup in common are compared setup by setup. What is
    described or paid otherwise in the two is left out, and named.

    For example:

        coachable compare runs/paper runs/sb3 -o runs/paper-and-sb3
        coachable compare runs/walk runs/hop -o runs/walk-and-hop
        coachable compare runs/paper runs/sb3 --json
    """
    from coachable.analysis.comparison import write_comparison
    from coachable.analysis.measurements import measure
    from coachable.experiments.run_folder.reader import open_run

    if json:
        refuse_out_with_json(out)
    require_folder(out)
    say_imports(trust, run, other)
    studies = {}
    for path in (run, other):
        opened = open_run(path)
        title = f"{opened.experiment.name}, {opened.experiment.trainer.name}"
        studies[title if title not in studies else f"{title}, {path.name}"] = measure(opened)
    if json:
        from coachable.analysis.numbers import comparison_numbers

        print_json(comparison_numbers(studies))
        return
    write_comparison(studies, out or Path("comparison"))


def report(
    runs: Annotated[
        Positional[tuple[Path, ...]],
        arg(metavar="RUN [RUN …]", help="Run folders, the --out of train.", help_behavior_hint=""),
    ],
    out: Annotated[
        Path | None,
        output(
            "FILE|DIR",
            "x.html, one page; x.md, the tables as Markdown; or a folder, into which the figures go as PDF "
            "for a two-column paper.",
            otherwise="report.html, in the run folder or, of several, here",
        ),
    ] = None,
    trust: Trust = False,
) -> None:
    """Write one HTML page that shows what was learned: claims, curves, walkers, every seed, and the numbers.

    The page needs no network and nothing beside it. Of a Gymnasium environment it shows the description, the
    curves of every measure, every seed and the gaits, and says why there is no walker. Of a study that is
    under way it shows what there is; a folder that cannot be read is named, and the others are reported.

    For example:

        coachable report runs/paper
        coachable report runs/paper runs/released -o both.html
        coachable report runs/walker2d
        coachable report runs/paper -o paper.md
        coachable report runs/paper -o figures/
    """
    if not runs:
        raise CoachableError("give at least one RUN: coachable report runs/paper")
    format = _format(out)
    say_imports(trust, *runs)
    from rich.console import Console
    from rich.markup import escape

    from coachable.analysis.citation import citation
    from coachable.analysis.report.formats import write

    console = Console(stderr=True)
    with console.status("reading") as status:
        written, problems = write(
            runs, out, format, bibtex=citation(), progress=lambda doing: status.update(escape(doing))
        )
    for path in written:
        print(f"wrote {path}")
    for problem in problems:
        print(f"coachable: not in the report: {problem}", file=sys.stderr)


def _format(out: Path | None) -> Format:
    """What a report is written as, by its output.

    **Raises:** `CoachableError` for a file of another suffix.
    """
    if out is None:
        return "html"
    if out.is_dir() or not out.suffix:
        return "pdf-figures"
    suffix = require_suffix(out, (".html", ".md"), or_else=", or a folder for the figures as PDF")
    return "html" if suffix == ".html" else "md"


def cite() -> None:
    """Print what to cite, as BibTeX.

    For example:

        coachable cite >> references.bib
    """
    from coachable.analysis.citation import citation

    print(citation(), end="")
