"""The table of a study: on the terminal, and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from coachable.analysis.claims import Verdict
from coachable.analysis.measurements import Measurements
from coachable.analysis.sections import PAPER, Section, heading, sections
from coachable.experiments.run_folder.reader import Run
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import write_atomic

COLUMNS = 100
"""Width of the table where nobody says how wide the page is."""

_STYLES: dict[str, str] = {
    Verdict.HOLDS: "bold green",
    Verdict.REVERSED: "bold red",
    Verdict.UNDECIDED: "yellow",
}


def table(runs: Measurements) -> list[RenderableType]:
    """The table as rich renderables, readable in 100 columns."""
    return [Text(heading(runs), style="bold"), *(part for s in sections(runs) for part in rendered(s))]


def print_table(runs: Measurements) -> None:
    """Print the table on the terminal, or 100 columns wide into a file or a pipe."""
    console().print(*table(runs), sep="\n")


def console() -> Console:
    """The terminal, or 100 columns of a file or a pipe."""
    terminal = Console()
    return terminal if terminal.is_terminal else Console(width=COLUMNS)


def markdown(runs: Measurements) -> str:
    """The table as Markdown."""
    return markdown_of(runs, sections(runs))


def markdown_of(runs: Measurements, shown: Sequence[Section]) -> str:
    """`markdown` with sections that are there already."""
    return "\n\n".join([f"# {heading(runs)}", *map(as_markdown, shown)]) + "\n"


def write_markdown(runs: Measurements, folder: Path) -> Path:
    """Write the table as `table.md` into a folder that is there; returns its path."""
    path = folder / "table.md"
    write_atomic(path, markdown(runs))
    return path


def diverged_lanes(run: Run) -> tuple[str, ...]:
    """A sentence on lanes whose training diverged, or on a policy that cannot be read; else nothing."""
    try:
        lanes = ", ".join(lane.name for lane in run.diverged())
    except RunFolderError as error:
        return (str(error),)
    if not lanes:
        return ()
    return (
        f"The training of {lanes} diverged: weights are not finite. Try a smaller learning rate or reward.",
    )


def rendered(section: Section) -> list[RenderableType]:
    """A section as rich renderables: its title, its table, its notes."""
    grid = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for index, name in enumerate(section.header):
        grid.add_column(Text(name), style="dim" if name == PAPER else "", no_wrap=index == 0)
    for row in section.rows:
        grid.add_row(*(Text(cell, style=_STYLES.get(cell, "")) for cell in row))
    # A table's own title would wrap at the table's width.
    title = Text(section.title, style="bold")
    return [title, grid, *(Text(note, style="dim italic") for note in section.notes), Text()]


def as_markdown(section: Section) -> str:
    """A section as Markdown."""
    rows = (section.header, ("---",) * len(section.header), *section.rows)
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n\n".join([f"## {section.title}", "\n".join(lines), *section.notes])
