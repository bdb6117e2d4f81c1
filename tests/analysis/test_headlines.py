"""Headlines say what the claims say, and beside it the paper's own figures."""

import numpy as np
import pytest

from coachable.analysis.claims import Verdict, decide
from coachable.analysis.headlines import headline, paper_advantage, summary
from coachable.analysis.measurements import measure_tables
from coachable.analysis.paper import PAPER_BASELINE_DISTANCE, paper_numbers

pytestmark = pytest.mark.usefixtures("quick")


@pytest.fixture(scope="module")
def claims(measured, quick):
    """Sparse is far below the rest at the end, and orthant falls more than each other one."""
    rng = np.random.default_rng(0)

    def runs(final, up):
        return {
            "highest": rng.normal(9, 0.3, 20),
            "final": rng.normal(final, 0.3, 20),
            "seconds_up": np.where(rng.random(20) < up, 100.0, 10.0),
            "perturbed_up": rng.normal(up, 0.02, 20),
        }

    study = measured(
        sparse=runs(4, 0.95), forward=runs(8, 0.95), orthant=runs(8, 0.05), forward_orthant=runs(8, 0.95)
    )
    return {claim.name: claim for claim in decide(study)}


def test_the_verdict_is_the_claim_s_in_words(claims):
    words = {"C1": "holds", "C6": "does not hold"}
    for name, claim in claims.items():
        said = headline(claim)
        if claim.verdict is Verdict.UNDECIDED:
            assert said.verdict == "undecided"
        assert words.get(name, said.verdict) == said.verdict
        assert said.sentence.startswith(f"{name} {said.verdict}: {claim.statement}")


def test_it_rests_on_the_weakest_comparison_with_its_interval(claims):
    for claim in claims.values():
        said = headline(claim)
        assert said.deciding is not None
        assert said.deciding.p_for == max(comparison.p_for for comparison in claim.comparisons)
        assert said.deciding.relation in said.statistic
        assert said.statistic in said.sentence
        assert ("[" in said.statistic) == said.deciding.advantage.has_interval


def test_the_paper_s_figures_stand_beside_ours(claims):
    paper = paper_numbers()
    for comparison in claims["C4"].comparisons:
        name = comparison.relation.split()[0]
        assert paper_advantage(comparison) == paper[name].highest_distance - PAPER_BASELINE_DISTANCE
    for comparison in claims["C3"].comparisons:
        other = comparison.relation.split()[2]
        assert paper_advantage(comparison) == paper[other].distance_std - paper["orthant"].distance_std
    said = headline(claims["C4"])
    assert "against 8.32 m (best of its 15 runs)" in said.paper
    assert headline(claims["C6"]).paper == "gives no such figure"
    assert all(paper_advantage(comparison) is None for comparison in claims["C6"].comparisons)
    never = headline(claims["C5"])
    assert never.paper.startswith("never against")
    assert all(paper_advantage(comparison) is None for comparison in claims["C5"].comparisons)


def test_what_is_not_applicable_says_why(tables):
    claims = decide(measure_tables(*tables(("mine", "yours"))))
    said = headline(claims[0])
    assert (said.verdict, said.deciding, said.paper) == ("not applicable", None, "")
    assert "no setup sparse" in said.sentence
    assert summary(claims) == "None of the six claims can be decided here"


def test_the_summary_counts(claims):
    told = summary(list(claims.values()))
    assert told.startswith("Of six claims, ")
    for verdict, words in (
        (Verdict.HOLDS, "hold"),
        (Verdict.REVERSED, "not hold"),
        (Verdict.UNDECIDED, "undec"),
    ):
        assert (words in told) == any(claim.verdict is verdict for claim in claims.values())
