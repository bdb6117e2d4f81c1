"""Where feet are, from joint angles: decided, with states that are so and refutations that samples keep."""

import numpy as np
import pytest

from coachable.behaviours.checking import check
from coachable.behaviours.checking.solver import kinematics, refuted, witness
from coachable.behaviours.predicates import holds
from coachable.behaviours.text.parser import parse

pytest.importorskip("ival", reason="needs the [verify] extra: pip install 'coachable[verify]'")

FOOT = "0.45 * {0}(hip) + 0.5 * {0}(hip - knee)"
TOE = FOOT + " + 0.2 * {0}(hip - knee - ankle)"
DOWN, AHEAD = FOOT.format("cos"), FOOT.format("sin")
DISTANCE = " + ".join(f"({TOE.format(wave)}) * ({TOE.format(wave)})" for wave in ("cos", "sin"))
ARM = TOE + " + 0.05 * {0}(hip - knee - ankle - toe) + 0.3 * {0}(trunk)"
ANGLES = ("hip", "knee", "ankle")
JOINTS = (*ANGLES, "toe", "trunk")
RNG = np.random.default_rng(5)

LEGS = """behaviour "legs"
signals
  left_hip [rad]
  left_knee [rad]
  right_hip [rad]
  right_knee [rad]
constants
  thigh = 0.45 [m]
  shank = 0.5 [m]
mirror left <-> right
vocabulary
  left foot is lower means thigh * cos(left_hip) + shank * cos(left_hip - left_knee) > thigh * cos(right_hip) + shank * cos(right_hip - right_knee)
  left foot is ahead means thigh * sin(left_hip) + shank * sin(left_hip - left_knee) > thigh * sin(right_hip) + shank * sin(right_hip - right_knee)
  left knee is bent means left_knee > 0.5 [rad]
phases
  left_a: left foot is lower, not right foot is lower, left foot is ahead, right knee is bent
  left_b: left foot is lower, not right foot is lower, not left foot is ahead, right knee is bent
  left_c: left foot is lower, not right foot is lower, not left foot is ahead, not right knee is bent
cycle
  left_a -> left_b -> left_c -> right_a on touchdown
"""  # noqa: E501


def said(condition):
    """The predicate of a phase that says so."""
    signals = "".join(f"  {name} [rad]\n" for name in JOINTS)
    return parse(f'behaviour "one"\nsignals\n{signals}phases\n  P: {condition}\n').phases[0].predicate


@pytest.mark.parametrize(
    "condition",
    [
        f"{DOWN} > 0.9, {AHEAD} > 0.1",
        f"{DOWN} < 0.2, 0 < hip < 0.5, knee > 1",
        f"{DOWN} > 0.9, knee > 20",
        f"{TOE.format('cos')} > 1.1, {TOE.format('sin')} > 0.1",
        "sin(hip) * cos(knee) > 0.9, sin(hip - knee) > 0.85",
        "cos(2 * hip) > 0.9, cos(hip) < -0.9",
        f"{DOWN} > 0.9499",
        f"{ARM.format('cos')} > 1.18, {ARM.format('sin')} > 0.89",
    ],
)
def test_a_state_is_found_in_which_it_holds(condition):
    predicate = said(condition)
    state = witness(JOINTS, predicate)
    assert state
    assert holds(predicate, state)


@pytest.mark.parametrize(
    "condition",
    [
        f"{DOWN} > 0.96",
        f"{DOWN} > 0.9, {AHEAD} > 0.5",
        f"{DOWN} > 0.9, 1 < knee < 2",
        f"{DOWN} < 0.2, -0.4 < hip < 0.4, 0 <= knee <= 0.6",
        f"{TOE.format('cos')} > 1.16",
        "sin(hip) * cos(knee) > 0.9, sin(hip - knee) < -0.2",
        "cos(2 * hip) > 0.9, abs(cos(hip)) < 0.9",
        "sin(hip) + sin(knee) > 1.2, hip = 0.1 within 0.05",
        "sin(hip - knee) + sin(knee - hip) > 0",
        "sin(hip + knee) - sin(hip) * cos(knee) - cos(hip) * sin(knee) > 0.001",
        f"{DISTANCE} > 1.34",
        f"({DOWN}) * ({DOWN}) + ({AHEAD}) * ({AHEAD}) < 0.0026, 0 < knee < 3.1",
        "sin(hip) * sin(hip) * sin(hip) > 0.9, sin(3 * hip) > 0.1",
        f"{TOE.format('cos')} > 0.9, {TOE.format('sin')} < -0.72",
    ],
)
def test_what_holds_nowhere_is_refuted_and_in_no_sample(condition):
    predicate = said(condition)
    assert refuted(ANGLES, predicate) is True
    samples = dict(zip(ANGLES, RNG.uniform(-4, 4, (3, 100_000)), strict=True))
    assert not np.any(holds(predicate, samples, np))


def test_what_is_too_close_to_call_is_left_open():
    assert kinematics.decide(ANGLES, [said(f"{DOWN} >= 0.95, {AHEAD} > 0")]) is None


def test_without_interval_arithmetic_it_is_left_open(monkeypatch):
    monkeypatch.setattr(kinematics, "find_spec", lambda name: None)
    assert kinematics.decide(ANGLES, [said(f"{DOWN} > 0.96")]) is None


def test_walking_said_by_where_the_feet_are_is_decided():
    report = check(parse(LEGS))
    assert {finding.kind for finding in report.findings} == {"gap"}
    assert [question for question in report.unknown if "standing robot" not in question] == []
    assert "pairwise disjoint" in report.proven
    assert "phases touch along every edge without a jump" in report.proven
    assert "cycle closed through touchdown" in report.proven
