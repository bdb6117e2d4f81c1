import numpy as np
import pytest

from coachable.analysis import claims, significance
from coachable.analysis.claims import Verdict, decide
from coachable.analysis.headlines import headline
from coachable.analysis.intervals import Estimate
from coachable.analysis.measurements import measure_tables
from coachable.analysis.significance import holm

RUNS = 30

pytestmark = pytest.mark.usefixtures("quick")


def as_claimed(rng):
    """Runs of which every claim is plainly true."""

    def runs(highest, spread, passes_at, final, up, perturbed):
        passes = passes_at + rng.integers(-2, 3, RUNS) * 10_000
        return {
            "highest": highest + rng.normal(0, spread, RUNS),
            "final": final + rng.normal(0, 0.3, RUNS),
            "passes_at": passes,
            "seconds_up": np.where(rng.random(RUNS) < up, 100.0, 50.0),
            "perturbed_up": np.clip(perturbed + rng.normal(0, 0.05, RUNS), 0, 1),
        }

    return {
        "sparse": runs(8.0, 0.5, 400_000, 5.0, 0.2, 0.3),
        "forward": runs(8.5, 0.5, 250_000, 7.0, 0.2, 0.3),
        "orthant": runs(8.6, 0.05, 250_000, 7.0, 1.0, 0.9),
        "forward_orthant": runs(9.5, 0.5, 100_000, 7.0, 0.2, 0.3),
    }


def verdicts(runs):
    return {claim.name: claim.verdict for claim in decide(runs)}


def test_what_is_plainly_so_holds(measured):
    assert set(verdicts(measured(**as_claimed(np.random.default_rng(0)))).values()) == {Verdict.HOLDS}


def test_what_is_plainly_the_other_way_is_reversed(measured):
    rng = np.random.default_rng(1)
    true = as_claimed(rng)
    swapped = {**true, "sparse": true["forward_orthant"], "forward_orthant": true["sparse"]}
    swapped["sparse"] = swapped["sparse"] | {"final": 9 + rng.normal(0, 0.3, RUNS)}
    swapped["orthant"] = swapped["orthant"] | {
        "highest": 12 + rng.normal(0, 3, RUNS),
        "seconds_up": np.full(RUNS, 20.0),
        "perturbed_up": np.full(RUNS, 0.1),
    }
    for name in ("sparse", "forward", "forward_orthant"):
        swapped[name] = swapped[name] | {"seconds_up": np.full(RUNS, 100.0)}
    found = verdicts(measured(**swapped))
    assert [found[name] for name in ("C1", "C2", "C3", "C5", "C6")] == [Verdict.REVERSED] * 5


def test_below_the_baseline_is_reversed_and_one_of_three_above_is_not_enough(measured):
    rng = np.random.default_rng(2)
    low = {name: {"highest": rng.normal(5, 0.5, RUNS)} for name in as_claimed(rng)}
    assert verdicts(measured(**low))["C4"] == Verdict.REVERSED
    mixed = low | {"orthant": {"highest": rng.normal(9, 0.5, RUNS)}}
    assert verdicts(measured(**mixed))["C4"] == Verdict.UNDECIDED


def test_a_claim_with_one_comparison_against_it_is_undecided(measured):
    rng = np.random.default_rng(3)
    runs = as_claimed(rng)
    runs["forward"]["final"] = 3 + rng.normal(0, 0.3, RUNS)
    (c1,) = (claim for claim in decide(measured(**runs)) if claim.name == "C1")
    assert c1.verdict == Verdict.UNDECIDED
    against = [c.relation for c in c1.comparisons if c.p_against < 0.002]
    assert against == ["sparse < forward"]


def test_an_advantage_is_in_favour_of_the_claim_and_p_the_largest(measured):
    decided = decide(measured(**as_claimed(np.random.default_rng(4))))
    for claim in decided:
        assert all(comparison.advantage.low > 0 for comparison in claim.comparisons)
        assert claim.p == 2 * max(comparison.p_for for comparison in claim.comparisons)
    assert [claim.p_holm for claim in decided] == pytest.approx(holm([claim.p for claim in decided]))


def test_noise_of_fifteen_runs_decides_nothing(measured, monkeypatch):
    monkeypatch.setattr(significance, "RESAMPLES", 199)
    monkeypatch.setattr(claims, "estimate", lambda *_: Estimate(0.0))
    rng = np.random.default_rng(5)
    studies = 40
    wrong = 0
    for _ in range(studies):
        runs = {
            name: {
                "highest": rng.normal(7, 1, 15),
                "final": rng.normal(7, 1, 15),
                "passes_at": rng.integers(10, 40, 15) * 10_000,
                "seconds_up": rng.choice([50.0, 100.0], 15),
                "perturbed_up": rng.uniform(size=15),
            }
            for name in ("sparse", "forward", "orthant", "forward_orthant")
        }
        wrong += set(verdicts(measured(**runs)).values()) != {Verdict.UNDECIDED}
    assert wrong <= 5  # at most one study in twenty, and chance


def test_holm_counts_the_applicable_claims_only(measured):
    runs = as_claimed(np.random.default_rng(6))
    for given in runs.values():
        given["seconds_up"] = np.full(RUNS, np.nan)
    decided = decide(measured(**runs))
    assert decided[5].verdict == Verdict.NOT_APPLICABLE
    assert "100 s" in decided[5].reason
    assert [claim.p_holm for claim in decided[:5]] == pytest.approx(holm([claim.p for claim in decided[:5]]))
    assert np.isnan(decided[5].p_holm)


def test_claims_about_absent_setups_are_not_applicable_and_say_which(tables):
    decided = decide(measure_tables(*tables(("sparse", "mine"))))
    assert {claim.verdict for claim in decided} == {Verdict.NOT_APPLICABLE}
    assert decided[0].reason == "no setup forward, orthant, forward+orthant"


def test_one_run_a_setup_decides_nothing(tables):
    decided = decide(measure_tables(*tables(num_seeds=1)))
    assert {claim.reason for claim in decided} == {"only one run of sparse", "only one run of forward"}


def test_the_order_of_the_seeds_does_not_matter(measured):
    rng = np.random.default_rng(7)
    runs = as_claimed(rng)
    order = rng.permutation(RUNS)
    shuffled = {name: {key: value[order] for key, value in given.items()} for name, given in runs.items()}
    assert decide(measured(**runs)) == decide(measured(**shuffled))


def described(rng, subjects=("description-alone", "schedule"), ahead=True):
    """A study of the description and its rivals; the subjects are plainly ahead of all, or behind."""

    def runs(far):
        return {
            "highest": rng.normal(9, 0.3, RUNS),
            "final": rng.normal(11 if far else 8, 0.1 if far else 1.0, RUNS),
            "passes_at": (100_000 if far else 250_000) + rng.integers(-2, 3, RUNS) * 10_000,
            "seconds_up": np.where(rng.random(RUNS) < (1.0 if far else 0.3), 100.0, 50.0),
            "perturbed_up": np.clip((0.95 if far else 0.4) + rng.normal(0, 0.02, RUNS), 0, 1),
        }

    names = ("description-alone", "schedule", *claims.OTHERS)
    return {name: runs((name in subjects) == ahead) for name in names}


def test_a_study_of_a_description_is_asked_what_is_said_of_descriptions(measured):
    found = verdicts(measured(**described(np.random.default_rng(8))))
    assert found == dict.fromkeys(("S1", "S2", "S3", "S4", "S5", "S6"), Verdict.HOLDS)
    behind = verdicts(measured(**described(np.random.default_rng(9), ahead=False)))
    assert set(behind.values()) == {Verdict.REVERSED}


def test_with_the_distance_term_is_a_claim_of_its_own(measured):
    runs = described(np.random.default_rng(10), subjects=("description-alone",))
    found = verdicts(measured(**runs))
    assert [found[f"S{k}"] for k in range(1, 6)] == [Verdict.HOLDS] * 5
    assert found["S6"] != Verdict.HOLDS
    (s6,) = (claim for claim in decide(measured(**runs)) if claim.name == "S6")
    assert len(s6.comparisons) == 5 * len(claims.OTHERS)
    (sentence,) = (headline(claim).sentence for claim in decide(measured(**runs)) if claim.name == "S1")
    assert "the paper" not in sentence
