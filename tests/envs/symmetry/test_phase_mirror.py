"""Mirroring by phase: to the policy, one side is the other; whoever runs it does it alike."""

import json
from collections import OrderedDict

import gymnasium
import numpy as np
import pytest

from coachable.behaviours import load_behaviour
from coachable.behaviours.text.parser import parse
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.own_reward import OwnReward
from coachable.envs.problem import EnvironmentProblem
from coachable.envs.symmetry import derived
from coachable.envs.symmetry.derived import RobotMirror, derived_symmetry
from coachable.envs.symmetry.mujoco_mirror import mirrors_of
from coachable.envs.symmetry.phase_mirror import MirroredEnv, PhaseMirror
from coachable.envs.symmetry.signed_permutation import SignedPermutation
from coachable.experiments.assessment import actor
from coachable.foundation.errors import ParameterError
from coachable.learning.policy_controller import PolicyController
from coachable.rewards.forms import Schedule
from coachable.rewards.setup import DescribedSetup
from tests.learning.mirrored_walk import DT, random_policy

pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")

STEPS = parse("""
behaviour "steps"
signals
  left_foot_x   [m]
  right_foot_x  [m]
mirror left <-> right
phases
  left_ahead "the left foot is ahead" for at most 0.1 s: left_foot_x > right_foot_x
cycle
  left_ahead -> right_ahead
""")
FORM = Schedule(durations={"left_ahead": 0.1, "right_ahead": 0.1})


class Start(gymnasium.Wrapper):
    """A walker that begins in the mirror image of where it would."""

    def __init__(self, env, mirrored):
        super().__init__(env)
        self.mirror = next(each for each in mirrors_of(env.unwrapped.model) if each.exchanges)
        self.mirrored = mirrored

    def reset(self, **options):
        _, info = self.env.reset(**options)
        base = self.unwrapped
        if self.mirrored:
            base.set_state(*self.mirror.state(base.data.qpos.copy(), base.data.qvel.copy()))
            base.data.qacc_warmstart[:] = 0
        return base._get_obs(), info


@pytest.fixture(autouse=True, scope="module")
def few_states():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(derived, "NUM_STATES", 30)
        patch.setattr(derived, "NUM_TESTS", 5)
        yield


@pytest.fixture(scope="module")
def robot():
    return derived_symmetry(gymnasium.make("Walker2d-v5"), STEPS).mirror


def described(mirrored, observe):
    env = Start(gymnasium.make("Walker2d-v5", reset_noise_scale=0.1), mirrored)
    return BehaviourReward(OwnReward(env, {}), STEPS, form=FORM, observe=observe)


@pytest.mark.parametrize("observe", ["nothing", "memory"])
def test_an_episode_and_its_mirror_image_are_one_to_the_policy(robot, observe):
    ours, theirs = (described(mirrored, observe) for mirrored in (False, True))
    names = ours.behaviour_reward.observation_names if observe == "memory" else ()
    mirror = PhaseMirror.of(robot, STEPS, names)
    ours, theirs = MirroredEnv(ours, mirror), MirroredEnv(theirs, mirror)
    rng, halves = np.random.default_rng(0), []
    for seed in range(6):
        seen, image = (env.reset(seed=seed)[0] for env in (ours, theirs))
        np.testing.assert_allclose(image, seen, atol=1e-9)
        for _ in range(25):
            halves.append(ours.get_wrapper_attr("expected_phase"))
            assert theirs.get_wrapper_attr("expected_phase") == 1 - halves[-1]
            action = np.tanh(seen[:6]) + rng.normal(size=6)
            (seen, paid, *ends, _), (image, their_pay, *their_ends, _) = (
                env.step(action.astype(np.float32)) for env in (ours, theirs)
            )
            np.testing.assert_allclose(image, seen, atol=1e-6)
            assert their_pay == pytest.approx(paid, abs=1e-6)
            assert ends == their_ends
            if any(ends):
                break
    assert {*halves} == {0, 1}, "both halves must have been met"


def test_what_is_observed_of_the_memory_is_that_of_the_mirror_image(robot):
    names = BehaviourReward(
        gymnasium.make("Walker2d-v5"), STEPS, form=FORM
    ).behaviour_reward.observation_names
    mirror = PhaseMirror.of(robot, STEPS, names)
    assert names[:2] == ("expected left_ahead", "expected right_ahead")
    observation = np.append(np.arange(17.0), [0.0, 1.0, 0.3, 1.0])
    np.testing.assert_array_equal(mirror.observed(observation, 1)[17:], [1.0, 0.0, 0.3, 1.0])
    np.testing.assert_array_equal(mirror.observed(observation, 0), observation)
    np.testing.assert_array_equal(mirror.observed(observation, 2), observation, "no phase is expected")
    np.testing.assert_array_equal(mirror.done(np.arange(6.0), 1), [3.0, 4.0, 5.0, 0.0, 1.0, 2.0])


def test_a_mirror_is_read_back_as_it_was():
    mirror = PhaseMirror(
        SignedPermutation((1, 0, 2), (-1, -1, 1)), SignedPermutation((0,), (-1,)), (False, True, False)
    )
    assert PhaseMirror.from_json(json.dumps(mirror.to_data())) == mirror
    assert PhaseMirror.from_json("") is None


def test_without_a_mirror_in_the_description_nothing_is_mirrored():
    robot = RobotMirror(SignedPermutation((1, 0), (1, 1)), SignedPermutation((0,), (1,)))
    lone = load_behaviour("compass-walking")
    assert not any(PhaseMirror.of(robot, lone).phases)


def problem(env):
    return EnvironmentProblem(behaviour=STEPS, env=env, signals={"left_foot_x": 2, "right_foot_x": 5})


def setup(**options):
    return DescribedSetup(name="a", reward_variant={"form": "schedule", **FORM.to_data()}, **options)


def test_where_it_cannot_be_the_reason_is_told():
    hopper = problem("Hopper-v5")
    assert hopper.mirror(setup()) is None
    assert "has no left and right" in hopper.why_not_mirrored(setup())
    assert hopper.why_not_mirrored(setup(mirror=False)) == ""
    with pytest.raises(ParameterError, match=r"mirror = true: .*no left and right"):
        hopper.mirror(setup(mirror=True))


class Entries(gymnasium.ObservationWrapper):
    """A walker whose angles and velocities are entries of their own."""

    def __init__(self, order=dict, **options):
        super().__init__(gymnasium.make("Walker2d-v5", **options))
        parts = {"posture": 8, "motion": 9}
        box = {name: gymnasium.spaces.Box(-np.inf, np.inf, (size,)) for name, size in parts.items()}
        self.observation_space = gymnasium.spaces.Dict(order(box))

    def observation(self, observation):
        return {"posture": observation[:8], "motion": observation[8:]}


class Angles(Entries):
    """Between whose entries that of the memory, `behaviour`, comes."""

    def __init__(self, **options):
        super().__init__(**options)
        self.observation_space = gymnasium.spaces.Dict(
            {"angles": self.observation_space["posture"], "velocities": self.observation_space["motion"]}
        )

    def observation(self, observation):
        return {"angles": observation[:8], "velocities": observation[8:]}


gymnasium.register("Angles-v0", Angles, max_episode_steps=60)
gymnasium.register("Unsorted-v0", Entries, max_episode_steps=60, kwargs={"order": OrderedDict})


def of_entries(env, entry):
    signals = {"left_foot_x": {"observation": [entry, 2]}, "right_foot_x": {"observation": [entry, 5]}}
    options = {"terminate_when_unhealthy": False}
    return EnvironmentProblem(behaviour=STEPS, env=env, signals=signals, env_options=options)


def test_entries_of_a_dict_are_mirrored_in_one_row():
    plain, angles = problem("Walker2d-v5"), of_entries(f"{__name__}:Angles-v0", "angles")
    ours, theirs = (each.mirror(setup()) for each in (plain, angles))
    assert theirs == ours
    seeing = setup(observe="memory")
    mirror = angles.mirror(seeing)
    row = np.r_[np.arange(8.0), [0.0, 1.0, 0.3, 1.0], np.arange(8.0, 17.0)]
    expected = ours.observation(np.arange(17.0))
    np.testing.assert_array_equal(mirror.observed(row, 1), [*expected[:8], 1.0, 0.0, 0.3, 1.0, *expected[8:]])
    env = angles.environment(seeing)
    policy = random_policy(env, angles.policy_description(seeing))
    controller, act, memory, halves = PolicyController(policy), actor(policy, env), None, set()
    (seen, _), over = env.reset(seed=1), False
    while not over:
        own = np.r_[seen[:8], seen[12:]]
        signals = own[[2, 5]]
        action, memory = (
            controller.begin(own, signals) if memory is None else controller.step(memory, own, signals, DT)
        )
        np.testing.assert_allclose(action, act(seen), atol=1e-5)
        halves.add(env.get_wrapper_attr("expected_phase"))
        seen, _, terminated, truncated, _ = env.step(act(seen))
        over = terminated or truncated
    assert halves == {0, 1}


def test_entries_in_an_order_of_their_own_are_mirrored_without_a_memory_alone():
    unsorted = of_entries(f"{__name__}:Unsorted-v0", "posture")
    assert unsorted.mirror(setup()) == problem("Walker2d-v5").mirror(setup())
    assert "are not sorted" in unsorted.why_not_mirrored(setup(observe="memory"))


def test_a_setup_may_do_without():
    walker = problem("Walker2d-v5")
    assert walker.mirror(setup()) is not None
    assert walker.mirror(setup(mirror=False)) is None
    with pytest.raises(ParameterError, match="mirror must be true, false or 'samples'"):
        setup(mirror="yes")
