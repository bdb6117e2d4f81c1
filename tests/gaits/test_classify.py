"""Feet that come to the ground as in a gait make that gait, whatever else is random about them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.automata.trace import Trace
from coachable.behaviours import Signal
from coachable.gaits.classify import gait
from coachable.gaits.footfalls import feet, landings, repeat_samples, touchdowns
from coachable.gaits.measures import measures
from tests.gaits.patterns import GAITS, Pattern, details

CASES = [pytest.param(name, one, id=f"{name}-{n}") for name, of in GAITS.items() for n, one in enumerate(of)]
OF_TWO = st.one_of(*(details(GAITS[name][0]) for name in ("walks", "runs", "gallops", "hops", "skips")))
ANY = st.one_of(*(details(one) for of in GAITS.values() for one in of))


@pytest.mark.parametrize(("name", "patterns"), CASES)
def test_a_pattern_is_named_as_what_it_was_made(name, patterns):
    @settings(max_examples=30, deadline=None)
    @given(details(patterns))
    def named(pattern):
        assert gait(pattern.walk()) == name

    named()


@settings(max_examples=25, deadline=None)
@given(st.one_of(*(details(GAITS[name][0]) for name in ("gallops", "hops", "pronks", "hops on left"))))
def test_the_footfalls_repeat_after_a_stride(pattern):
    repeat = repeat_samples(feet(pattern.walk())) * pattern.dt
    # Each of the footfalls may be off.
    assert repeat == pytest.approx(pattern.stride, rel=2 * pattern.jitter + 0.06)


@settings(max_examples=25, deadline=None)
@given(ANY, st.floats(-100, 100), st.integers(0, 200))
def test_when_a_recording_begins_does_not_matter(pattern, shift, dropped):
    walk = replace(pattern, jitter=0.0, chatter=False).walk()
    later = replace(
        walk,
        time=walk.time[dropped:] + shift,
        values={name: column[dropped:] for name, column in walk.values.items()},
    )
    assert gait(later) == gait(walk)
    one, other = measures(walk), measures(later)
    for name in ("duty", "overlap", "flight", "alternation", "asymmetry"):
        assert other[name] == pytest.approx(one[name], abs=0.05 if name != "asymmetry" else 8, nan_ok=True)


@settings(max_examples=25, deadline=None)
@given(OF_TWO)
def test_swapped_feet_have_the_mirrored_lag_and_all_else_alike(pattern):
    walk = pattern.walk()
    left, right = walk.values["left_foot_contact"], walk.values["right_foot_contact"]
    swapped = replace(walk, values={**walk.values, "left_foot_contact": right, "right_foot_contact": left})
    assert gait(swapped) == gait(walk)
    one, other = measures(walk), measures(swapped)
    assert abs((one["lag"] + other["lag"] + 0.5) % 1 - 0.5) < 0.05 or gait(walk) == "skips"
    for name in ("alternation", "step_time"):
        assert other[name] == one[name]
    for name in ("duty", "overlap", "flight"):
        assert other[name] == pytest.approx(one[name], abs=0.05)


@settings(max_examples=25, deadline=None)
@given(ANY, st.sampled_from([0.002, 0.004, 0.01, 0.02]))
def test_how_often_it_is_sampled_does_not_matter(pattern, dt):
    calm = replace(pattern, chatter=False)
    one, other = measures(calm.walk()), measures(replace(calm, dt=dt).walk())
    assert gait(replace(calm, dt=dt).walk()) == gait(calm.walk())
    for name in ("duty", "overlap", "flight"):
        assert other[name] == pytest.approx(one[name], abs=0.06, nan_ok=True)


@settings(max_examples=30, deadline=None)
@given(ANY)
def test_what_is_down_and_what_is_up_add_up(pattern):
    """Of two feet, by inclusion and exclusion; of any number, no share is more than all of it."""
    walk = pattern.walk()
    found = measures(walk)
    if len(feet(walk)) == 2:
        assert 1 - found["flight"] == pytest.approx(2 * found["duty"] - found["overlap"])
    assert all(0 <= found[name] <= 1 for name in ("duty", "flight"))


@pytest.mark.parametrize("bounces", [1, 2, 3])
@pytest.mark.parametrize("off", [0.0, 0.05])
def test_feet_that_bounce_in_turn_within_one_step_do_not_alternate(bounces, off):
    """Left, right, left, right in a tenth of a second, and both up: a hop, though they touch down in turn."""
    time = np.arange(1600) * 0.005
    hop = (time + 0.0025) % 0.8
    left, right = ((hop > 0.4 + off * foot) & (hop < 0.6) for foot in (0, 1))
    for bounce in range(bounces):
        begin = 0.4 - 0.1 * (bounce + 1)
        left |= (hop > begin) & (hop < begin + 0.04)
        right |= (hop > begin + 0.05) & (hop < begin + 0.09)
    values = {"torso_x": time, "left_foot_contact": left + 0.0, "right_foot_contact": right + 0.0}
    walk = Trace(time, tuple(map(Signal, values)), values)
    assert len(touchdowns(left)) == (bounces + 1) * 10, "every bounce lasts long enough to be a touchdown"
    assert [set(landing) for landing in landings(feet(walk))] == [{"left", "right"}] * 10
    found = measures(walk)
    assert found["alternation"] == 0
    assert found["step_time"] == pytest.approx(0.8)
    assert found["strides"] == 9
    assert gait(walk) == "hops"


@pytest.mark.parametrize(
    ("landings", "name"),
    [
        ({"a_": [0.0], "b_": [0.25], "c_": [0.5], "d_": [0.75]}, "moves"),
        ({"a_": [0.0], "b_": [0.3], "c_": [0.6]}, "moves"),
        ({"left_front_": [0.5], "right_front_": [0.0], "left_back_": [0.0], "right_back_": [0.5]}, "trots"),
        ({"back_": [0.0], "front_": []}, "hops on back"),
        ({"leg_0_": [0.0], "leg_1_": [0.5]}, "runs"),
    ],
)
def test_feet_are_told_by_their_names(landings, name):
    assert gait(Pattern(landings, 0.3).walk()) == name


@pytest.mark.parametrize(
    ("landings", "stance", "name"),
    [
        ({"left_": [0.0, 0.25, 0.5], "right_": [0.75]}, 0.12, "hops"),
        ({"left_": [0.0, 0.5], "right_": [0.0, 0.7]}, 0.1, "hops"),
        ({"left_": [0.0], "right_": [0.05]}, 0.9, "hops"),
        ({"left_": [0.0], "right_": [0.05]}, 0.95, "shuffles"),
        ({"back_": [0.0, 0.25, 0.5], "front_": [0.75]}, 0.12, "hops"),
    ],
)
def test_feet_that_seldom_take_turns_hop_if_they_leave_the_ground(landings, stance, name):
    assert gait(Pattern(landings, stance, stride=1.6).walk()) == name


def test_a_gallop_that_changes_its_lead_every_stride_is_a_skip():
    assert gait(Pattern({"left_": [0.0, 0.625], "right_": [0.125, 0.5]}, 0.1, stride=1.6).walk()) == "skips"


@pytest.mark.parametrize("seed", range(5))
def test_a_gallop_may_change_its_lead_at_any_time(seed):
    """The circular mean of a quarter and three quarters of a stride would be half a stride, or none."""
    leads = np.random.default_rng(seed).permutation([0.0, 0.25] * 10)
    landed = {
        foot: [(stride + abs(lead - late)) / 20 for stride, lead in enumerate(leads)]
        for foot, late in (("left_", 0.0), ("right_", 0.25))
    }
    walk = Pattern(landed, 0.25 / 20, stride=0.8 * 20, num_strides=1).walk()
    assert repeat_samples(feet(walk)) * walk.dt == pytest.approx(0.8, rel=0.03)
    assert gait(walk) == "gallops"
