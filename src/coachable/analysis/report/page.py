"""From run folders to one HTML file: gathers the studies, fills the template, locks the page."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from coachable.analysis.headlines import headline, summary
from coachable.analysis.report.forest import marks, reach
from coachable.analysis.report.packing import safe_json
from coachable.analysis.report.provenance import provenance
from coachable.analysis.report.study import Progress, StudyReport, labels, read_study
from coachable.analysis.report.walks import MOST_WALKS
from coachable.analysis.sections import PAPER, heading
from coachable.behaviours.text import to_text
from coachable.diagram.draw import automaton_svg
from coachable.foundation.errors import CoachableError, RunFolderError
from coachable.foundation.files import write_atomic
from coachable.foundation.style import (
    BAD,
    DARK_PAGE,
    FAINT,
    GOOD,
    HAIRLINE,
    INK,
    OUTSIDE,
    PAGE,
    STANCE,
    SWING,
    dimmed,
    on_dark,
    phase_colours,
    setup_colours,
)

_SCRIPTS = ("vendor/uPlot.iife.min.js", "model.js", "charts.js", "draw.js", "stage.js", "seeds.js", "page.js")
_STYLES = ("vendor/uPlot.min.css", "page.css")


def write_report(
    paths: Sequence[Path], out: Path, *, bibtex: str, progress: Progress = lambda doing: None
) -> list[str]:
    """Write the report of some run folders as one HTML file.

    Folders that cannot be read are named in the page, and the others reported.

    **Arguments:** `bibtex`, what to cite; `progress`, which is called with what is under way.

    **Returns:** what could not be read, a sentence each.

    **Raises:** `RunFolderError` if none of the folders can be read.
    """
    studies, problems = read_studies(paths, progress)
    progress(f"{out}: writing")
    write_atomic(out, render(studies, problems, bibtex))
    return [*problems, *(problem for study in studies for problem in study.problems)]


def read_studies(paths: Sequence[Path], progress: Progress) -> tuple[list[StudyReport], list[str]]:
    """The studies in these folders, and for each that cannot be read a sentence that says why.

    **Raises:** `RunFolderError` if none can be read.
    """
    studies, problems = [], []
    for path in paths:
        try:
            study = read_study(path, progress)
            safe_json(study.data(0))  # what the page is made from can be bad, too
            provenance(study)
            studies.append(study)
        except CoachableError as error:
            problems.append(str(error))
        # A folder may hold anything, and whatever is wrong with its numbers is no reason to lose the others.
        except Exception as error:
            problems.append(f"{path} cannot be reported: {type(error).__name__}: {error}")
    if not studies:
        raise RunFolderError("; ".join(problems))
    return [
        replace(study, label=label) for study, label in zip(studies, labels(studies), strict=True)
    ], problems


def render(studies: Sequence[StudyReport], problems: Sequence[str], bibtex: str) -> str:
    """The page of these studies."""
    scripts = [_resource(name) for name in _SCRIPTS]
    data = [study.data(MOST_WALKS // len(studies)) for study in studies]
    template = Environment(
        loader=PackageLoader("coachable.analysis.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    ).get_template("page.html.jinja")
    return template.render(
        policy=_policy(scripts),
        styles=[Markup(_resource(name)) for name in _STYLES],
        palette=Markup(_palette(studies)),
        scripts=[Markup(script) for script in scripts],
        data=Markup(safe_json({"studies": data})),
        studies=studies,
        problems=[*problems, *(problem for study in studies for problem in study.problems)],
        headings=[heading(study.runs) if study.runs else study.run.experiment.name for study in studies],
        summaries=[summary(study.claims) if study.claims else "" for study in studies],
        single=len(studies) == 1 and any(claim.comparisons for claim in studies[0].claims),
        walkers=any(study.draws_walks for study in studies),
        undrawn=[study for study in studies if not study.draws_walks],
        claims=_claims(studies),
        sections=_sections(studies),
        paper_column=PAPER,
        automata={study.label: Markup(automaton_svg(study.run.behaviour)) for study in studies},
        descriptions={study.label: to_text(study.run.behaviour) for study in studies},
        provenances=[provenance(study) for study in studies],
        embedded=[_embedded(study, part) for study, part in zip(studies, data, strict=True)],
        bibtex=bibtex,
    )


def _policy(scripts: Sequence[str]) -> str:
    """A content-security policy under which only the page's own scripts run and nothing is loaded."""
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _palette(studies: Sequence[StudyReport]) -> str:
    """The colours of `coachable.foundation.style` as CSS variables, for the light and for the dark page."""
    setups = list(dict.fromkeys(name for study in studies for name in study.setup_names))
    phases = phase_colours(max(len(study.run.behaviour.phases) for study in studies))[:-1]
    lines = {"stance": STANCE, "swing": SWING, "good": GOOD, "bad": BAD}
    lines |= {f"setup-{place}": colour for place, colour in enumerate(setup_colours(setups).values())}
    areas = {f"phase-{place}": colour for place, colour in enumerate(phases)} | {"outside": OUTSIDE}
    light = {
        "page": PAGE,
        "ink": INK,
        "on-area": INK,
        "faint-mark": FAINT,
        "hairline": HAIRLINE,
        **lines,
        **areas,
    }
    dark = {"page": DARK_PAGE, "on-area": "#111111"}
    dark |= {name: on_dark(colour) for name, colour in lines.items()}
    dark |= {name: dimmed(colour) for name, colour in areas.items()}

    def rules(colours: dict[str, str]) -> str:
        return "".join(f"--{name}:{colour};" for name, colour in colours.items())

    return (
        f":root{{{rules(light)}}}\n"
        f"@media screen and (prefers-color-scheme:dark){{:root:not([data-theme=light]){{{rules(dark)}}}}}\n"
        f"@media screen{{:root[data-theme=dark]{{{rules(dark)}}}}}"
    )


def _claims(studies: Sequence[StudyReport]) -> list[dict[str, Any]]:
    """Each claim with what every complete study says of it."""
    rows = []
    for name in dict.fromkeys(claim.name for study in studies for claim in study.claims):
        asked = [(study, claim) for study in studies for claim in study.claims if claim.name == name]
        half = reach([claim for _, claim in asked])
        answers = [
            {"study": study, "headline": headline(claim), "marks": marks(claim, half)}
            for study, claim in asked
        ]
        rows.append({"name": name, "statement": asked[0][1].statement, "answers": answers})
    return rows


def _sections(studies: Sequence[StudyReport]) -> list[dict[str, Any]]:
    """The tables by title, those of several studies together."""
    titles = dict.fromkeys(section.title for study in studies for section in study.sections)
    return [
        {
            "title": title,
            "tables": [
                {"study": study, "section": section}
                for study in studies
                for section in study.sections
                if section.title == title
            ],
        }
        for title in titles
    ]


def _embedded(study: StudyReport, data: dict[str, Any]) -> str:
    """A sentence on which walks are in the page, if not all are."""
    if not study.draws_walks:
        return ""
    stored = sum(lane["name"] in study.walks for lane in data["lanes"])
    embedded = sum(lane["walk"] is not None for lane in data["lanes"])
    if embedded == stored:
        return ""
    each = embedded // max(1, len(study.setup_names))
    return (
        f"{study.label}: {embedded} of {stored} walks are in this page, {each} of each setup, evenly chosen "
        "by distance, with the farthest and the shortest. Pictures and numbers are of all."
    )


def _resource(name: str) -> str:
    return files("coachable.analysis.report").joinpath(name).read_text(encoding="utf-8")
