"""A described reward around anybody's environment: what is kept, what is added, and what is refused."""

import dataclasses
import math
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import FlattenObservation

from coachable.behaviours import Behaviour, Comparison, Dwell, Edge, Phase, Signal
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.own_reward import OwnReward
from coachable.envs.signals import signal_pack
from coachable.foundation.errors import ParameterError, SignalError
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import Potential


class Pacing(gymnasium.Env):
    """A walker on a line, who turns where he is told to, and stops at ±3."""

    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (1,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
    metadata = {"render_modes": [], "render_fps": 4}  # noqa: RUF012

    def __init__(self, limit=30):
        self.limit = limit

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = (options or {}).get("x", self.np_random.uniform(-1, 1))
        self.steps = 0
        return np.array([self.x]), {"x": self.x}

    def step(self, action):
        self.x += float(action[0])
        self.steps += 1
        over = abs(self.x) > 3
        return np.array([self.x]), self.x / 2, over, self.steps >= self.limit and not over, {"x": self.x}


def pacing(dwell=None):
    left = Phase("left", "", Comparison("x", "<", -0.2), dwell)
    right = Phase("right", "", Comparison("x", ">", 0.2))
    edges = (Edge("left", "right"), Edge("right", "left"))
    return Behaviour("pacing", "", (Signal("x"),), (left, right), edges, (edges,))


BY_OBSERVATION = {"x": lambda env, observation, info: observation[0]}
WAYS = {
    "observation": BY_OBSERVATION,
    "info": {"x": lambda env, observation, info: info["x"]},
    "environment": {"x": lambda env, observation, info: env.x},
}
FORMS = {
    "phases": {},
    "equation": {"form": "equation"},
    "cycles": {"cycle_bonus": 5.0},
    "shaping": {"form": Potential(0.9), "cycle_bonus": 1.0},
}


def wrapped(limit=30, behaviour=None, signals=BY_OBSERVATION, **options):
    return BehaviourReward(Pacing(limit), behaviour or pacing(), signals, **options)


def actions(seed, num=200):
    return np.random.default_rng(seed).uniform(-1, 1, (num, 1))


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_it_pays_what_the_pure_functions_pay_on_top_of_what_was_paid_before(way, form):
    env, plain = wrapped(signals=way, weight=0.5, **form), Pacing()
    reward, ends = DescribedReward(pacing(), **form), 0
    observation, _ = env.reset(seed=3)
    plain.reset(seed=3)
    memory = reward.init(observation)
    for action in actions(0):
        observation, total, terminated, truncated, info = env.step(action)
        its_observation, base, its_terminated, its_truncated, its_info = plain.step(action)
        memory, paid, step = reward.step(memory, observation, terminated)
        assert total == base + 0.5 * float(paid)
        np.testing.assert_array_equal(observation, its_observation)
        assert (terminated, truncated) == (its_terminated, its_truncated)
        told = info.pop("behaviour")
        assert info == its_info
        assert told["rewards"] == {"base": base, "behaviour": 0.5 * float(paid)}
        assert told["phase"] == (pacing().phase_at({"x": observation[0]}) or "outside")
        assert (told["location"], told["cycles"]) == (step.phase, step.cycles)
        assert told["verdict"] == {name: getattr(step, name) for name in told["verdict"]}
        if terminated or truncated:
            ends += 1
            memory = reward.init(env.reset()[0])
            plain.reset()
    assert ends > 3


def test_a_deadband_counts_as_it_does_in_the_pure_functions():
    left, right = (
        dataclasses.replace(phase, predicate=dataclasses.replace(phase.predicate, deadband=0.6))
        for phase in pacing().phases
    )
    sticky = dataclasses.replace(pacing(), phases=(left, right))
    env, reward, differs = wrapped(behaviour=sticky), DescribedReward(sticky), 0
    observation, _ = env.reset(seed=3)
    memory = reward.init(observation)
    for action in actions(2):
        observation, total, terminated, truncated, info = env.step(action)
        memory, paid, step = reward.step(memory, observation, terminated)
        told = info["behaviour"]
        assert (told["location"], total - told["rewards"]["base"]) == (step.phase, pytest.approx(paid))
        differs += told["phase"] != (sticky.phase_at({"x": observation[0]}) or "outside")
        if terminated or truncated:
            memory = reward.init(env.reset()[0])
    assert differs > 5


def test_it_can_take_the_place_of_what_was_paid():
    env = wrapped(weight=2.0, replace=True)
    env.reset(options={"x": 0.0})
    _, reward, *_, info = env.step([0.5])
    assert reward == 2.0
    assert info["behaviour"]["rewards"] == {"base": 0.25, "behaviour": 2.0}


def test_options_and_seeds_reach_the_environment():
    env = wrapped()
    observation, info = env.reset(options={"x": -1.0})
    assert observation == [-1.0]
    assert info["behaviour"]["phase"] == "left"
    first, _ = env.reset(seed=5)
    again, _ = env.reset(seed=5)
    assert first == again
    assert env.np_random_seed == 5


@pytest.mark.parametrize("form", [{}, {"cycle_bonus": 5.0, "form": Potential(0.9)}])
def test_nothing_of_an_episode_is_left_in_the_next(form):
    """An episode pays the same after any other, however that ended, as it does in a new environment."""
    env = wrapped(behaviour=pacing(Dwell(0.5, 1.0)), **form)

    def episode(env):
        told = [env.reset(options={"x": -0.9})]
        told += [env.step(action) for action in actions(1, 12) / 2]
        return told

    fresh = episode(wrapped(behaviour=pacing(Dwell(0.5, 1.0)), **form))
    for seed in range(5):
        env.reset(options={"x": -0.3})
        for action in actions(seed, 9):
            env.step(action)
        assert episode(env) == fresh


def test_dwell_times_are_kept_by_the_environments_clock():
    """Four pictures a second: half a second is two samples."""
    env = wrapped(behaviour=pacing(Dwell(0.5, 1.0)))
    assert env.behaviour_reward.dt == 0.25
    env.reset(options={"x": 1.0})

    def verdict(action):
        told = env.step([action])[-1]["behaviour"]
        return {name for name, holds in told["verdict"].items() if holds}

    assert verdict(-1.0) == set()
    assert verdict(-1.0) == {"follows"}
    assert verdict(1.0) == {"too_short"}
    # After an absence of one sample the stay would go on.
    assert verdict(0.0) == set()
    assert verdict(-1.0) == {"follows"}
    assert [verdict(0.0) for _ in range(6)] == [{"follows"}] * 4 + [{"too_long"}] * 2
    assert wrapped(dt=0.1).behaviour_reward.dt == 0.1


def test_the_phase_can_follow_the_observation():
    env = wrapped(observe="memory")
    assert env.observation_space == gymnasium.spaces.Box(
        np.array([-10.0, 0, 0, 0]), np.array([10.0, 1, 1, 1]), dtype=np.float64
    )
    assert env.reset(options={"x": 0.0})[0].tolist() == [0.0, 0, 0, 1]
    assert env.step([0.5])[0].tolist() == [0.5, 0, 1, 0]
    assert env.step([-1.0])[0].tolist() == [-0.5, 1, 0, 0]


@pytest.mark.parametrize("options", [{}, {"observe": "memory", "cycle_bonus": 1.0, "replace": True}])
def test_gymnasiums_checker_passes_it(options):
    gymnasium.register("coachable-test/Pacing-v0", entry_point=lambda **kwargs: Pacing(**kwargs))
    try:
        env = BehaviourReward(gymnasium.make("coachable-test/Pacing-v0"), pacing(), BY_OBSERVATION, **options)
        with pytest.warns(UserWarning, match="different from the unwrapped version"):
            check_env(env, skip_render_check=True)
    finally:
        gymnasium.registry.pop("coachable-test/Pacing-v0")


def test_two_behaviours_can_be_asked_for_at_once():
    env = BehaviourReward(wrapped(weight=2.0), pacing(), BY_OBSERVATION, weight=3.0, key="more")
    env.reset(options={"x": 0.0})
    _, reward, *_, info = env.step([1.0])
    assert reward == 0.5 + 2 + 3
    assert info["more"]["phase"] == info["behaviour"]["phase"] == "right"
    with pytest.raises(ParameterError, match="'behaviour' already; give another key"):
        BehaviourReward(wrapped(), pacing(), BY_OBSERVATION).reset()


class Still(gymnasium.Env):
    """Tells neither its clock nor numbers in a row."""

    observation_space = gymnasium.spaces.Dict({"x": gymnasium.spaces.Discrete(2)})
    action_space = gymnasium.spaces.Discrete(2)
    metadata = {"render_modes": []}  # noqa: RUF012


class Picture(Still):
    observation_space = gymnasium.spaces.Box(0, 255, (8, 8), np.uint8)


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: wrapped(signals={}), r"signal 'x' is missing in signals; known: none"),
        (lambda: wrapped(signals={"X": max}), r"signal 'x' is missing in signals; "),
        (lambda: wrapped(signals=None), "no id"),
        (lambda: wrapped(signals=signal_pack("Hopper-v5")), "Hopper-v5 has no signal 'x'"),
        (
            lambda: BehaviourReward(gymnasium.make("CartPole-v1"), pacing()),
            "no signal pack for 'CartPole-v1'",
        ),
        (lambda: BehaviourReward(Still(), pacing(Dwell(1.0)), BY_OBSERVATION), "dt is needed"),
        (lambda: BehaviourReward(Picture(), pacing(), WAYS["info"], observe="memory"), "FlattenObservation"),
        (
            lambda: BehaviourReward(gymnasium.wrappers.Autoreset(Pacing()), pacing(), WAYS["info"]),
            "put Autoreset around",
        ),
        (lambda: wrapped(weight=float("nan")), "weight must be a finite number, got nan"),
        (lambda: wrapped(form="stai"), "unknown reward form 'stai'; did you mean 'stay'"),
    ],
)
def test_mistakes_are_named_at_construction(make, complaint):
    with pytest.raises(ParameterError, match=complaint):
        make()


def test_without_the_tests_type_checks_what_is_no_function_and_an_unknown_on_nan_are_refused():
    program = """
import gymnasium, coachable as co
functions = dict.fromkeys(("theta_1", "theta_2", "dtheta_1", "dtheta_2"), lambda *args: 0.0)
cases = {"signals": {"theta_1": 3.0}}, {"on_nan": "outsid"}, {"observe": "memry", "signals": functions}
for options in cases:
    try:
        co.BehaviourReward(gymnasium.make("CartPole-v1"), "compass-walking", **options)
    except co.CoachableError as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "signal 'theta_1' must be a function of (env, observation, info)" in done.stdout
    assert "unknown on_nan 'outsid'; did you mean 'outside'?" in done.stdout
    assert "unknown observe 'memry'; did you mean 'memory'?" in done.stdout


@pytest.mark.parametrize(
    ("value", "complaint"),
    [
        (math.nan, "'x' is NaN"),
        (np.float32("nan"), "'x' is NaN"),
        (np.zeros(2), r"'x' must be one number, but .* its shape is \(2,\)"),
        (np.zeros(1), r"'x' must be one number, but .* its shape is \(1,\)"),
        ("left", "'x' must be one number, but .* it is 'left'"),
        (None, "'x' must be one number"),
    ],
)
def test_a_signal_that_is_no_number_is_named_where_it_happens(value, complaint):
    values = iter([value, 0.0, 0.0, value])
    env = wrapped(signals={"x": lambda env, observation, info: next(values)})
    with pytest.raises(SignalError, match=complaint) as told:
        env.reset()
    assert "after the reset" in str(told.value)
    env.reset()
    env.step([0.0])
    with pytest.raises(SignalError, match=complaint) as told:
        env.step([0.0])
    assert "after step 2" in str(told.value)


def test_a_nan_can_count_as_outside():
    values = iter([0.0, math.nan, 1.0])
    env = wrapped(signals={"x": lambda env, observation, info: next(values)}, on_nan="outside")
    env.reset()
    assert env.step([0.0])[-1]["behaviour"]["phase"] == "outside"
    assert env.step([0.0])[-1]["behaviour"]["phase"] == "right"


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (lambda env, observation, info: info["y"], "'x' is NaN after the reset, .* no entry 'y'"),
        (lambda env, observation, info: {}["y"], "'x' cannot be read after the reset: .* KeyError: 'y'"),
        (lambda env, observation, info: observation[7], "'x' cannot be read after the reset: .*IndexError"),
        (lambda env, observation, info: env.nothing, "after the reset: .*AttributeError: .*'nothing'"),
        (lambda env, observation, info: None, "'x' must be one number, but after the reset it is None"),
        (lambda env, observation, info: "0.5", "must be one number, but after the reset it is '0.5'"),
        (lambda env, observation, info: observation, r"'x' must be one number, .* its shape is \(1,\)"),
        (lambda env, observation, info: 1j, "must be one number, but after the reset it is 1j"),
        (lambda env, observation, info: np.datetime64("2020"), "'x' must be one number, but"),
        (lambda env, observation, info: np.ma.masked, "'x' is NaN after the reset; mend it"),
        (lambda env, observation, info: np.ma.array([1.0], mask=True)[0], "'x' is NaN after the reset"),
    ],
)
def test_a_function_that_reads_no_number_is_named(read, message):
    with pytest.raises(SignalError, match=message):
        wrapped(signals={"x": read}).reset()


class Paying(Pacing):
    """Pays what it is given to pay in its second step."""

    pays = 0.0

    def step(self, action):
        observation, reward, *others = super().step(action)
        return observation, self.pays if self.steps == 2 else reward, *others


@pytest.mark.parametrize(
    "pays", [np.array([0.5]), "0.5", None, math.nan, np.float32(math.nan), -math.inf, 1j, [1.0], np.ma.masked]
)
def test_a_reward_that_is_no_number_is_named_in_its_step(pays):
    env = BehaviourReward(Paying(), pacing(), BY_OBSERVATION)
    env.unwrapped.pays = pays
    env.reset()
    env.step([0.0])
    with pytest.raises(SignalError, match="reward of Paying must be one finite number, but after step 2 it"):
        env.step([0.0])


@pytest.mark.parametrize("pays", [1, True, np.float32(0.5), np.array(0.5), np.int64(3)])
def test_a_reward_of_another_type_is_a_number(pays):
    env = BehaviourReward(Paying(), pacing(), BY_OBSERVATION, weight=0.0)
    env.unwrapped.pays = pays
    env.reset()
    env.step([0.0])
    assert env.step([0.0])[1] == float(pays)


def test_a_step_needs_a_reset():
    env = wrapped()
    with pytest.raises(ResetNeeded):
        env.step([0.0])


WALK = """behaviour "one foot and the other"
signals
  left_foot_contact
  right_foot_contact
  pitch [rad]
phases
  left:  pitch < 0.5 [rad], left_foot_contact > 0.5, right_foot_contact < 0.5
  right for 0.016 s to 0.5 s:  pitch < 0.5 [rad], right_foot_contact > 0.5, left_foot_contact < 0.5
  both:  pitch < 0.5 [rad], left_foot_contact > 0.5, right_foot_contact > 0.5
cycle
  left -> both -> right -> left
"""
HOP = """behaviour "hops"
signals
  foot_contact
phases
  stance:  foot_contact > 0.5
  flight:  foot_contact < 0.5
cycle
  stance -> flight -> stance
"""


@pytest.mark.parametrize(("name", "text"), [("Walker2d-v5", WALK), ("Hopper-v5", HOP)])
def test_mujocos_robots_have_their_signals(name, text, tmp_path):
    pytest.importorskip("mujoco", reason="needs the [mujoco] extra: pip install 'coachable[mujoco]'")
    path = Path(tmp_path / "gait.behaviour")
    path.write_text(text, encoding="utf-8")
    env, plain = BehaviourReward(gymnasium.make(name), path, observe="memory"), gymnasium.make(name)
    behaviour = env.behaviour_reward.behaviour
    assert env.behaviour_reward.dt == pytest.approx(env.unwrapped.dt)
    read = signal_pack(env).reader(env, behaviour.signal_names)
    reward = DescribedReward(behaviour, dt=env.unwrapped.dt)
    observation, info = env.reset(seed=1)
    plain.reset(seed=1)
    memory = reward.init(np.array([*read(observation, info).values()]))
    seen, size = set(), plain.observation_space.shape[0]
    env.action_space.seed(0)
    for _ in range(150):
        action = env.action_space.sample()
        observation, total, terminated, truncated, info = env.step(action)
        its_observation, base, its_terminated, _, _ = plain.step(action)
        signals = read(observation, info)
        memory, paid, _ = reward.step(memory, np.array([*signals.values()]), terminated)
        np.testing.assert_array_equal(observation[:size], its_observation)
        assert total == base + float(paid)
        assert terminated == its_terminated
        assert info["behaviour"]["phase"] == (behaviour.phase_at(signals) or "outside")
        seen.add(info["behaviour"]["phase"])
        if terminated or truncated:
            observation, info = env.reset()
            plain.reset()
            memory = reward.init(np.array([*read(observation, info).values()]))
    assert len(seen) >= 2


class Nested(gymnasium.ObservationWrapper):
    """Shows where it is inside of a dictionary in a tuple."""

    observation_space = gymnasium.spaces.Dict(
        {"body": gymnasium.spaces.Tuple([Pacing.observation_space, gymnasium.spaces.Discrete(2)])}
    )

    def observation(self, observation):
        return {"body": (observation, 1)}


NESTED = {"x": lambda env, observation, info: observation["body"][0][0]}


def test_a_dictionary_gets_a_further_entry():
    env = BehaviourReward(Nested(Pacing()), pacing(), NESTED, observe="memory")
    observation, info = env.reset(options={"x": 1.0})
    assert {*observation} == {"body", "behaviour"}
    assert observation["behaviour"].tolist() == [0, 1, 0]
    assert info["behaviour"]["phase"] == "right"
    assert observation in env.observation_space
    observation, *_ = env.step([-1.0])
    assert observation["behaviour"].tolist() == [0, 0, 1]
    twice = BehaviourReward(env, pacing(), NESTED, observe="memory", key="more")
    assert {*twice.reset()[0]} == {"body", "behaviour", "more"}
    with pytest.raises(ParameterError, match="have an entry 'behaviour' already"):
        BehaviourReward(env, pacing(), NESTED, observe="memory")


def test_a_dictionary_can_be_flattened_first():
    class Named(gymnasium.ObservationWrapper):
        observation_space = gymnasium.spaces.Dict({"x": Pacing.observation_space})

        def observation(self, observation):
            return {"x": observation}

    env = BehaviourReward(FlattenObservation(Named(Pacing())), pacing(), BY_OBSERVATION, observe="memory")
    assert env.reset(options={"x": 1.0})[0].tolist() == [1.0, 0, 1, 0]


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda x: x / 0.0, "the environment Failing fails in step 2 with ZeroDivisionError"),
        (
            lambda x: (np.zeros(1), 10**5000, False, False, {}),
            "reward of Failing .* it is one of some 5,000 digits",
        ),
        (lambda x: (np.zeros(1), math.nan, False, False, {}), "reward of Failing .* after step 2 it is nan"),
        (
            lambda x: (np.full(1, math.nan), 0.0, False, False, {}),
            "observation of Failing has NaN after step 2",
        ),
        (
            lambda x: (np.zeros(1), 0.0, False, False, None),
            "info of Failing must be a dict, .* step 2 it is None",
        ),
        (lambda x: (np.zeros(1), 0.0, False, {}), "fails in step 2 with ValueError: not enough values"),
    ],
)
def test_what_an_environment_of_a_plan_does_wrong_is_a_sentence(fault, message):
    class Failing(Pacing):
        def step(self, action):
            done = super().step(action)
            return done if self.steps < 2 else fault(self.x)

    env = OwnReward(Failing(), {})
    env.reset(seed=0)
    env.step([0.0])
    with pytest.raises(SignalError, match=message):
        env.step([0.0])


def test_being_alive_is_a_term_of_every_environment():
    class Ending(Pacing):
        def step(self, action):
            observation, reward, _, truncated, info = super().step(action)
            return observation, reward, self.steps == 3, truncated, info

    env = OwnReward(Ending(), {"alive": 2.0})
    env.reset(seed=0)
    steps = [env.step([0.0]) for _ in range(3)]
    assert [step[1] for step in steps] == [2.0, 2.0, 0.0]
    env = OwnReward(Pacing(), {"aliev": 1.0})
    env.reset(seed=0)
    with pytest.raises(ParameterError, match="no term 'aliev'; there are 'alive' and"):
        env.step([0.0])
