"""The schedule form: its definition followed by an oracle in plain Python, and what it should pay for."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coachable.behaviours import Behaviour, Dwell, Edge, Near, Phase, Signal, load_behaviour
from coachable.foundation.errors import ParameterError
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import Schedule, form_from_data
from coachable.rewards.reward_hash import hash_of_paid

DT = 0.25
OUTSIDE = "."


def rooms(limits, edges):
    """The signal `room` says which phase it is; `limits` are the phases' times in steps, by name."""
    phases = tuple(
        Phase(name, "", Near("room", index, 0.1), Dwell(least * DT, most * DT))
        for index, (name, (least, most)) in enumerate(limits.items())
    )
    return Behaviour("rooms", "", (Signal("room"),), phases, tuple(Edge(*pair) for pair in edges))


def paid(behaviour, walk, fine=1.0, spread=False, **options):
    """What each step of a walk through rooms is paid."""
    reward = DescribedReward(behaviour, Schedule(fine, fine_spread=spread), DT, **options)
    names = behaviour.phase_names
    signals = [np.array([float(names.index(room)) if room in names else -1.0]) for room in walk]
    memory, rows = reward.init(signals[0]), []
    for sample in signals[1:]:
        memory, pay, info = reward.step(memory, sample)
        rows.append((float(pay), info))
    return rows


class Oracle:
    """The definition, line by line, with times in whole steps."""

    def __init__(self, limits, edges, fine, spread=False):
        self.limits, self.fine, self.spread, self.owed = limits, fine, spread, 0.0
        self.edges = [pair for pair in edges if pair[0] != pair[1]]
        self.e, self.c, self.v = None, 0, False
        reached = {name: {target for source, target in self.edges if source == name} for name in limits}
        for _ in limits:
            for name in limits:
                reached[name] |= set().union(*(reached[target] for target in reached[name]))
        on_cycle = {name for name in limits if name in reached[name]}
        self.begins = on_cycle or set(limits)

    def sample(self, q, begin=False):
        """What the sample in q is paid, and the phase that is expected then."""
        fine = 0.0
        if self.e is None:
            if q in self.begins:
                self.e, self.c, self.v = q, 0, True
        elif not begin:
            self.c += 1
            least, most = self.limits[self.e]
            successors = [target for source, target in self.edges if source == self.e]
            if q in successors and self.c >= least:
                if not self.v and math.isfinite(most):
                    fine = self.fine * max(0, most - self.c)
                self.e, self.c, self.v = q, 0, False
            elif successors and self.c >= most:
                self.e, self.c, self.v = successors[0], 0, False
            self.v = self.v or q == self.e
        in_step = self.e is not None and q == self.e
        if self.spread:
            self.owed = max(self.owed, fine)
            fine = min(self.owed, 2.0) if in_step else 0.0
            self.owed -= fine
        return (1.0 if in_step else -1.0) - fine, self.e


NAMES = "ABCD"
LIMITS = st.tuples(st.integers(0, 2), st.integers(0, 4)).map(lambda pair: (min(pair), max(pair)))
PAIRS = st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), unique=True, max_size=7)


@settings(max_examples=100)
@given(
    limits=st.fixed_dictionaries(dict.fromkeys(NAMES, LIMITS)),
    edges=PAIRS,
    walk=st.text(NAMES + OUTSIDE, min_size=2, max_size=25),
    fine=st.sampled_from([0.0, 0.3, 1.0]),
    spread=st.booleans(),
)
@example(dict.fromkeys(NAMES, (0, 2)), [("A", "B"), ("B", "C"), ("C", "A")], "AABBCCAABBDCC", 1.0, False)
@example(
    dict.fromkeys(NAMES, (1, 3)), [("A", "B"), ("A", "C"), ("B", "A"), ("C", "A")], "ACACAABBC", 0.3, True
)
@example(dict.fromkeys(NAMES, (0, 2)), [("A", "B"), ("B", "C")], "ABCCCCCABA", 1.0, False)
def test_it_pays_by_its_definition(limits, edges, walk, fine, spread):
    limits = {name: limits[name] for name in NAMES}
    oracle = Oracle(limits, edges, fine, spread)
    oracle.sample(walk[0], begin=True)
    names = [*NAMES, None]
    least = Schedule(fine, fine_spread=spread).bind(rooms(limits, edges), 1.0).least_pay
    for (pay, info), room in zip(paid(rooms(limits, edges), walk, fine, spread), walk[1:], strict=True):
        expected, phase = oracle.sample(room)
        assert names[int(info.form["expected"])] == phase
        assert pay == pytest.approx(expected)
        assert pay >= least - 1e-9
        assert bool(info.follows) == (room == phase)


RING = [("A", "B"), ("B", "C"), ("C", "A")]
SHORT = dict.fromkeys("ABC", (0, 2))


def pays(walk, limits=SHORT, edges=RING, fine=1.0):
    return [pay for pay, _ in paid(rooms(limits, edges), walk, fine)]


def test_who_goes_through_the_phases_in_their_time_is_always_paid():
    assert pays("AABBCCAABC") == [1] * 9


def test_who_stands_still_is_paid_only_while_that_is_expected():
    # As soon as C is expected, being in A is going on from C, which was passed over.
    assert pays("AAAAAAAA") == [1, -1, -1, -1, 1 - 1, 1, -1]


def test_a_phase_that_is_passed_over_is_charged_at_once():
    # From A the robot goes outside until B is expected, and on to C, with both of B's steps left but one.
    assert pays("AA.CC") == [1, -1, 1 - 1, 1]
    assert pays("AA.CC", fine=0.0) == [1, -1, 1, 1]
    assert pays("AA.CC", fine=0.5) == [1, -1, 0.5, 1]


def test_a_minimum_time_holds_the_expected_run_back():
    assert pays("AAB", dict.fromkeys("ABC", (3, 4))) == [1, -1]


def test_a_goal_stays_expected():
    assert pays("ABCCCCCC", edges=[("A", "B"), ("B", "C")]) == [1] * 7


def test_a_sample_outside_does_not_wind_the_clock_back():
    """Nodding out of a phase undoes a limit of the form `stay`; here the time runs on."""
    assert sum(pays("AA.AA.AA.AA.AA.", SHORT)) < 0


def test_the_time_that_a_step_lasted_counts_and_the_nominal_one_is_charged():
    reward = DescribedReward(rooms(SHORT, RING), Schedule(1.0), DT)
    memory = reward.init(np.array([0.0]))
    memory, _, _ = reward.step(memory, np.array([0.0]), elapsed=0.1)
    memory, _, info = reward.step(memory, np.array([0.0]), elapsed=0.1)
    assert float(info.form["expected_time"]) == pytest.approx(0.2)
    memory, _, info = reward.step(memory, np.array([-1.0]), elapsed=0.3)  # time is up: B is expected
    _, _, info = reward.step(memory, np.array([2.0]), elapsed=0.1)
    assert float(info.terms["passed_over"]) == pytest.approx(-(0.5 - 0.1) / DT)


def test_twenty_samples_of_a_hundredth_are_a_fifth_of_a_second_in_single_precision():
    phases = tuple(Phase(name, "", Near("room", i, 0.1), Dwell(0, 0.2)) for i, name in enumerate("ABC"))
    behaviour = Behaviour("rooms", "", (Signal("room"),), phases, tuple(Edge(*pair) for pair in RING))
    reward = DescribedReward(behaviour, "schedule", 0.01)
    here = np.zeros((1,), np.float32)
    memory, paid = reward.init(here), []
    for _ in range(60):
        memory, pay, _ = reward.step(memory, here)
        paid.append(float(pay))
    assert paid == [1.0] * 19 + [-1.0] * 21 + [1.0] * 20


def test_a_policy_may_see_the_expected_run():
    reward = DescribedReward(rooms(SHORT, RING), Schedule(), DT)
    assert reward.observation_names == ("expected A", "expected B", "expected C", "time over", "visited")
    memory = reward.init(np.array([-1.0]))
    assert reward.observe(memory, np.array([-1.0])).tolist() == [0, 0, 0, 0, 0]
    memory, _, _ = reward.step(memory, np.array([1.0]))
    assert reward.observe(memory, np.array([1.0])).tolist() == [0, 1, 0, 0, 1]
    memory, _, _ = reward.step(memory, np.array([1.0]))
    assert reward.observe(memory, np.array([1.0])).tolist() == [0, 1, 0, 0.5, 1]
    memory, _, _ = reward.step(memory, np.array([-1.0]))
    assert reward.observe(memory, np.array([-1.0])).tolist() == [0, 0, 1, 0, 0]


def test_a_phase_on_a_cycle_needs_an_end_and_dt_is_needed():
    with pytest.raises(ParameterError, match=r"O1, O2, O3 and O4 may last for ever.*for at most"):
        DescribedReward(load_behaviour("compass-walking"), "schedule", 0.01)
    with pytest.raises(ParameterError, match="dt is needed"):
        Schedule().bind(rooms(SHORT, RING), None)


@given(walk=st.text("ABC" + OUTSIDE, min_size=2, max_size=40), most=st.integers(2, 8))
def test_a_fine_that_is_spread_takes_no_more_and_no_step_pays_less_than_being_elsewhere(walk, most):
    behaviour = rooms(dict.fromkeys("ABC", (0, most)), RING)
    at_once = [pay for pay, _ in paid(behaviour, walk)]
    spread = [pay for pay, _ in paid(behaviour, walk, spread=True)]
    assert min(spread) >= -1 <= max(spread) <= 1
    for so_far in range(len(walk)):
        assert sum(spread[:so_far]) >= sum(at_once[:so_far]) - 1e-9


def test_a_fine_is_spread_over_the_steps_in_the_expected_phase():
    # From A to C, past B: five of its six steps are left, and one of C is elsewhere.
    walk, limits = "AAAAAA" + OUTSIDE + "CC" + OUTSIDE + "CCC", dict.fromkeys("ABC", (0, 6))
    assert pays(walk, limits) == [1] * 5 + [-1, 1 - 5, 1, -1, 1, 1, 1]
    told = paid(rooms(limits, RING), walk, spread=True)
    assert [pay for pay, _ in told] == [1] * 5 + [-1, -1, -1, -1, 0, 1, 1]
    assert [float(info.terms["passed_over"]) for _, info in told][-6:] == [-2, -2, 0, -1, 0, 0]


def test_what_is_owed_is_seen():
    reward = DescribedReward(rooms(dict.fromkeys("ABC", (0, 6)), RING), Schedule(1.0, fine_spread=True), DT)
    assert reward.observation_names[-3:] == ("time over", "visited", "owed")
    memory = reward.init(np.array([0.0]))
    for room in (-1.0,) * 6 + (2.0,):
        memory, _, _ = reward.step(memory, np.array([room]))
    owed = [float(reward.observe(memory, np.array([2.0]))[-1])]
    memory, _, _ = reward.step(memory, np.array([2.0]))
    assert [*owed, float(reward.observe(memory, np.array([2.0]))[-1])] == pytest.approx([3 / 6, 1 / 6])


@pytest.mark.parametrize("fine", [-0.1, 1.1, math.nan])
def test_a_fine_is_a_share(fine):
    with pytest.raises(ParameterError, match="skip_fine"):
        Schedule(fine)


def test_the_order_of_edges_and_the_fine_are_part_of_what_is_paid():
    forks = [("A", "B"), ("A", "C"), ("B", "A"), ("C", "A")]
    one, other = rooms(SHORT, forks), rooms(SHORT, [forks[1], forks[0], *forks[2:]])
    assert hash_of_paid(one, Schedule()) != hash_of_paid(other, Schedule())
    assert hash_of_paid(one, Schedule()) != hash_of_paid(one, Schedule(1.0))
    assert form_from_data({"form": "schedule", "skip_fine": 1}) == Schedule(1)
    assert form_from_data(Schedule(0.5).to_data()) == Schedule(0.5)


@given(walk=st.text("ABC" + OUTSIDE, min_size=2, max_size=25))
def test_a_fixed_clock_goes_on_by_time_alone(walk):
    reward = DescribedReward(rooms(SHORT, RING), Schedule(robot_leads=False), DT)
    signals = [np.array([float("ABC".index(room)) if room in "ABC" else -1.0]) for room in walk]
    memory, started = reward.init(signals[0]), None
    if walk[0] != OUTSIDE:
        started = (0, "ABC".index(walk[0]))
    for step, (room, sample) in enumerate(zip(walk[1:], signals[1:], strict=True), start=1):
        memory, pay, info = reward.step(memory, sample)
        if started is None and room != OUTSIDE:
            started = (step, "ABC".index(room))
        # Each phase is expected for two steps, whatever the robot does.
        expected = 3 if started is None else (started[1] + (step - started[0]) // 2) % 3
        assert int(info.form["expected"]) == expected
        assert float(pay) == (1.0 if "ABC."[expected] == room != OUTSIDE else -1.0)


def test_durations_take_the_place_of_the_phases_limits():
    endless = rooms(dict.fromkeys("ABC", (0, math.inf)), RING)
    form = Schedule(1.0, durations=dict.fromkeys("ABC", 2 * DT))
    with pytest.raises(ParameterError, match="may last for ever"):
        DescribedReward(endless, Schedule(1.0), DT)
    walk = [np.array([float("ABC".index(room))]) for room in "AAAACCABBBCC"]
    for_all = []
    for reward in (
        DescribedReward(endless, form, DT),
        DescribedReward(rooms(SHORT, RING), Schedule(1.0), DT),
    ):
        memory, rows = reward.init(walk[0]), []
        for sample in walk[1:]:
            memory, pay, _ = reward.step(memory, sample)
            rows.append(float(pay))
        for_all.append(rows)
    assert for_all[0] == for_all[1]
    short = rooms(SHORT, RING)
    others = Schedule(1.0, durations={"A": 3 * DT}), Schedule(1.0, False), Schedule(1.0, fine_spread=True)
    assert len({hash_of_paid(short, each) for each in (Schedule(1.0), *others)}) == 4
    data = {"form": "schedule", "skip_fine": 1.0, "robot_leads": False, "durations": {"A": 0.5}}
    assert form_from_data(data).to_data() == {**data, "fine_spread": False}


def test_durations_that_make_no_sense_are_refused():
    with pytest.raises(ParameterError, match=r"durations\.A"):
        Schedule(durations={"A": 0.0})
    with pytest.raises(ParameterError, match=r"has no phase 'a'; known: 'A', 'B', 'C'"):
        DescribedReward(rooms(SHORT, RING), Schedule(durations={"a": 1.0}), DT)
    with pytest.raises(ParameterError, match=r"form\.durations\.A must be a number"):
        form_from_data({"form": "schedule", "durations": {"A": "long"}})
