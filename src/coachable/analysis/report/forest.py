"""Where the dots and bars of the comparisons lie: differences in favour of a claim, zero in the middle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from coachable.analysis.claims import Claim
from coachable.analysis.headlines import paper_advantage, paper_words
from coachable.analysis.sections import IN_UNIT, p_value, with_interval

_MARGIN = 1.08


@dataclass(frozen=True)
class Mark:
    """A comparison on its track, in percent of the track's width."""

    relation: str
    measure: str
    value: float
    low: float | None
    high: float | None
    paper: float | None
    """Where the paper's own difference lies; None if it gives none, or it is beyond the track."""
    words: str
    """The same in words."""


def reach(claims: Sequence[Claim]) -> Mapping[str, float]:
    """For each measure the greatest difference among some claims: what half a track stands for."""
    ends: dict[str, float] = {}
    for claim in claims:
        for comparison in claim.comparisons:
            advantage = comparison.advantage
            known = [abs(x) for x in (advantage.value, advantage.low, advantage.high) if not math.isnan(x)]
            ends[comparison.measure] = max(ends.get(comparison.measure, 0.0), *known, 1e-9)
    return ends


def marks(claim: Claim, half: Mapping[str, float]) -> list[Mark]:
    """The comparisons of a claim as marks."""
    found = []
    for comparison in claim.comparisons:
        scale = half[comparison.measure] * _MARGIN

        def place(value: float | None, scale: float = scale) -> float | None:
            if value is None or math.isnan(value) or abs(value) > scale:
                return None
            return round(50 + 50 * value / scale, 2)

        advantage = comparison.advantage
        unit = "points" if comparison.unit == "%" else comparison.unit
        estimate = with_interval(advantage, IN_UNIT[comparison.unit])
        paper = paper_words(comparison)
        found.append(
            Mark(
                comparison.relation,
                comparison.measure,
                place(advantage.value) or 50.0,
                place(advantage.low),
                place(advantage.high),
                place(paper_advantage(comparison)),
                f"{comparison.measure}, {comparison.relation}: {estimate} {unit} in favour, "
                f"p for {p_value(comparison.p_for)}, against {p_value(comparison.p_against)}"
                + (f"; the paper: {paper}" if paper else ""),
            )
        )
    return found
