"""Robots that make a step together give what each gives by its own `step`, and are read alike after it."""

import gymnasium
import numpy as np
import pytest

from coachable.envs.side_by_side.mujoco_robots import robots_of
from coachable.envs.signals.pack import signal_pack

mujoco = pytest.importorskip("mujoco")

NUM_ROBOTS = 3
WEIGHTS = {"forward_reward_weight": 0.7, "ctrl_cost_weight": 0.3}
FALLS_ON = {
    "healthy_reward": 0.6,
    "terminate_when_unhealthy": False,
    "exclude_current_positions_from_observation": False,
}
CASES = {
    "walker": ("Walker2d-v5", {}),
    "walker that falls on": ("Walker2d-v5", WEIGHTS | FALLS_ON | {"healthy_z_range": (1.1, 1.3)}),
    "hopper": ("Hopper-v5", {}),
    "cheetah": ("HalfCheetah-v5", WEIGHTS),
    "ant": ("Ant-v5", {}),
    "ant that pays for contacts": (
        "Ant-v5",
        WEIGHTS
        | {"contact_cost_weight": 0.07, "contact_force_range": (-0.3, 0.5), "healthy_z_range": (0.4, 0.9)},
    ),
    "ant that falls on": (
        "Ant-v5",
        FALLS_ON
        | {
            "main_body": "aux_1",
            "frame_skip": 3,
            "healthy_z_range": (0.4, 0.7),
            "include_cfrc_ext_in_observation": False,
        },
    ),
    "humanoid": ("Humanoid-v5", {}),
    "humanoid that pays for contacts": (
        "Humanoid-v5",
        WEIGHTS
        | {
            "contact_cost_weight": 1e-5,
            "contact_cost_range": (0.5, 3.0),
            "include_cinert_in_observation": False,
            "include_qfrc_actuator_in_observation": False,
        },
    ),
    "humanoid that falls on": (
        "Humanoid-v5",
        FALLS_ON
        | {
            "frame_skip": 3,
            "healthy_z_range": (0.5, 1.2),
            "include_cvel_in_observation": 1,  # Gymnasium's are there only for `True`
            "include_cfrc_ext_in_observation": False,
        },
    ),
}
NEVER_END = ("cheetah", "walker that falls on", "ant that falls on", "humanoid that falls on")


def made(env, options=None):
    return gymnasium.make(env, disable_env_checker=True, **options or {})


class Twins:
    """Robots that make their steps together, and others of which each makes the same by itself."""

    def __init__(self, env, options=None):
        self.together = [made(env, options) for _ in range(NUM_ROBOTS)]
        self.alone = [made(env, options) for _ in range(NUM_ROBOTS)]
        self.robots = robots_of(self.together)
        pack = signal_pack(env)
        names = tuple(signal.name for signal in pack.signals)
        self.read = {one: pack.row_reader(names) for one in (*self.together, *self.alone)}

    def reset(self, index, seed):
        ours, theirs = (envs[index].reset(seed=seed)[0] for envs in (self.together, self.alone))
        np.testing.assert_array_equal(ours, theirs)

    def step(self, draw):
        """One step of all, compared; it says who terminated."""
        size = self.together[0].action_space.shape
        actions = draw.uniform(-1, 1, (NUM_ROBOTS, *size)).astype(np.float32)
        ours = self.robots.step(actions)
        for index, (env, alone) in enumerate(zip(self.together, self.alone, strict=True)):
            observation, reward, terminated, _, info = alone.step(actions[index])
            np.testing.assert_array_equal(ours.observations[index], observation, strict=True)
            np.testing.assert_equal(ours.rewards[index], reward)
            np.testing.assert_equal(ours.infos[index], info)
            assert ours.terminated[index] == terminated
            np.testing.assert_array_equal(self.read[env](env), self.read[alone](alone))
            # What signals of one's own may read, too.
            felt, felt_alone = env.unwrapped.data.cfrc_ext, alone.unwrapped.data.cfrc_ext
            np.testing.assert_array_equal(felt, felt_alone)
        return ours.terminated


@pytest.mark.parametrize("case", CASES)
def test_robots_do_together_what_each_does_alone(case):
    twins, draw, num_ended = Twins(*CASES[case]), np.random.default_rng(3), 0
    for index in range(NUM_ROBOTS):
        twins.reset(index, seed=index)
    for step in range(300):
        terminated = twins.step(draw)
        num_ended += sum(terminated)
        for index in range(NUM_ROBOTS):
            if terminated[index] or step == 70 * (index + 1):
                twins.reset(index, seed=1000 + step)
    assert bool(num_ended) == (case not in NEVER_END)


@pytest.mark.parametrize(
    ("env", "state", "index", "number", "is_over"),
    [
        ("Ant-v5", "qpos", 5, np.nan, True),
        ("Ant-v5", "qvel", 5, np.nan, True),
        ("Ant-v5", "qpos", 2, 0.2, False),
        ("Ant-v5", "qpos", 2, 1.0, False),
        ("Humanoid-v5", "qpos", 5, np.nan, False),
        ("Humanoid-v5", "qpos", 2, 1.0, True),
        ("Humanoid-v5", "qpos", 2, 2.0, True),
    ],
)
def test_bounds_of_health_are_those_of_each(env, state, index, number, is_over, monkeypatch):
    def put(model, data, nstep):
        getattr(data, state)[index] = number

    monkeypatch.setattr(mujoco, "mj_step", put)
    twins = Twins(env)
    for robot in range(NUM_ROBOTS):
        twins.reset(robot, seed=1)
    assert twins.step(np.random.default_rng(0)) == [is_over] * NUM_ROBOTS


def test_what_is_not_as_gymnasium_makes_it_is_left_alone():
    walker = made("Walker2d-v5")
    assert robots_of([walker]) is not None
    assert robots_of([gymnasium.wrappers.ClipReward(walker, 0, 1)]) is None
    assert robots_of([made("Swimmer-v5")]) is None
