"""The table says what the measurements mean, and leaves out what was not measured."""

import pytest

from bench.child import Measurement
from bench.cost import Cost
from bench.report import report


def took(microseconds):
    cost = Cost(1000 * microseconds / 1e6, 2000 * microseconds / 1e6)
    return Measurement(1000, cost, cost, 1.0)


def test_nothing_measured_is_nothing_told():
    assert report({}) == []


def test_what_a_wrapper_adds_is_told_round_by_round():
    rows = report(
        {
            "wrapper alone": [took(100.0), took(200.0), took(100.0)],
            "wrapper with coachable": [took(104.0), took(208.0), took(150.0)],
            "wrapper with rtamt, online": [took(148.0), took(296.0), took(148.0)],
        }
    )
    assert [row.title for row in rows] == ["Walker2d-v5: a step", "… with coachable", "… with rtamt, online"]
    assert rows[1].figure == "+4.0 CPU-µs a step, +4.0 %"
    assert rows[1].cpu == pytest.approx(0.150)
    assert rows[2].figure == "+48.0 CPU-µs a step, +48.0 %"
    assert rows[2].comparison == "12.0 × what coachable adds"


def test_training_with_a_wrapper_is_compared_with_training_without():
    rows = report(
        {"wrapper in training alone": [took(800.0)], "wrapper in training with coachable": [took(840.0)]}
    )
    assert [row.comparison for row in rows] == ["", "+5.0 %"]


def test_described_training_stands_between_its_opponent_and_its_simulator():
    speeds = {"coachable": 200.0, "stable-baselines3": 500.0, "without learning": 150.0, "mj_step": 100.0}
    rows = report({f"described Walker2d {name}": [took(speed)] for name, speed in speeds.items()})
    assert [row.title for row in rows] == [
        "training: described Walker2d coachable",
        "… stable-baselines3",
        "… without learning: simulator, signals, reward",
        "… mj_step alone",
    ]
    assert [row.comparison for row in rows] == ["", "2.50 × a CPU-s, 2.50 × on the wall", "", "50 % of it"]
