"""The vector environment gives what Gymnasium's own loop over single environments gives, number by number."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import coachable.envs  # noqa: F401  registers the environment
from coachable.drawing.stage import SIZE
from coachable.envs.gymnasium_env import PlantEnv
from coachable.envs.gymnasium_vector_env import PlantVectorEnv
from coachable.foundation.errors import ParameterError
from coachable.rewards.setup import RewardSetup

NUM = 5
OPTIONS = {"seconds": 1.2, "start_noise": (0.05, 0.05, 0.3, 0.3)}
CODE = {"truncate": True, "semantics": "released-code"}
SEEING = {
    "setup": RewardSetup("seeing", orthant=0.1, observe="memory", reward_variant={"form": "schedule"}),
    "behaviour": "compass-walking-timed",
}
each_mode = pytest.mark.parametrize("mode", list(AutoresetMode))


def native(mode=AutoresetMode.NEXT_STEP, **options):
    return gymnasium.make_vec(
        "coachable/CompassWalker-v0",
        num_envs=NUM,
        vectorization_mode="vector_entry_point",
        autoreset_mode=mode,
        **(OPTIONS | options),
    )


def theirs(mode, **options):
    def one():
        return PlantEnv(**(OPTIONS | options))

    return SyncVectorEnv([one] * NUM, autoreset_mode=mode)


def torques(seed, num):
    """Some walkers walk to the end of their time, some are pushed over, at different moments."""
    rng = np.random.default_rng(seed)
    walking = np.array([-1.35, -0.18]) + rng.normal(0, 0.05, (num, NUM, 2))
    pushed = rng.random((num // 60 + 1, NUM, 1)).repeat(60, axis=0)[:num] < 0.5
    return np.where(pushed, [-2.0, -2.0], walking).astype(np.float32)


def assert_same(one, other):
    """Equal values, dtypes, shapes and keys, all the way down."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, tuple):
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    elif isinstance(one, np.ndarray) and one.dtype == object:
        assert_same(tuple(one), tuple(other))
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        np.testing.assert_array_equal(one, other)
    else:
        assert one == other


@each_mode
@pytest.mark.parametrize("options", [{}, CODE, SEEING], ids=["", "code", "seeing"])
def test_it_is_gymnasiums_loop_over_single_environments(mode, options):
    ours, loop = native(mode, **options), theirs(mode, **options)
    assert_same(ours.reset(seed=7), loop.reset(seed=7))
    falls, time_ups = 0, 0
    for action in torques(0, 400):
        told = ours.step(action)
        assert_same(told, loop.step(action))
        _, _, terminated, truncated, info = told
        ended = terminated | truncated
        fell = info["final_info"]["fell"] if "final_info" in info else info["fell"]
        falls, time_ups = falls + np.sum(ended & fell), time_ups + np.sum(ended & ~fell)
        if mode is AutoresetMode.DISABLED and ended.any():
            assert_same(
                ours.reset(options={"reset_mask": ended}), loop.reset(options={"reset_mask": ended.copy()})
            )
    assert falls >= 3
    assert time_ups >= 3
    assert_same(ours.reset(), loop.reset())
    seeds = [3, None, 5, None, 7]
    assert_same(ours.reset(seed=seeds), loop.reset(seed=seeds))
    some = np.array([True, False, True, False, False])
    assert_same(
        ours.reset(seed=11, options={"reset_mask": some}),
        loop.reset(seed=11, options={"reset_mask": some.copy()}),
    )
    assert ours.np_random_seed == loop.np_random_seed
    assert_same(ours.step(torques(1, 1)[0]), loop.step(torques(1, 1)[0]))


def test_the_spaces_are_the_single_ones_in_a_batch():
    ours, loop = native(), theirs(AutoresetMode.NEXT_STEP)
    for space in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(ours, space) == getattr(loop, space)
    assert ours.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert ours.num_envs == NUM


def test_the_same_step_mode_gives_the_end_beside_the_new_start():
    env = native(AutoresetMode.SAME_STEP, start_noise=0.0)
    env.reset(seed=0)
    for _ in range(120):
        observation, _, terminated, _, info = env.step(np.tile([-1.35, -0.18], (NUM, 1)))
    assert terminated.all()
    np.testing.assert_array_equal(observation, np.tile(np.float32([0, 0, -0.4, 2]), (NUM, 1)))
    assert info["time"].tolist() == [0.0] * NUM
    assert info["_final_obs"].all()
    final = info["final_info"]
    np.testing.assert_allclose(final["time"], 1.2)
    np.testing.assert_array_equal(final["terms"]["distance"], final["hip_x"])
    stance = np.array([x[0] for x in info["final_obs"]])
    np.testing.assert_allclose(final["hip_x"], final["foot_x"] - np.sin(stance), atol=1e-6)


def test_a_walker_does_not_hear_of_its_neighbours():
    """Walkers beside it that fall and start anew leave a walker's numbers as they are, to the bit."""
    env = native()
    actions = torques(3, 130)
    quiet = actions.copy()
    quiet[:, 1:] = [-1.35, -0.18]

    def first_walker(actions):
        env.reset(seed=1)
        return np.stack([env.step(action)[0][0] for action in actions])

    np.testing.assert_array_equal(first_walker(actions), first_walker(quiet))


def test_what_was_returned_stays_as_it_was():
    env = native(AutoresetMode.SAME_STEP)
    observation, info = env.reset(seed=0)
    kept = [(observation, observation.copy(), info["hip_x"], info["hip_x"].copy())]
    for action in torques(0, 130):
        observation, *_, info = env.step(action)
        kept.append((observation, observation.copy(), info["hip_x"], info["hip_x"].copy()))
    for observation, copy, hip_x, hip_copy in kept:
        np.testing.assert_array_equal(observation, copy)
        np.testing.assert_array_equal(hip_x, hip_copy)


def test_every_walker_has_its_picture():
    env = native(render_mode="rgb_array")
    env.reset(seed=0)
    pictures = env.render()
    assert pictures is not None
    assert [picture.shape for picture in pictures] == [(SIZE[1], SIZE[0], 3)] * NUM
    assert np.any(pictures[0] != pictures[1])
    assert native().render() is None


def test_mistakes_are_named():
    env = native(AutoresetMode.DISABLED, start_noise=0.0)
    with pytest.raises(ResetNeeded):
        env.step(torques(0, 1)[0])
    with pytest.raises(ResetNeeded, match="never"):
        env.reset(options={"reset_mask": np.arange(NUM) == 0})
    env.reset(seed=0)
    with pytest.raises(InvalidAction, match="shape"):
        env.step(np.zeros((NUM, 3)))
    with pytest.raises(ValueError, match="2 seeds"):
        env.reset(seed=[1, 2])
    with pytest.raises(TypeError, match="reset_mask"):
        env.reset(options={"reset_mask": [True] * NUM})
    with pytest.raises(ValueError, match="no environment"):
        env.reset(options={"reset_mask": np.zeros(NUM, bool)})
    for _ in range(120):
        env.step(np.tile([-1.35, -0.18], (NUM, 1)))
    with pytest.raises(ResetNeeded, match=r"0, 1, 2, 3, 4.*reset_mask"):
        env.step(torques(0, 1)[0])
    with pytest.raises(ParameterError, match="num_envs is 0"):
        PlantVectorEnv(0)
    with pytest.raises(ParameterError, match="'SameStep'"):
        PlantVectorEnv(2, autoreset_mode="same")
    with pytest.raises(ParameterError, match="rgb_array"):
        PlantVectorEnv(2, render_mode="human")
