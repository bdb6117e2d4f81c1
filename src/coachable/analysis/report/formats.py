"""What a report can be written as: a page, Markdown, or figures for a paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from coachable.analysis.figures import figures
from coachable.analysis.report.page import read_studies, write_report
from coachable.analysis.report.study import Progress, StudyReport
from coachable.analysis.table import markdown_of
from coachable.foundation.files import make_folder, write_atomic
from coachable.foundation.style import save

Format = Literal["html", "md", "pdf-figures"]

_NAMES: dict[Format, str] = {"html": "report.html", "md": "report.md", "pdf-figures": "figures"}


def write(
    paths: Sequence[Path], out: Path | None, format: Format, *, bibtex: str, progress: Progress
) -> tuple[list[Path], list[str]]:
    """Write the report of some run folders.

    **Arguments:** `out`, a file, or for figures a folder; without it, a name for the format in the only run
    folder, or in the working directory.

    **Returns:** what was written, and what could not be read, a sentence each.

    **Raises:** `RunFolderError` if none of the folders can be read.
    """
    given, out = out, out or (paths[0] if len(paths) == 1 else Path()) / _NAMES[format]
    if format == "html":
        return [out], write_report(paths, out, bibtex=bibtex, progress=progress)
    studies, problems = read_studies(paths, progress)
    progress(f"{out}: writing")
    problems = [*problems, *(problem for study in studies for problem in study.problems)]
    if format == "md":
        write_atomic(out, "\n".join(map(_markdown, studies)))
        return [out], problems
    if given is None:
        make_folder(out.parent, out.name)
    return [path for study in studies for path in _draw(study, out, progress, len(studies) > 1)], problems


def _markdown(study: StudyReport) -> str:
    if study.runs is None or not study.sections:
        return f"# {study.label}\n\n{study.standing or 'Nothing could be measured.'}\n"
    return markdown_of(study.runs, study.sections)


def _draw(study: StudyReport, folder: Path, progress: Progress, several: bool) -> list[Path]:
    """The figures of a study as PDF, in a folder of their own if there are several studies."""
    if study.runs is None:
        return []
    folder = folder / study.label.replace(" ", "-").replace("/", "-") if several else folder
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in figures(study.runs, study.claims).items():
        progress(f"{folder}: {name}")
        paths.append(folder / f"{name}.pdf")
        save(figure, paths[-1])
    return paths
