"""Gaits of feet that come to the ground by a clock are what the clock says."""

import math
from dataclasses import replace

import numpy as np
import pytest

from coachable.automata.trace import Trace
from coachable.behaviours import Signal
from coachable.gaits.classify import gait
from coachable.gaits.footfalls import feet, touchdowns
from coachable.gaits.measures import measures

DT = 0.01


def clockwork(duty, lag=0.5, speed=1.5, seconds=8.0, stride=0.8):
    """A walk at constant speed; each foot is on the ground for a share of its stride, the right one later."""
    time = np.arange(round(seconds / DT)) * DT
    values = {
        "torso_x": speed * time,
        "power": np.full(len(time), 90.0),
        "weight": np.full(len(time), 40.0),
    }
    for number, (foot, share) in enumerate(duty.items()):
        # Half a sample off, so that rounding decides nothing.
        phase = (time + DT / 2) / stride - number * lag - 0.1
        values[f"{foot}foot_contact"] = (phase % 1 < share).astype(float)
    return Trace(time, tuple(map(Signal, values)), values)


def two(left, right, **rest):
    return clockwork({"left_": left, "right_": right}, **rest)


@pytest.mark.parametrize(
    ("walk", "name"),
    [
        (two(0.6, 0.6), "walks"),
        (two(0.6, 0.6, lag=0.42), "walks"),
        (two(0.3, 0.3), "runs"),
        (two(0.3, 0.3, lag=0.25), "gallops"),
        (two(0.3, 0.3, lag=0.75), "gallops"),
        (two(0.3, 0.3, lag=0.02), "hops"),
        (two(0.3, 0.3, lag=0.98), "hops"),
        (two(0.0, 0.3), "hops on right"),
        (two(0.3, 0.0), "hops on left"),
        (two(0.6, 0.6, speed=0.01), "stands"),
        (two(0.47, 0.47, lag=0.5, speed=0.01), "stands"),
        (two(0.4, 0.4, lag=0.02, speed=0.01), "hops"),
        (two(0.3, 0.3, speed=0.01), "runs"),
        (two(1.0, 1.0), "shuffles"),
        (clockwork({"": 0.4}), "hops"),
        (clockwork({"": 1.0}), "shuffles"),
        (clockwork({}), "moves"),
        (clockwork({"a_": 0.3, "b_": 0.3, "c_": 0.3, "d_": 0.3}), "moves"),
    ],
)
def test_a_gait_is_told_by_when_its_feet_are_on_the_ground(walk, name):
    assert gait(walk) == name


@pytest.mark.parametrize("lag", [0.05, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("duty", [0.25, 0.45])
def test_the_clock_is_read_from_the_feet(duty, lag):
    found = measures(two(duty, duty, lag=lag))
    assert found["duty"] == pytest.approx(duty, abs=0.02)
    assert found["lag"] == pytest.approx(lag, abs=0.02)
    assert found["alternation"] == (0.0 if lag < 0.15 else 1.0), "together they make one landing"
    assert found["asymmetry"] == pytest.approx(0.0, abs=3.0)
    assert found["speed"] == pytest.approx(1.5)
    overlap = max(0.0, duty - min(lag, 1 - lag))
    assert found["flight"] == pytest.approx(1 - 2 * duty + overlap, abs=0.02)
    assert found["overlap"] == pytest.approx(overlap, abs=0.02)


def test_the_cost_of_transport_is_power_per_weight_and_speed():
    assert measures(two(0.6, 0.6))["transport"] == pytest.approx(90.0 / (40.0 * 1.5), rel=0.01)
    assert math.isnan(measures(two(0.6, 0.6, speed=-0.5))["transport"]), "it does not go forward"


def test_asymmetry_is_the_difference_over_the_mean():
    assert measures(two(0.6, 0.3))["asymmetry"] == pytest.approx(100 * 0.3 / 0.45, abs=3)
    assert measures(two(0.3, 0.6))["asymmetry"] == pytest.approx(100 * 0.3 / 0.45, abs=3)
    assert measures(two(0.5, 0.0))["asymmetry"] == 200


def test_hopping_on_one_foot_never_alternates():
    assert measures(two(0.4, 0.0))["alternation"] == 0.0


def test_a_foot_that_trembles_makes_no_steps():
    walk = two(0.6, 0.6)
    calm = {name: len(touchdowns(contact)) for name, contact in feet(walk).items()}
    trembling = walk.values["left_foot_contact"]
    trembling[40::37] = 1 - trembling[40::37]
    assert {name: len(touchdowns(contact)) for name, contact in feet(walk).items()} == calm


def test_mirrored_feet_have_the_mirrored_lag_and_all_else_alike():
    one, other = two(0.4, 0.3, lag=0.3), two(0.3, 0.4, lag=0.7)
    first, second = measures(one), measures(other)
    assert first["lag"] + second["lag"] == pytest.approx(1.0, abs=0.03)
    for name in ("duty", "flight", "asymmetry", "alternation"):
        assert first[name] == pytest.approx(second[name], rel=0.05, abs=0.02)


def ahead(walk, **foot_x):
    """The walk with signals of how far its feet are ahead of the hip."""
    values = {**walk.values, **{f"{name}_foot_x": x for name, x in foot_x.items()}}
    return Trace(walk.time, tuple(map(Signal, values)), values)


@pytest.mark.parametrize(("long", "short"), [(0.5, 0.5), (0.6, 0.4), (0.4, 0.6), (0.5, 0.0)])
def test_steps_of_unequal_length_are_asymmetric_by_their_difference_over_the_mean(long, short):
    """Landing, the left foot is `long` ahead of the right one, which is later `short` ahead of it."""
    walk = two(0.3, 0.3)
    left = walk.values["left_foot_contact"] > 0
    x = np.where(left, long / 2, -short / 2)
    found = measures(ahead(walk, left=x, right=-x))
    assert found["step_asymmetry"] == pytest.approx(100 * abs(long - short) / ((long + short) / 2))
    shifted = measures(ahead(walk, left=x + 0.2, right=-x + 0.2))
    assert shifted["step_asymmetry"] == pytest.approx(found["step_asymmetry"]), "wherever the hip is"


def test_steps_have_a_length_if_feet_land_in_turn_under_hips_side_by_side():
    walk = two(0.3, 0.3)
    x = np.zeros(len(walk.time))
    assert math.isnan(measures(walk)["step_asymmetry"]), "nothing says where the feet are"
    together = two(0.3, 0.3, lag=0.02)
    assert math.isnan(measures(ahead(together, left=x, right=x + 0.01))["step_asymmetry"])
    cheetah = clockwork({"back_": 0.3, "front_": 0.3})
    assert math.isnan(measures(ahead(cheetah, back=x, front=x + 0.1))["step_asymmetry"])


def test_one_foot_cannot_be_on_the_ground_with_another():
    found = measures(clockwork({"": 0.4}))
    assert math.isnan(found["overlap"])
    assert found["duty"] + found["flight"] == pytest.approx(1)


def test_the_lag_of_four_feet_is_that_of_a_fore_foot_after_the_hind_foot_of_its_side():
    walk = clockwork(
        {"back_left_": 0.6, "front_left_": 0.6, "back_right_": 0.6, "front_right_": 0.6}, lag=0.25
    )
    assert measures(walk)["lag"] == pytest.approx(0.25, abs=0.02)
    assert gait(walk) == "walks"


def test_standing_before_the_first_stride_and_after_the_last_is_no_part_of_it():
    walk = two(0.3, 0.3)
    time = np.arange(len(walk.time) + 800) * DT
    padded = {name: np.pad(column, 400, mode="edge") for name, column in walk.values.items()}
    stands = {name: np.ones(len(time)) for name in padded if name.endswith("foot_contact")}
    for name, column in stands.items():
        column[400:-400] = walk.values[name]
    longer = replace(walk, time=time, values=padded | stands)
    assert gait(longer) == "runs"
    for name in ("duty", "flight", "overlap"):
        assert measures(longer)[name] == pytest.approx(measures(walk)[name], abs=0.1)


def test_who_goes_on_one_foot_and_then_the_other_makes_no_strides():
    walk = two(1.0, 1.0)
    contacts = {
        "left_foot_contact": (walk.time > 1) & (walk.time < 3),
        "right_foot_contact": (walk.time > 3) & (walk.time < 7),
    }
    walk = replace(walk, values={**walk.values, **{name: on.astype(float) for name, on in contacts.items()}})
    assert math.isnan(measures(walk)["lag"])
    assert gait(walk) == "shuffles"
