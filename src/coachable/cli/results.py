"""What came out of experiments: table, compare, report, cite."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from coachable.cli.options import option
from coachable.foundation.errors import CoachableError


def table(
    run: Annotated[Positional[Path], arg(metavar="RUN", help="A run folder, the --out of train.")],
    out: Annotated[Path | None, option("DIR", "Where to write to.", otherwise="the run folder")] = None,
) -> None:
    """Print a run's table; write it as Markdown, with its figures as SVG and PNG.

    For example:

        coachable table runs/paper
        coachable table runs/paper --out docs/results/paper
    """
    from coachable.analysis.figures import draw_figures
    from coachable.analysis.measurements import measure, measure_so_far
    from coachable.analysis.table import print_table, write_markdown
    from coachable.experiments.run_folder.reader import open_run

    opened = open_run(run)
    # Of a study with claims nothing is decided before it has ended.
    looks_ahead = opened.status != "complete" and opened.baseline is None
    measured = measure_so_far(opened) if looks_ahead else measure(opened)
    if looks_ahead:
        print(f"The run is {opened.status}; this is what there is so far.")
    print_table(measured)
    folder = out or run
    for path in (*draw_figures(measured, folder), write_markdown(measured, folder)):
        print(f"wrote {path}")


def compare(
    run: Annotated[Positional[Path], arg(metavar="RUN", help="A run folder, the --out of train.")],
    other: Annotated[Positional[Path], arg(metavar="RUN", help="Another one, of the same problem.")],
    out: Annotated[Path, arg(aliases=["-o"], metavar="DIR", help="Where to write to.")] = Path("comparison"),
) -> None:
    """Lay the curves of two studies over each other, and test whether their runs differ.

    Studies of one Gymnasium environment without a setup in common are compared setup by setup. What is
    described or paid otherwise in the two is left out, and named.

    For example:

        coachable compare runs/paper runs/sb3 -o runs/paper-and-sb3
        coachable compare runs/walk runs/hop -o runs/walk-and-hop
    """
    from coachable.analysis.comparison import tell_comparison
    from coachable.analysis.measurements import measure
    from coachable.experiments.run_folder.reader import open_run

    studies = {}
    for path in (run, other):
        opened = open_run(path)
        title = f"{opened.experiment.name}, {opened.experiment.trainer.name}"
        studies[title if title not in studies else f"{title}, {path.name}"] = measure(opened)
    tell_comparison(studies, out)


def report(
    runs: Annotated[
        Positional[tuple[Path, ...]],
        arg(metavar="RUN [RUN …]", help="Run folders, the --out of train.", help_behavior_hint=""),
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

    The page needs no network and nothing beside it. Of a Gymnasium environment it shows the description, the
    curves of every measure, every seed and the gaits, and says why there is no walker. Of a study that is
    under way it tells what there is; a folder that cannot be read is named, and the others are reported.

    For example:

        coachable report runs/paper
        coachable report runs/paper runs/released -o both.html
        coachable report runs/walker2d
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
