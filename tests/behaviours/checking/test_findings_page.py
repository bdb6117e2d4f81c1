"""docs/findings.md: every example gives the finding it stands under, in the words below it."""

import re
from pathlib import Path

import pytest

from coachable.behaviours.checking.checker import check
from coachable.behaviours.checking.findings import witness_text
from coachable.behaviours.text.parser import parse
from coachable.rewards.audit import left_open

PACKAGE = Path(__file__).parents[3] / "src" / "coachable"
PAGE = (Path(__file__).parents[3] / "docs" / "findings.md").read_text(encoding="utf-8")
SECTIONS = re.findall(
    r"^## `([a-z-]+)`: (\w+)\n.*?```behaviour\n(.*?)```\n\n```text\n(.*?)```", PAGE, re.DOTALL | re.MULTILINE
)


@pytest.mark.parametrize(("kind", "severity", "text", "words"), SECTIONS, ids=[case[0] for case in SECTIONS])
def test_an_example_gives_its_finding_in_these_words(kind, severity, text, words):
    behaviour = parse(text)
    findings = [*check(behaviour).findings, *left_open(behaviour)]
    finding = next(finding for finding in findings if finding.kind == kind)
    said = [finding.message]
    if finding.witness is not None:
        said.append(f"for example {witness_text(finding.witness, behaviour.signals)}")
    said.append(f"what to do: {finding.advice}")
    assert finding.severity == severity
    assert " ".join(words.split()) == " ".join(said)


def test_every_finding_has_a_section():
    kinds = {
        kind
        for path in (
            *PACKAGE.joinpath("behaviours", "checking").glob("*.py"),
            PACKAGE / "rewards" / "audit.py",
        )
        for kind in re.findall(
            r'Finding\(\s*"([a-z-]+)",\s*"(?:error|warning|note)"', path.read_text(encoding="utf-8")
        )
    }
    assert kinds == {section[0] for section in SECTIONS}
