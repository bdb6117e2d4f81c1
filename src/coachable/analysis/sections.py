"""What a study's table says, section by section, as text that any medium can show."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from coachable.analysis.claims import Claim, decide
from coachable.analysis.intervals import Estimate
from coachable.analysis.measurements import Measurements
from coachable.analysis.measures import Measure
from coachable.analysis.paper import PAPER_BASELINE_DISTANCE, PaperNumbers, paper_numbers
from coachable.analysis.statistics import SetupStatistics, at_the_end, improvements, statistics_of
from coachable.experiments.experiment import Experiment

NOTHING = "–"
PAPER = "paper"
"""Heading of the columns that hold the paper's figures, beside ours."""

SEEDS_TO_DECIDE = 100


@dataclass(frozen=True)
class Section:
    """A titled table of text; the first column names the row."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


def sections(runs: Measurements) -> tuple[Section, ...]:
    """Everything that is reported of a study; beside a baseline also the paper's, and its claims decided."""
    return sections_of(runs, decide(runs) if runs.has_baseline else ())


def sections_of(runs: Measurements, claims: Sequence[Claim]) -> tuple[Section, ...]:
    """`sections` with claims that are decided already."""
    if not runs.has_baseline:
        return (_last_evaluation(runs), _seed_by_seed(runs))
    setups = [statistics_of(runs, setup) for setup in runs.setups]
    return (
        _highest(runs, setups),
        _final(setups),
        _learning(setups),
        _spread_of_highest(setups),
        _spread_of_final(setups),
        _walking_on(setups),
        *_improvements(runs),
        *_claims(runs, claims),
        *_comparisons(claims),
    )


def heading(runs: Measurements) -> str:
    """One line that says what was run."""
    num_runs = runs.setups[0].num_runs
    setups = _count(len(runs.setups), "setup")
    size = f"{setups} × {_count(num_runs, 'seed')} × {runs.steps:,} steps"
    rule = runs.experiment.deterministic[0]
    acting = "" if rule == "clipped-mean" else f", {rule.replace('-', ' ')}"
    if runs.has_baseline:
        return f"{runs.name}: {size}, {runs.semantics} semantics{acting}"
    plan = runs.experiment
    return f"{runs.name}: {plan.problem.robot}, {plan.behaviour.name}, {plan.trainer.name}, {size}{acting}"


def _last_evaluation(runs: Measurements) -> Section:
    measures = runs.evaluated
    rows = []
    for setup in runs.setups:
        rows.append((setup.name, *(in_unit(at_the_end(setup, measure), measure) for measure in measures)))
    return Section(
        "Last evaluation",
        ("setup", *(measure.heading for measure in measures)),
        tuple(rows),
        ("Deterministic episodes; means over seeds with 95 % bootstrap intervals over seeds.",),
    )


def _seed_by_seed(runs: Measurements) -> Section:
    measures = runs.evaluated
    return Section(
        "Last evaluation, seed by seed",
        ("lane", *(measure.heading for measure in measures)),
        tuple(
            (
                f"{setup.name}-{seed}",
                *(in_unit(Estimate(float(setup.last(measure)[row])), measure) for measure in measures),
            )
            for setup in runs.setups
            for row, seed in enumerate(setup.seeds.tolist())
        ),
        ("Means over the evaluation's episodes.",),
    )


def settings(experiment: Experiment) -> tuple[Section, Section]:
    """What each setup pays, and the learner with its settings, as the resolved plan has them."""
    plan = experiment.to_data()
    setups = plan["setups"]
    keys = list(dict.fromkeys(key for values in setups.values() for key in values))
    learner = [("trainer", plan["trainer"])]
    learner += [item for table in experiment.trainer.to_data().values() for item in table.items()]
    return (
        Section(
            "Setups",
            ("setup", *(key.replace("_", " ") for key in keys)),
            tuple(
                (name, *(_plain(values[key]) if key in values else NOTHING for key in keys))
                for name, values in setups.items()
            ),
        ),
        Section("Learner", ("setting", "value"), tuple((name, _plain(value)) for name, value in learner)),
    )


def _plain(value: Any) -> str:
    """A value of a plan as text; a table as its entries."""
    match value:
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:g}"
        case Mapping():
            return ", ".join(f"{key}: {_plain(entry)}" for key, entry in value.items()) or NOTHING
        case list() | tuple():
            return ", ".join(map(_plain, value))
        case _:
            return str(value)


def in_unit(shown: Estimate, measure: Measure) -> str:
    """An estimate of a measure, with its interval, to three digits; shares in percent."""

    def text(value: float) -> str:
        value *= 100 if measure.unit == "%" else 1
        if math.isnan(value):
            return NOTHING
        return (f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}").replace("-", "−")

    return with_interval(shown, text)


def _highest(runs: Measurements, setups: Sequence[SetupStatistics]) -> Section:
    rows = [
        (
            s.name,
            number(s.highest),
            _paper(s.name, lambda p: number(p.highest_distance)),
            with_interval(s.highest_mean),
            with_interval(s.highest_iqm),
            with_interval(s.highest_mean_surviving),
        )
        for s in setups
    ]
    baseline = (
        "virtual gravity",
        number(runs.baseline_distance),
        number(PAPER_BASELINE_DISTANCE),
        "",
        "",
        "",
    )
    notes = [
        "[…]: 95 % bootstrap interval (BCa) over runs. The best run has none: it grows with their number."
    ]
    if runs.semantics == "paper":
        notes.append(
            "Distance is the hip's. The paper's figures are of its released code: the stance foot's."
        )
    else:
        notes.append("Distance is the stance foot's, as in the paper's figures.")
    return _section(
        "Highest walking distance [m]",
        ("setup", "best run", PAPER, "mean", "interquartile mean", "mean, no falls"),
        [*rows, baseline],
        *notes,
    )


def _final(setups: Sequence[SetupStatistics]) -> Section:
    return _section(
        "Walking distance after the last update [m]",
        ("setup", "mean", "interquartile mean", "mean, no falls"),
        [
            (
                s.name,
                with_interval(s.final_mean),
                with_interval(s.final_iqm),
                with_interval(s.final_mean_surviving),
            )
            for s in setups
        ],
    )


def _learning(setups: Sequence[SetupStatistics]) -> Section:
    return _section(
        "Learning: steps until an evaluation passes the baseline's distance; return of the last 50,000 steps",
        ("setup", "first run", PAPER, "runs", "mean steps", "return / baseline's", PAPER),
        [
            (
                s.name,
                steps(s.first_above_baseline),
                _paper(s.name, lambda p: steps(p.first_above_baseline)),
                _of(s.num_above_baseline, s.num_runs),
                with_interval(s.steps_to_baseline, steps),
                with_interval(s.late_return, lambda x: number(x, 3)),
                _paper(s.name, lambda p: number(p.normalised_reward, 3)),
            )
            for s in setups
        ],
        "Mean steps: restricted mean; runs that never pass the baseline count with all their steps.",
    )


def _spread_of_highest(setups: Sequence[SetupStatistics]) -> Section:
    return _section(
        "Standard deviations between runs, of each run's highest values (Table III)",
        ("setup", "return / baseline's", PAPER, "distance [m]", PAPER),
        [
            (
                s.name,
                with_interval(s.highest_return_std, lambda x: number(x, 3)),
                _paper(s.name, lambda p: number(p.reward_std, 3)),
                with_interval(s.highest_std, lambda x: number(x, 3)),
                _paper(s.name, lambda p: number(p.distance_std, 3)),
            )
            for s in setups
        ],
    )


def _spread_of_final(setups: Sequence[SetupStatistics]) -> Section:
    return _section(
        "Standard deviations between runs, of final values",
        ("setup", "return / baseline's", "distance [m]"),
        [
            (
                s.name,
                with_interval(s.final_return_std, lambda x: number(x, 3)),
                with_interval(s.final_std, lambda x: number(x, 3)),
            )
            for s in setups
        ],
    )


def _walking_on(setups: Sequence[SetupStatistics]) -> Section:
    return _section(
        "Final walkers",
        ("setup", "up at 10 s", "up at 100 s", "perturbed starts up [%]", "samples in the cycle [%]"),
        [
            (
                s.name,
                _of(s.num_up_at_end, s.num_runs),
                _of(s.num_up_watched, s.num_runs),
                with_interval(s.perturbed_up, percent),
                with_interval(s.share_in_cycle, percent),
            )
            for s in setups
        ],
        "Perturbed starts: each coordinate of the baseline's state after an impact ±10 %; up for 10 s.",
    )


def _improvements(runs: Measurements) -> list[Section]:
    rows = [
        (
            f"{chance.setup} over {chance.over}",
            with_interval(chance.highest, percent),
            with_interval(chance.final, percent),
        )
        for chance in improvements(runs)
    ]
    title = "Probability of improvement: that a run of the one walks farther than one of the other [%]"
    return [_section(title, ("setups", "highest distance", "final distance"), rows)] if rows else []


def _claims(runs: Measurements, claims: Sequence[Claim]) -> list[Section]:
    if not any(claim.comparisons for claim in claims):
        return []  # the paper claims nothing of these setups
    notes = [
        "p: permutation test (C4: bootstrap-t), two-sided. Holm: corrected for all claims; decided at 0.05."
    ]
    fewest = min(setup.num_runs for setup in runs.setups)
    if fewest < SEEDS_TO_DECIDE:
        notes.append(f"{fewest} runs a setup decide little: such differences often do not replicate.")
    header = ("claim", "says", "p", "Holm", "verdict")
    rows = [
        (
            claim.name,
            claim.statement,
            p_value(claim.p),
            p_value(claim.p_holm),
            f"{claim.verdict}: {claim.reason}" if claim.reason else str(claim.verdict),
        )
        for claim in claims
    ]
    return [_section("Claims", header, rows, *notes)]


def _comparisons(claims: Sequence[Claim]) -> list[Section]:
    rows = [
        (
            claim.name,
            comparison.relation,
            f"{comparison.measure} [{comparison.unit}]",
            with_interval(comparison.advantage, IN_UNIT[comparison.unit]),
            p_value(comparison.p_for),
            p_value(comparison.p_against),
        )
        for claim in claims
        for comparison in claim.comparisons
    ]
    header = ("", "comparison", "of", "in favour by", "p for", "p against")
    note = "One-sided p-values, not corrected. A claim holds if all its comparisons do."
    return [_section("What the claims rest on", header, rows, note)] if rows else []


def number(value: float, digits: int = 2) -> str:
    """A number with this many digits behind the point; a dash if there is none."""
    if math.isnan(value):
        return NOTHING
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def steps(value: float) -> str:
    """A number of training steps, in thousands; ∞ is never."""
    if math.isinf(value):
        return "never"
    text = number(value / 1000, 0)
    return text if text == NOTHING else f"{text}k"


def percent(share: float) -> str:
    """A share in whole percent, without the sign."""
    return number(100 * share, 0)


def p_value(p: float) -> str:
    """A p-value; those below 0.001 are only said to be."""
    return "<0.001" if p < 0.001 else number(p, 3)


def with_interval(estimate: Estimate, text: Callable[[float], str] = number) -> str:
    """An estimate as `value [low, high]`, each end written by `text`; without an interval the value alone."""
    if not estimate.has_interval:
        return text(estimate.value)
    return f"{text(estimate.value)} [{text(estimate.low)}, {text(estimate.high)}]"


IN_UNIT: Mapping[str, Callable[[float], str]] = {"m": number, "steps": steps, "%": percent}


def _of(count: int | None, total: int) -> str:
    return NOTHING if count is None else f"{count} of {total}"


def _count(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def _paper(name: str, text: Callable[[PaperNumbers], str]) -> str:
    return text(paper_numbers()[name]) if name in paper_numbers() else NOTHING


def _section(title: str, header: tuple[str, ...], rows: Sequence[tuple[str, ...]], *notes: str) -> Section:
    """A section, without the paper's columns where the paper has nothing to say."""
    named = {row[0] for row in rows}
    kept = [i for i, column in enumerate(header) if column != PAPER or named & set(paper_numbers())]

    def picked(cells: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(cells[i] for i in kept)

    return Section(title, picked(header), tuple(map(picked, rows)), notes)
