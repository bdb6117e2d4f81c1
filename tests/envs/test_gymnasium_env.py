"""The Gymnasium environment is the walking task: its numbers, its ends, its seeds, its pictures."""

import warnings

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env

import coachable.envs  # noqa: F401  registers the environment
from coachable.behaviours import Behaviour, Comparison, Phase, Signal
from coachable.drawing.stage import SIZE
from coachable.envs.gymnasium_env import PlantEnv
from coachable.envs.start_distribution import Start
from coachable.envs.walking_task import make_task
from coachable.foundation.errors import BehaviourError, MissingExtraError, ParameterError
from coachable.plants.compass import START, CompassParameters, CompassWalker
from coachable.rewards.setup import PAPER_SETUPS, TERM_NAMES, RewardSetup

ID = "coachable/CompassWalker-v0"
WALKING = np.array([-1.35, -0.18], np.float32)
SHORT = 1.5
"""How long most episodes here last [s]: the same everywhere, as each length is compiled anew."""


def short(*arguments, **options):
    return PlantEnv(*arguments, seconds=SHORT, **options)


@pytest.fixture(autouse=True)
def no_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def near_walking(seed, num):
    rng = np.random.default_rng(seed)
    return (WALKING + rng.normal(0, 0.1, (num, 2))).astype(np.float32)


def run(env, actions, **reset):
    """The episode under these actions: what reset gave and what every step gave."""
    told = [env.reset(**reset)]
    for action in actions:
        told.append(env.step(action))
        if told[-1][2] or told[-1][3]:
            break
    return told


def test_it_is_made_by_its_name_and_from_a_fresh_import():
    env = gymnasium.make(f"coachable.envs:{ID}")
    assert isinstance(env.unwrapped, PlantEnv)
    assert env.spec is not None
    assert env.spec.id == ID


@pytest.mark.parametrize("semantics", ["paper", "released-code"])
@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_it_is_the_task_to_the_bit(semantics, clock):
    """Over several episodes, under a program of the task's own: a scan over the whole of each."""
    options = {"semantics": semantics, "clock": clock, "seconds": SHORT}
    env = PlantEnv("forward+orthant", **options)
    task = make_task(PAPER_SETUPS["forward+orthant"], **options)

    @jax.jit
    def scan(state, actions):
        def both(state, action):
            state, timestep = task.step(state, action)
            return state, (state, timestep)

        return jax.lax.scan(both, state, actions)[1]

    state = task.init()
    for episode in range(2):
        actions = near_walking(episode, 450)
        told = run(env, actions)
        states, timesteps = scan(state, actions)
        length = len(told) - 1
        observations = np.stack([observation for observation, *_ in told[1:]])
        rewards = np.array([reward for _, reward, *_ in told[1:]])
        assert observations.dtype == np.float32
        np.testing.assert_array_equal(told[0][0], np.float32(START))
        np.testing.assert_array_equal(observations, timesteps.observation[:length])
        np.testing.assert_array_equal(rewards, np.asarray(timesteps.reward[:length], float))
        assert np.flatnonzero(timesteps.terminated)[0] == length - 1
        for name in ("phase", "hip_x", "foot_x", "time", "fell"):
            seen = [info[name] for *_, info in told[1:]]
            np.testing.assert_array_equal(seen, np.asarray(getattr(timesteps, name)[:length]))
        terms = [[info["terms"][name] for name in TERM_NAMES] for *_, info in told[1:]]
        np.testing.assert_array_equal(terms, np.asarray(timesteps.terms[:length], float))
        last = jax.tree.map(lambda leaf, length=length: leaf[length - 1], states)
        state = task.reset(last)


def test_a_walk_to_the_end_is_terminated_by_the_time():
    told = run(short(), [WALKING] * 300)
    assert len(told) == 151
    *_, terminated, truncated, info = told[-1]
    assert (terminated, truncated, info["fell"]) == (True, False, False)
    assert info["time"] == pytest.approx(SHORT)
    assert info["terms"]["distance"] == pytest.approx(info["hip_x"])


def test_the_time_truncates_if_asked_to_and_a_fall_terminates_all_the_same():
    env = short(truncate=True)
    *_, terminated, truncated, info = run(env, [WALKING] * 300)[-1]
    assert (terminated, truncated) == (False, True)
    assert info["terms"]["distance"] == pytest.approx(info["hip_x"])
    *_, terminated, truncated, info = run(env, np.full((300, 2), -2.0))[-1]
    assert (terminated, truncated, info["fell"]) == (True, False, True)


def test_the_rewards_in_the_info_add_up_to_the_reward():
    env = short(RewardSetup("mixed", forward=0.3, orthant=0.7))
    for _, reward, _, _, info in run(env, near_walking(0, 200))[1:]:
        assert sum(info["rewards"].values()) == pytest.approx(reward, abs=1e-6)
        assert info["rewards"]["orthant"] == pytest.approx(0.7 * info["terms"]["orthant"])


def test_a_reset_gives_where_the_walker_stands_and_that_nothing_was_paid():
    _, info = short().reset()
    assert (info["phase"], info["hip_x"], info["foot_x"], info["time"], info["fell"]) == (4, 0, 0, 0, False)
    assert set(info["terms"].values()) == {0.0}


@pytest.mark.parametrize("distribution", ["normal", "uniform"])
def test_starts_repeat_with_the_seed_and_differ_without(distribution):
    env = short(start_noise=(0.1, 0.2, 0.0, 0.4), start_distribution=distribution)
    first, again, other = (env.reset(seed=seed)[0] for seed in (3, 3, 4))
    later = env.reset()[0]
    np.testing.assert_array_equal(first, again)
    assert first[2] == np.float32(START[2])
    assert not np.any(first[[0, 1, 3]] == other[[0, 1, 3]])
    assert not np.any(later[[0, 1, 3]] == other[[0, 1, 3]])


def test_noise_has_the_scale_that_was_asked_for():
    generator = np.random.default_rng(0)
    scales = np.array([0.1, 0.2, 0.3, 0.4])
    for distribution, spread in (("normal", scales), ("uniform", scales / np.sqrt(3))):
        start = Start(CompassWalker(), tuple(scales), distribution)
        drawn = np.stack([start.draw(generator) for _ in range(4000)])
        np.testing.assert_allclose(drawn.mean(axis=0), START, atol=0.03)
        np.testing.assert_allclose(drawn.std(axis=0), spread, rtol=0.05)
        assert np.all(np.abs(drawn) <= start.largest)
    box = np.stack([Start(CompassWalker(), 0.1, "uniform").draw(generator) for _ in range(1000)])
    assert np.abs(box - START).max() <= 0.1 + 1e-6


def test_the_first_phase_is_that_of_the_start():
    env = short(start_noise=0.3)
    for seed in range(20):
        observation, info = env.reset(seed=seed)
        assert info["phase"] == int(env.task.locate(jnp.asarray(observation)))
        assert info["hip_x"] == pytest.approx(-np.sin(observation[0]))


def test_a_seed_begins_a_new_run_and_a_reset_goes_on_with_it():
    """The released code remembers the last torque across episodes; who gives a seed wants to forget it."""
    env = short(semantics="released-code")

    def first_jerk(**reset):
        env.reset(**reset)
        return env.step(np.array([-1.0, -1.0]))[4]["terms"]["jerk"]

    assert first_jerk() == 0
    env.step(np.array([-2.0, -1.0]))
    assert first_jerk() == pytest.approx(1.0)
    assert first_jerk(seed=0) == 0


def test_torques_outside_of_the_box_are_clipped_to_it():
    env = short()
    (_, wild), (_, tame) = (run(env, [np.array(u)]) for u in ([7.0, -9.0], [0.0, -2.0]))
    np.testing.assert_array_equal(wild[0], tame[0])


def test_parameters_behaviour_and_variant_reach_the_task():
    light = run(short(parameters=CompassParameters(hip_mass=0.3)), [WALKING])[1][0]
    assert not np.allclose(light, run(short(), [WALKING])[1][0])
    lean = Behaviour(
        "lean", "", (Signal("theta_1", "rad"),), (Phase("F", "", Comparison("theta_1", "<", 0)),), ()
    )
    assert run(short(behaviour=lean), [WALKING])[1][4]["phase"] == 0
    stay, equation = (
        [info["terms"]["orthant"] for *_, info in run(short(reward_variant=v), [WALKING] * 5)[2:]]
        for v in ("stay", "equation")
    )
    assert stay == [1] * 4
    assert equation == [-1] * 4


def test_float64_of_the_users_changes_nothing():
    ours = run(short(), near_walking(1, 60))
    with jax.enable_x64(True):
        theirs = run(short(), near_walking(1, 60))
    for (one, *_), (other, *_) in zip(ours, theirs, strict=True):
        assert other.dtype == np.float32
        np.testing.assert_array_equal(one, other)


def test_what_was_returned_stays_as_it_was():
    env = short()
    told = run(env, near_walking(2, 20))
    kept = [observation.copy() for observation, *_ in told]
    for observation, *_ in told:
        observation += 1  # whose memory it is
    again = run(env, near_walking(2, 20))
    np.testing.assert_array_equal(kept, [observation for observation, *_ in again])


def bang_bang(seed):
    """Torques at the corners of the box, switched at random: the worst that can be done to the walker."""
    rng = np.random.default_rng(seed)
    hold = rng.integers(1, 60)
    return np.repeat(rng.choice([-2.0, 0.0], (1 + 1500 // hold, 2)), hold, axis=0)


class Whirl:
    """Whip the swing leg round whenever the stance leg lets it, and catch the walker with the ankle."""

    def __init__(self, gain):
        self.gain = gain

    def __call__(self, x):
        return np.array([-2.0 if self.gain * x[0] + x[2] > 0 else 0.0, -2.0])


def test_no_adversary_leaves_the_bounds():
    """Nor a tenth of them: they are what motors could do in all of the time if the walker did not fall."""
    env = PlantEnv(start_noise=(0.3, 0.5, 1.0, 2.0), start_distribution="uniform")
    bounds = env.observation_space.high
    assert np.isfinite(bounds).all()
    largest = np.zeros(4)
    for seed in range(24):
        x, _ = env.reset(seed=seed)
        torques, whirl = bang_bang(seed), Whirl(seed % 7 - 3)
        for step in range(1000):
            x, _, terminated, _, _ = env.step(torques[step] if seed % 2 else whirl(x))
            largest = np.maximum(largest, np.abs(x))
            if terminated:
                break
    assert env.observation_space.contains(largest.astype(np.float32))
    assert largest[3] > 10, "the adversary is a poor one"
    assert np.all(largest < bounds / 10)


@pytest.mark.parametrize("truncate", [False, True])
def test_gymnasium_is_content(truncate):
    env = gymnasium.make(ID, truncate=truncate, seconds=SHORT, start_noise=0.01, render_mode="rgb_array")
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        check_env(env.unwrapped)
    assert [str(w.message) for w in heard if "symmetric and normalized" not in str(w.message)] == []


def test_stable_baselines_is_content():
    checker = pytest.importorskip(
        "stable_baselines3.common.env_checker", reason="needs the [sb3] extra: pip install 'coachable[sb3]'"
    )
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        checker.check_env(short(), skip_render_check=False)
    assert [str(w.message) for w in heard if "symmetric and normalized" not in str(w.message)] == []


def test_a_picture_shows_the_walker():
    env = short(render_mode="rgb_array")
    with pytest.raises(ResetNeeded):
        env.render()
    run(env, [WALKING] * 30)
    first = env.render()
    assert first is not None
    assert first.shape == (SIZE[1], SIZE[0], 3)
    assert first.dtype == np.uint8
    env.step(WALKING)
    assert np.any(env.render() != first)


def test_legs_keep_their_marks_through_touchdowns():
    """The first leg's mass is filled in the pictures: it must be known which leg stands."""
    env = short(render_mode="rgb_array")
    env.reset()
    stood, feet = [], []
    for _ in range(150):
        *_, info = env.step(WALKING)
        feet.append(info["foot_x"])
        stood.append(env._touchdowns % 2)
    touched = np.flatnonzero(np.diff(feet))
    assert len(touched) >= 2
    np.testing.assert_array_equal(np.flatnonzero(np.diff(stood)), touched)


def test_a_window_opens_at_the_reset_and_closes():
    pytest.importorskip("pygame", reason="needs the [window] extra: pip install 'coachable[window]'")
    env = short(render_mode="human")
    run(env, [WALKING] * 3)
    assert env.render() is None
    import pygame

    shown = pygame.surfarray.array3d(pygame.display.get_surface())
    assert shown.shape == (*SIZE, 3)
    assert len(np.unique(shown)) > 10
    env.close()
    env.close()
    assert not pygame.display.get_init()


def test_without_pygame_a_window_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'coachable\[window\]'"):
        short(render_mode="human").reset()


def test_mistakes_are_named():
    env = short()
    with pytest.raises(ResetNeeded):
        env.step(WALKING)
    run(env, np.full((300, 2), -2.0))
    with pytest.raises(ResetNeeded):
        env.step(WALKING)
    env.reset()
    with pytest.raises(InvalidAction, match=r"u1, u2.*\(3,\)"):
        env.step(np.zeros(3))
    with pytest.raises(ParameterError, match=r"'orthnt'.*'orthant'"):
        PlantEnv("orthnt")
    with pytest.raises(BehaviourError, match="compass-walking"):
        PlantEnv(behaviour="compass-walkin")
    for noise in (-0.1, float("nan"), (0.1, 0.2)):
        with pytest.raises(ParameterError, match=r"start_noise.*theta_1"):
            PlantEnv(start_noise=noise)
    with pytest.raises(ParameterError, match="render_mode"):
        PlantEnv(render_mode="rgb")


SEEING = RewardSetup(
    "seeing",
    orthant=0.1,
    observe="memory",
    time_limit="truncates",
    reward_variant={"form": "schedule", "skip_fine": 1.0},
)


def test_what_the_setup_lets_be_observed_is_in_the_observation():
    env = short(SEEING, behaviour="compass-walking-timed")
    told = run(env, [WALKING] * 300)
    size = 4 + len(env.task.memory_names)
    observations = np.stack([observation for observation, *_ in told])
    assert observations.shape == (151, size)
    assert all(env.observation_space.contains(each) for each in observations)
    assert np.ptp(observations[:, 4:], axis=0).min() > 0.9
    assert told[-1][2:4] == (False, True)
    env = short(SEEING, behaviour="compass-walking-timed", render_mode="rgb_array")
    env.reset()
    assert env.render().shape == (*SIZE[::-1], 3)


def test_an_environment_shows_nobody_but_the_policy():
    with pytest.raises(ParameterError, match="value-only"):
        PlantEnv(RewardSetup("hidden", observe="value-only"))
