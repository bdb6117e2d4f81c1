"""The expected run beside a trace is that of the reward, in parts as in one piece, and says who was late."""

from itertools import pairwise

import numpy as np
import pytest

from coachable.automata.trace import Trace
from coachable.behaviours import Behaviour, Dwell, Edge, Near, Phase, Signal, load_behaviour
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.expected_run import ExpectedRunFollower, Standing, as_json, as_text
from coachable.rewards.forms import Schedule

DT = 0.25
ROOMS = Behaviour(
    "rooms",
    "",
    (Signal("room"),),
    tuple(Phase(name, "", Near("room", index, 0.1), Dwell(0.0, 2 * DT)) for index, name in enumerate("ABCD")),
    tuple(Edge(*pair) for pair in ("AB", "BC", "CD", "DA")),
)


def trace(walk, start=0.0):
    times = start + DT * np.arange(len(walk))
    rooms = np.array([float("ABCD".index(room)) if room in "ABCD" else -1.0 for room in walk])
    return Trace(times, ROOMS.signals, {"room": rooms})


def followed(*parts, most=5):
    follower = ExpectedRunFollower(ROOMS, most)
    assert [*follower.following(parts)] == [*parts]
    return follower.run()


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_run_that_the_reward_expects(seed):
    walk = "".join(np.random.default_rng(seed).choice([*"ABCD."], 300))
    reward, signals = DescribedReward(ROOMS, Schedule(), DT), trace(walk).values["room"][:, None]
    memory, in_step = reward.init(signals[0]), []
    for sample in signals[1:]:
        memory, _, info = reward.step(memory, sample)
        in_step.append(bool(info.follows))
    run = followed(trace(walk))
    assert run.time[Standing.IN_STEP] == pytest.approx(DT * sum(in_step))
    assert sum(run.time.values()) == pytest.approx(DT * 299)


def test_parts_are_followed_as_one_piece():
    walk = "".join(np.random.default_rng(7).choice([*"AABBCCDD."], 500))
    whole, cuts = trace(walk), (0, 1, 130, 131, 420, 500)
    parts = [
        Trace(whole.time[a:b], ROOMS.signals, {"room": whole.values["room"][a:b]}) for a, b in pairwise(cuts)
    ]
    assert followed(*parts) == followed(whole)


def test_who_is_late_early_or_elsewhere_is_told_so():
    # Expected: A A B B C C D D, by time alone; the robot camps in A, is outside, and is there again in D.
    run = followed(trace("AAAAA.DD"))
    by_kind = {spell.standing: spell for spell in run.spells}
    late = by_kind[Standing.BEHIND]
    assert (late.start, late.phase, late.expected) == (0.5, "A", "B")
    assert late.sentence == "t = 0.5 s to 1 s: behind, in A while B is expected"
    assert (by_kind[Standing.OUT_OF_PHASE].phase, by_kind[Standing.OUT_OF_PHASE].expected) == ("A", "C")
    assert by_kind[Standing.OUTSIDE].sentence == "t = 1.25 s to 1.5 s: outside while C is expected"
    assert "in step" in as_text(run)
    assert as_json(run)["spells"][0]["standing"] == run.spells[0].standing


def test_a_robot_that_goes_back_is_ahead_of_nothing_and_a_gap_begins_anew():
    run = followed(trace("ABA"))
    assert {spell.standing for spell in run.spells} == {Standing.BEHIND}
    apart = followed(trace("AABB"), trace("CCDD", start=50.0))
    assert apart.time == {Standing.IN_STEP: pytest.approx(6 * DT)}


def test_only_what_has_limits_and_goes_round_has_an_expected_run():
    assert ExpectedRunFollower.of(load_behaviour("compass-walking")) is None
    assert ExpectedRunFollower.of(load_behaviour("compass-walking-timed")) is not None


def test_along_a_whole_walk_it_is_what_the_reward_expects_and_nothing_is_kept():
    walk = "".join(np.random.default_rng(3).choice([*"ABCD."], 120))
    recorded = trace(walk)
    reward, signals = DescribedReward(ROOMS, Schedule(), DT), recorded.values["room"][:, None]
    memory = reward.init(signals[0])
    expected = [int(memory.form.phase)]
    for sample in signals[1:]:
        memory, _, info = reward.step(memory, sample)
        expected.append(int(info.form["expected"]))
    follower = ExpectedRunFollower(ROOMS)
    locations = np.array(["ABCD.".index(room) for room in walk])
    for _ in range(2):
        assert follower.along(recorded.time, locations).tolist() == expected
    assert follower.run().time == {}
