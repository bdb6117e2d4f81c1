"""Each claim in one line: its verdict, the number that it rests on, and what the paper has for that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from coachable.analysis.claims import Claim, Comparison, Verdict
from coachable.analysis.paper import PAPER_BASELINE_DISTANCE, PaperNumbers, paper_numbers
from coachable.analysis.sections import IN_UNIT, p_value, with_interval

BASELINE = "baseline"
_WORDS = {Verdict.REVERSED: "does not hold"}
_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")
_OF_ALL_RUNS = "best of its 15 runs"


@dataclass(frozen=True)
class Headline:
    """A claim as people read it."""

    claim: Claim
    verdict: str
    """`holds`, `does not hold`, `undecided` or `not applicable`."""
    deciding: Comparison | None
    """The comparison that speaks least for the claim, on which it therefore rests; None if there is none."""
    statistic: str
    """That comparison's difference in favour of the claim, with its interval and its p-value."""
    paper: str
    """The paper's own figures for that comparison; empty where it says nothing of such a setup."""

    @property
    def sentence(self) -> str:
        """All of it in one sentence."""
        claim = f"{self.claim.name} {self.verdict}: {self.claim.statement}"
        if self.deciding is None:
            return f"{claim} ({self.claim.reason})."
        paper = f"; the paper: {self.paper}" if self.paper else ""
        return f"{claim}; {self.statistic}{paper}."


def headline(claim: Claim) -> Headline:
    """The headline of a claim."""
    verdict = _WORDS.get(claim.verdict, str(claim.verdict))
    if not claim.comparisons:
        return Headline(claim, verdict, None, claim.reason, "")
    deciding = max(claim.comparisons, key=lambda comparison: comparison.p_for)
    return Headline(claim, verdict, deciding, statistic(deciding), paper_words(deciding))


def statistic(comparison: Comparison) -> str:
    """How much a comparison speaks for its claim: `final distance, sparse < forward: 0.62 m …`."""
    unit = " m" if comparison.unit == "m" else " points" if comparison.unit == "%" else " steps"
    text = IN_UNIT[comparison.unit]
    value, _, interval = with_interval(comparison.advantage, text).partition(" ")
    parts = [f"{comparison.measure}, {comparison.relation}: {value}{unit}", interval, "in favour"]
    return " ".join(filter(None, parts)) + f", p\u00a0{_equals(p_value(comparison.p_for))}"


def paper_words(comparison: Comparison) -> str:
    """What the paper has for the two sides of a comparison, and which of its figures that is.

    Empty for setups that are not the paper's.
    """
    subject, relation, other = comparison.relation.split()
    if subject not in paper_numbers():
        return ""
    figure = _FIGURES.get(comparison.measure)
    if figure is None:
        return "gives no such figure"
    values = [_paper_value(figure, name) for name in (subject, other)]
    texts = [IN_UNIT[comparison.unit](value) for value in values]
    unit = " m" if comparison.unit == "m" else ""
    same = (values[0] < values[1]) == (relation == "<") and values[0] != values[1]
    return f"{texts[0]} against {texts[1]}{unit}{figure.note}{'' if same else ', the other way'}"


def paper_advantage(comparison: Comparison) -> float | None:
    """The same as a difference in favour of the claim; None if the paper gives no finite figures."""
    subject, relation, other = comparison.relation.split()
    figure = _FIGURES.get(comparison.measure)
    if figure is None or subject not in paper_numbers():
        return None
    ours, theirs = (_paper_value(figure, name) for name in (subject, other))
    difference = ours - theirs if relation == ">" else theirs - ours
    return difference if abs(difference) != float("inf") else None


def summary(claims: Sequence[Claim]) -> str:
    """How many claims hold, do not, and are undecided: `Of six claims, one holds, five are undecided`."""
    counts = {verdict: sum(claim.verdict is verdict for claim in claims) for verdict in Verdict}
    forms = (
        (Verdict.HOLDS, "holds", "hold"),
        (Verdict.REVERSED, "does not hold", "do not hold"),
        (Verdict.UNDECIDED, "is undecided", "are undecided"),
        (Verdict.NOT_APPLICABLE, "is not applicable", "are not applicable"),
    )
    parts = [f"{_COUNTS[n]} {one if n == 1 else many}" for v, one, many in forms if (n := counts[v])]
    total = _COUNTS[len(claims)]
    if counts[Verdict.NOT_APPLICABLE] == len(claims):
        return f"None of the {total} claims can be decided here"
    if len(parts) == 1 and len(claims) > 1:
        return f"All {total} claims {parts[0].partition(' ')[2]}"
    return f"Of {total} claims, {', '.join(parts)}"


@dataclass(frozen=True)
class _PaperFigure:
    of: Callable[[PaperNumbers], float]
    note: str
    baseline: float


# The paper gives no mean over runs: the nearest thing it has is its best run.
_HIGHEST = _PaperFigure(lambda paper: paper.highest_distance, f" ({_OF_ALL_RUNS})", PAPER_BASELINE_DISTANCE)
_FIGURES = {
    "final distance": _HIGHEST,
    "highest distance": _HIGHEST,
    "to baseline": _PaperFigure(
        lambda paper: paper.first_above_baseline, " (the first of its 15 runs)", float("nan")
    ),
    "std of highest": _PaperFigure(lambda paper: paper.distance_std, "", float("nan")),
}


def _paper_value(figure: _PaperFigure, name: str) -> float:
    return figure.baseline if name == BASELINE else figure.of(paper_numbers()[name])


def _equals(p: str) -> str:
    return p if p.startswith("<") else f"=\u00a0{p}"
