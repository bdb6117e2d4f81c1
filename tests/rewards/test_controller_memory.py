"""A controller's memory shows what the reward showed in training, and is no more than a row of numbers."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.behaviours import load_behaviour
from coachable.behaviours.text.parser import parse
from coachable.rewards.controller_memory import ControllerMemory, memory_data
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import Potential, Schedule, Stay

TIMED = load_behaviour("compass-walking-timed")
DEADBANDS = parse("""
behaviour "to and fro"
  Two phases, each kept until the angle is well in the other.

signals
  angle  [rad]

phases
  left "left" for at most 0.3 s:    angle < 0 [rad] deadband 0.2
  right "right" for at most 0.4 s:  angle >= 0 [rad] deadband 0.2

cycle
  left -> right -> left
""")
DT = 0.02


def memory_of(reward):
    class Controller:
        memory = json.dumps(memory_data(reward))

    return ControllerMemory.of(Controller())


def paths(behaviour, runs=6, samples=80):
    """Signals that wander: some runs pass through phases in order, all leave them."""
    steps = np.random.default_rng(5).normal(0, 0.3, (samples, runs, len(behaviour.signal_names)))
    return np.cumsum(steps, axis=0).astype(np.float32)


@pytest.mark.parametrize("behaviour", [TIMED, DEADBANDS], ids=lambda behaviour: behaviour.name)
@pytest.mark.parametrize("form", [Schedule(1.0), Stay(), Potential(0.99)], ids=lambda form: form.name)
def test_it_shows_what_the_reward_shows(behaviour, form):
    reward = DescribedReward(behaviour, form, DT)
    memory = memory_of(reward)
    signals = paths(behaviour)
    theirs, ours = reward.init(signals[0]), memory.begun(signals[0])
    in_jax = memory.begun(jnp.asarray(signals[0]))
    after = jax.jit(lambda remembered, now: memory.after(remembered, now, DT))
    for now in signals[1:]:
        theirs, _, _ = reward.step(theirs, now)
        # By way of numbers, so that nothing else is remembered.
        ours = memory.after(memory.recalled(memory.numbers(ours, now)), now, DT)
        in_jax = after(in_jax, jnp.asarray(now))
        shown = reward.observe(theirs, now)
        np.testing.assert_allclose(memory.shown(ours, now), shown, atol=1e-5)
        np.testing.assert_allclose(memory.shown(in_jax, jnp.asarray(now)), shown, atol=1e-5)
    assert np.ptp(shown, axis=0).max() > 0


def test_what_only_pays_is_not_remembered():
    assert len(memory_of(DescribedReward(TIMED, Stay(), DT)).real) == 1
    memory = memory_of(DescribedReward(TIMED, Schedule(1.0), DT))
    assert memory.real.tolist() == [False, False, True, False]


def test_a_state_feedback_has_none():
    assert ControllerMemory.of(object()) is None
