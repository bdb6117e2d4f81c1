"""Copies that are stepped side by side give what each of them gives by its own `step`, to the bit."""

import gymnasium
import numpy as np
import pytest

from coachable.envs.episode_log import EndedEpisodes, EpisodeLog
from coachable.envs.side_by_side import copies as side_by_side
from coachable.envs.side_by_side.copies import Copies
from coachable.experiments.assessment import assessment
from coachable.experiments.experiment import Lane
from coachable.experiments.plan import load_plan
from coachable.foundation.errors import SignalError

pytest.importorskip("mujoco")

NUM_COPIES = 3
SETUP = {"reward_variant": "schedule", "observe": "memory", "terms": {"alive": 1.0}}
CASES = {
    "walker": {"env": "Walker2d-v5", "behaviour": "walk"},
    "walker, cut off": {"env": "Walker2d-v5", "behaviour": "walk", "env_options": {"max_episode_steps": 15}},
    "walker, never cut off": {
        "env": "Walker2d-v5",
        "behaviour": "walk",
        "env_options": {"max_episode_steps": -1},
    },
    "walker, paid its own": {"env": "Walker2d-v5", "behaviour": "walk", "setups": {"own": {"weight": 0.5}}},
    "walker, paid by terms": {
        "env": "Walker2d-v5",
        "behaviour": "walk",
        "setups": {"terms": {"terms": {"reward_ctrl": 2.0, "alive": 1.0}, "mirror": False}},
    },
    "walker that falls on": {
        "env": "Walker2d-v5",
        "behaviour": "walk",
        "env_options": {
            "terminate_when_unhealthy": False,
            "exclude_current_positions_from_observation": False,
        },
        "setups": {"whole": SETUP | {"mirror": False}},
    },
    "hopper": {"env": "Hopper-v5", "behaviour": "hop"},
    "hopper, its speed from the info": {
        "env": "Hopper-v5",
        "behaviour": "hop",
        "signals": {"vertical_speed": {"info": "x_velocity", "at_reset": 0.0}},
    },
    "cheetah": {"env": "HalfCheetah-v5", "behaviour": "bound"},
    "ant": {"env": "Ant-v5", "behaviour": "trot"},
    "ant, paid its own": {"env": "Ant-v5", "behaviour": "trot", "setups": {"own": {"weight": 0.5}}},
    "ant that falls on": {
        "env": "Ant-v5",
        "behaviour": "trot",
        "env_options": {
            "terminate_when_unhealthy": False,
            "exclude_current_positions_from_observation": False,
            "include_cfrc_ext_in_observation": False,
            "max_episode_steps": 50,
        },
        "setups": {"terms": SETUP | {"terms": {"reward_contact": 2.0, "reward_ctrl": 1.0}}},
    },
    "humanoid": {"env": "Humanoid-v5", "behaviour": "walk"},
    "humanoid, its speed from the info": {
        "env": "Humanoid-v5",
        "behaviour": "walk",
        "env_options": {"include_cinert_in_observation": False},
        "signals": {"forward_speed": {"info": "x_velocity", "at_reset": 0.0}},
        "setups": {"own": {"weight": 0.5, "mirror": False}},
    },
}


def copies_of(experiment, wrap=lambda env: env):
    """The copies as a lane makes them, and the episodes that they have ended."""
    setup, ended = experiment.setups[0], EndedEpisodes()
    measure = assessment(experiment, Lane(setup.name, 0))

    def make():
        env = wrap(experiment.problem.training_environment(setup, experiment.evaluate_every))
        return EpisodeLog(env, ended, measure.sums_of, measure.fell_key)

    return Copies(make, [(7, number) for number in range(NUM_COPIES)]), ended


def walk(copies, num_steps):
    """All that a walk gives, with episodes that begin when others end."""
    draw = np.random.default_rng(3)
    size = copies.envs[0].action_space.shape or ()
    given = [np.array([copies.begin(index) for index in range(NUM_COPIES)])]
    for _ in range(num_steps):
        step = copies.step(np.clip(draw.normal(size=(NUM_COPIES, *size)), -1, 1).astype(np.float32))
        given += step
        given += [copies.begin(int(index)) for index in np.flatnonzero(step[2] | step[3])]
    return given


@pytest.mark.parametrize("case", CASES)
def test_layers_give_what_wrappers_give(case, monkeypatch):
    experiment = load_plan(None, **CASES[case])
    layered, ended = copies_of(experiment)
    assert layered._layers is not None
    given = walk(layered, 200)
    monkeypatch.setattr(side_by_side._Layers, "of", lambda envs: None)
    singly, ended_singly = copies_of(experiment)
    for ours, theirs in zip(given, walk(singly, 200), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert ended == ended_singly
    assert bool(ended.rows) == (case not in ("cheetah", "walker that falls on"))


@pytest.mark.parametrize("case", ["walker", "hopper", "ant", "humanoid"])
def test_an_episode_of_layers_is_found_again(case):
    experiment = load_plan(None, **CASES[case])
    copies, _ = copies_of(experiment)
    *_, observations, _, _, _ = (given for given in walk(copies, 9))
    found, _ = copies_of(experiment)
    again = [found.replay(index, copies.arrays()) for index in range(NUM_COPIES)]
    np.testing.assert_array_equal(again, observations)
    actions = np.zeros((NUM_COPIES, *(copies.envs[0].action_space.shape or ())), np.float32)
    for ours, theirs in zip(found.step(actions), copies.step(actions), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_other_wrappers_are_stepped_one_by_one():
    copies, _ = copies_of(load_plan(None, **CASES["walker"]), gymnasium.Wrapper)
    assert copies._layers is None


def test_a_robot_that_is_lost_is_named():
    copies, _ = copies_of(load_plan(None, **CASES["walker"]))
    walk(copies, 2)
    assert copies._layers is not None
    copies._layers.robots._mj_step = lambda model, data, frame_skip: data.qvel.fill(np.nan)
    with pytest.raises(SignalError, match="observation of Walker2d-v5 has NaN after step 3"):
        copies.step(np.zeros((NUM_COPIES, 6), np.float32))
