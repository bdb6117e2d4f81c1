"""A walk made up to follow the description does, one that strays is told of, and the picture shows both."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from coachable.behaviours.library import load_behaviour
from coachable.plants.compass import CompassWalker
from coachable.plants.outcome import Outcome
from coachable.verification.gait.adherence import adherence
from coachable.verification.gait.followed_automaton import followed_svg
from coachable.verification.gait.walk import SampledWalk

WALKING = load_behaviour("compass-walking")
IN_PHASE = {
    "O1": (0.1, -0.1, -1.0, 1.0),
    "O2": (0.1, 0.1, -1.0, 1.0),
    "O3": (-0.1, 0.1, -1.0, 1.0),
    "O4": (-0.1, 0.1, -1.0, -1.0),
    None: (0.1, -0.1, 1.0, 1.0),
}
"""A state in each phase, and one outside."""


def walk_through(*locations):
    x = np.array([IN_PHASE[location] for location in locations])
    nothing = np.zeros(0)
    return SampledWalk(
        time=0.01 * np.arange(len(x)),
        x=x,
        control=np.zeros((len(x) - 1, 2)),
        memory=np.zeros((len(x), 0)),
        touchdown_time=nothing,
        touchdown_foot=nothing,
        touchdown_work=nothing,
        section=np.zeros((0, 3)),
        section_memory=np.zeros((0, 0)),
        outcome=Outcome.WALKING,
    )


def test_a_walk_along_the_edges_follows():
    seen = adherence(WALKING, CompassWalker(), walk_through(*["O1", "O2", "O3", "O4"] * 3, "O1"))
    assert seen.follows
    assert seen.share_in_phases == 1
    assert list(seen.cycles.values()) == [3]
    assert {(one.source, one.target): one.count for one in seen.transitions} == {
        ("O1", "O2"): 3,
        ("O2", "O3"): 3,
        ("O3", "O4"): 3,
        ("O4", "O1"): 3,
    }


def test_what_strays_is_counted_and_explained():
    seen = adherence(WALKING, CompassWalker(), walk_through("O1", "O3", "O3", None, "O1", "O3"))
    assert not seen.follows
    assert seen.share_in_phases == pytest.approx(5 / 6)
    strayed = [(one.source, one.target, one.count) for one in seen.transitions if not one.described]
    assert strayed[0] == ("O1", "O3", 2)
    assert {*strayed[1:]} == {("O3", None, 1), (None, "O1", 1)}
    assert seen.violations == {"goes where no edge leads": 2, "leaves all phases": 1}
    assert len(seen.explained) == 2
    assert "O1 → O3 is not an edge" in seen.explained[0]


def test_two_samples_at_one_moment_count_once():
    walk = walk_through("O1", "O2", "O3")
    walk.time[1] = 0.0
    assert adherence(WALKING, CompassWalker(), walk).phases["O2"] == 0


def test_the_picture_dashes_what_is_not_described_and_counts_the_rest():
    seen = adherence(WALKING, CompassWalker(), walk_through("O1", "O3", "O3", None, *["O1", "O2"] * 17))
    drawn = ET.fromstring(followed_svg(WALKING, seen))
    kinds = [element.get("class") for element in drawn.iter("{http://www.w3.org/2000/svg}path")]
    described = len({(edge.source, edge.target) for edge in WALKING.edges})
    assert kinds.count("strayed") == sum(not one.described for one in seen.transitions)
    assert kinds.count("missed") == sum(one.described and not one.count for one in seen.transitions)
    assert kinds.count("kept") + kinds.count("missed") == 2 * described
    texts = [element.text for element in drawn.iter("{http://www.w3.org/2000/svg}text")]
    assert "17" in texts
