"""Results of the checker: findings, each with a witness where there is one, and proven clauses."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from coachable.behaviours.predicates import Signal

Severity = typing.Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
"""Gravest first: the description contradicts itself; it is probably incomplete; it could be tidier."""

SCHEMA = 1
"""The version of the output of `coachable check --json`; it changes when a field changes its meaning."""


@dataclass(frozen=True)
class Subject:
    """The part of a file that a finding is about: a `kind` such as "phase", and a `name`."""

    kind: str
    name: str

    def __str__(self) -> str:
        return f"{self.kind} {self.name}"


@dataclass(frozen=True)
class Finding:
    """A probable error in a behaviour.

    **Arguments:** `kind`, a short name that never changes; `severity`; `subjects`, what it is about, the
    main one first, none if it is about the whole behaviour; `message` and `advice`, the problem and its
    remedy in words; `witness`, a state that shows it, signal → value in the signal's unit.
    """

    kind: str
    severity: Severity
    subjects: tuple[Subject, ...]
    message: str
    advice: str = ""
    witness: Mapping[str, float] | None = None

    def __post_init__(self):
        if self.witness is not None:
            object.__setattr__(self, "witness", MappingProxyType(dict(self.witness)))


@dataclass(frozen=True)
class Proven:
    """A short clause that was proven, such as "pairwise disjoint"."""

    clause: str


@dataclass(frozen=True)
class Unknown:
    """A question that was left without an answer, such as "whether O1 and O2 overlap"."""

    question: str


Result = Finding | Proven | Unknown


@dataclass(frozen=True)
class CheckReport:
    """All results for a behaviour: `findings`, gravest first, `proven` clauses and `unknown` questions."""

    findings: tuple[Finding, ...]
    proven: tuple[str, ...]
    unknown: tuple[str, ...]

    @staticmethod
    def of(results: Iterable[Result]) -> CheckReport:
        """Sorts results into a report; findings of one severity keep their order."""
        results = tuple(results)
        findings = [result for result in results if isinstance(result, Finding)]
        return CheckReport(
            tuple(sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))),
            tuple(result.clause for result in results if isinstance(result, Proven)),
            tuple(result.question for result in results if isinstance(result, Unknown)),
        )

    def joined(self, findings: Iterable[Finding]) -> CheckReport:
        """This report with further findings, gravest first."""
        return CheckReport.of(
            [*self.findings, *findings, *map(Proven, self.proven), *map(Unknown, self.unknown)]
        )

    def count(self, severity: Severity) -> int:
        """How many findings have this severity."""
        return sum(finding.severity == severity for finding in self.findings)

    def passes(self, strict: bool = False) -> bool:
        """Whether there are no errors; if `strict`, no warnings either."""
        return self.count("error") == 0 and not (strict and self.count("warning"))


def witness_text(witness: Mapping[str, float], signals: Iterable[Signal]) -> str:
    """`theta_1 = 0.1 rad, theta_2 = -0.1 rad`, in the order of the signals."""
    units = {signal.name: signal.unit for signal in signals}
    return ", ".join(
        f"{name} = {repr(value).removesuffix('.0')}" + (f" {units[name]}" if units[name] else "")
        for name, value in sorted(witness.items(), key=lambda item: list(units).index(item[0]))
    )
