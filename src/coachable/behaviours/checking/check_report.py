"""A checker's report as text for the terminal, and as JSON."""

from __future__ import annotations

import typing
from collections.abc import Callable

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.checking.findings import SCHEMA, SEVERITIES, CheckReport, Subject, witness_text

LineOf = Callable[[str, str], int | None]
"""From the kind and the name of a declaration to its line in the file, if it has one."""

_STYLES = {"error": "bold red", "warning": "bold yellow", "note": "bold cyan"}


def print_report(
    report: CheckReport, behaviour: Behaviour, file: str, line_of: LineOf, console: Console
) -> None:
    """Print the proven clauses, then each finding with its place, witness and advice, then the counts."""
    console.print(Text.assemble((behaviour.name, "bold"), f"   {file}"), soft_wrap=True)
    console.print(_rows([("proven", ", ".join(report.proven))]))
    for finding in report.findings:
        places = ", ".join(_place(subject, file, line_of) for subject in finding.subjects) or file
        style = _STYLES[finding.severity]
        console.print()
        title = Text.assemble((finding.severity, style), f"  {finding.kind}   ", (places, "dim"))
        console.print(title, soft_wrap=True)
        console.print(Padding(Text(finding.message), (0, 0, 0, 2)))
        rows = []
        if finding.witness is not None:
            rows.append(("for example", witness_text(finding.witness, behaviour.signals)))
        rows.append(("what to do", finding.advice))
        console.print(_rows(rows))
    if report.unknown:
        console.print()
        console.print(_rows([("not known", question) for question in report.unknown]))
    console.print()
    console.print(Text(_sum(report)))


def to_json(report: CheckReport, behaviour: Behaviour, file: str, line_of: LineOf) -> dict[str, typing.Any]:
    """The report as JSON values, with the fields that docs/findings.md lists."""
    return {
        "schema": SCHEMA,
        "file": file,
        "behaviour": behaviour.name,
        "counts": {severity: report.count(severity) for severity in SEVERITIES},
        "findings": [
            {
                "kind": finding.kind,
                "severity": finding.severity,
                "subjects": [
                    {
                        "kind": subject.kind,
                        "name": subject.name,
                        "line": line_of(subject.kind, subject.name),
                    }
                    for subject in finding.subjects
                ],
                "message": finding.message,
                "advice": finding.advice,
                "witness": None if finding.witness is None else dict(finding.witness),
            }
            for finding in report.findings
        ],
        "proven": list(report.proven),
        "unknown": list(report.unknown),
    }


def _place(subject: Subject, file: str, line_of: LineOf) -> str:
    line = line_of(subject.kind, subject.name)
    return str(subject) if line is None else f"{file}:{line} ({subject})"


def _rows(rows: list[tuple[str, str]]) -> Padding:
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim", no_wrap=True, min_width=11)
    table.add_column(overflow="fold")
    for label, text in rows:
        table.add_row(Text(label), Text(text))
    return Padding(table, (0, 0, 0, 2))


def _sum(report: CheckReport) -> str:
    counts = [(report.count(severity), severity) for severity in SEVERITIES]
    return ", ".join(f"{count} {word}" + ("" if count == 1 else "s") for count, word in counts) + "."
