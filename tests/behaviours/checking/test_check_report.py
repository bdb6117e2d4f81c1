"""The report as people and as programs read it."""

import io
import json

import pytest
from rich.console import Console

from coachable.behaviours import Behaviour, Comparison, Edge, Phase, Signal
from coachable.behaviours.checking.check_report import print_report, to_json
from coachable.behaviours.checking.checker import check
from coachable.behaviours.checking.findings import CheckReport, Finding, Subject, Unknown, witness_text

OVERLAPPING = Behaviour(
    "[bold]overlapping",
    "",
    (Signal("x", "m"), Signal("load", "%")),
    (Phase("low", "", Comparison("x", "<", 1)), Phase("high", "", Comparison("x", ">", 0.5))),
    (Edge("low", "high"), Edge("high", "low")),
)
LINES = {("phase", "low"): 7, ("phase", "high"): 8}


def line_of(kind, name):
    return LINES.get((kind, name))


def printed(report, behaviour=OVERLAPPING):
    stream = io.StringIO()
    print_report(report, behaviour, "a.behaviour", line_of, Console(file=stream, width=100))
    return stream.getvalue()


def test_people_read_what_was_proven_where_it_is_what_shows_it_and_what_to_do():
    text = printed(check(OVERLAPPING))
    assert text.startswith("[bold]overlapping   a.behaviour\n")
    assert "2 phases" in text
    assert "error  overlap   a.behaviour:8 (phase high), a.behaviour:7 (phase low)" in text
    assert "for example  x = 0.8 m, load = 0.1 %" in text
    assert "what to do" in text
    assert "note  unused-signal   signal load" in text
    assert "not known" in text
    assert text.endswith("1 error, 0 warnings, 1 note.\n")


def test_a_finding_about_the_whole_file_stands_at_the_file():
    assert "warning  gap   a.behaviour\n" in printed(
        CheckReport.of([Finding("gap", "warning", (), "Some states are outside.", "Name them.")])
    )


def test_programs_read_the_same():
    report = check(OVERLAPPING)
    read = json.loads(json.dumps(to_json(report, OVERLAPPING, "a.behaviour", line_of), allow_nan=False))
    assert set(read) == {"schema", "file", "behaviour", "counts", "findings", "proven", "unknown"}
    assert (read["schema"], read["file"], read["behaviour"]) == (1, "a.behaviour", "[bold]overlapping")
    assert read["counts"] == {"error": 1, "warning": 0, "note": 1}
    overlap = read["findings"][0]
    assert set(overlap) == {"kind", "severity", "subjects", "message", "advice", "witness"}
    assert overlap["subjects"] == [
        {"kind": "phase", "name": "high", "line": 8},
        {"kind": "phase", "name": "low", "line": 7},
    ]
    assert overlap["witness"] == {"x": 0.8, "load": 0.1}
    assert read["findings"][1]["witness"] is None
    assert read["proven"] == list(report.proven)


def test_the_gravest_come_first_and_decide():
    def finding(severity):
        return Finding(severity, severity, (Subject("phase", "low"),), "")

    report = CheckReport.of([finding("note"), finding("warning"), Unknown("why")])
    assert [one.severity for one in report.findings] == ["warning", "note"]
    assert (report.passes(), report.passes(strict=True)) == (True, False)
    assert not CheckReport.of([finding("note"), finding("error")]).passes()
    assert CheckReport.of([finding("note"), Unknown("why")]).passes(strict=True)


def test_a_witness_is_told_in_the_order_and_units_of_the_signals():
    signals = (Signal("b", "rad/s"), Signal("a"))
    assert witness_text({"a": 2.0, "b": -0.1}, signals) == "b = -0.1 rad/s, a = 2"


def test_a_witness_cannot_be_changed():
    finding = Finding("gap", "warning", (), "", witness={"x": 1.0})
    with pytest.raises(TypeError):
        finding.witness["x"] = 2.0
