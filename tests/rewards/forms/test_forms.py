"""Every form pays alike in plain floats, NumPy, JAX and torch, alone and in wrappers, a new one as well."""

import dataclasses
from dataclasses import dataclass

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import Behaviour, Comparison, Dwell, Edge, Phase, Signal
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.vector_behaviour_reward import VectorBehaviourReward
from coachable.foundation.errors import ParameterError
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import BoundForm, Payment, Potential, RewardForm, Schedule
from coachable.rewards.forms.tables import Equation, Released, Stay
from coachable.rewards.run_reward import RunReward
from tests.automata.tracked import behaviour_of, descriptions


# An example of a form of your own: these two classes are all there is to write.
@dataclass(frozen=True)
class Explore(RewardForm):
    """Pays `amount` for the first step into each phase in an episode."""

    amount: float = 1.0

    def bind(self, behaviour, dt):
        return BoundExplore(self, behaviour, dt)


class BoundExplore(BoundForm):
    """Remembers for each phase whether the run was there; a policy may observe it."""

    def init(self, location, zero):
        return tuple(location == phase for phase in range(len(self.behaviour.phases)))

    def pay(self, memory, step):
        here = self.init(step.move.location, step.zero)
        after = tuple(seen | now for seen, now in zip(memory, here, strict=True))
        new = sum(after, start=step.zero) - sum(memory, start=step.zero)
        return after, Payment({"explore": self.form.amount * new}, new > 0, {"seen": sum(after, step.zero)})

    @property
    def observation_names(self):
        return tuple(f"was in {name}" for name in self.behaviour.phase_names)

    def observe(self, memory, location, zero):
        return tuple(zero + seen for seen in memory)


# The end of the example.


@dataclass(frozen=True)
class Hurry(RewardForm):
    """Pays for leaving soon: its memory is a time, its info has numbers of three kinds, and it needs dt."""

    def bind(self, behaviour, dt):
        if dt is None:
            raise ParameterError("Hurry needs dt")
        return BoundHurry(self, behaviour, dt)


class BoundHurry(BoundForm):
    def init(self, location, zero):
        return (zero,)

    def pay(self, memory, step):
        moved = step.move.location != step.move.previous
        time = memory[0] + step.elapsed
        paid = step.zero + moved / (1 + time)
        info = {"moved": moved, "number": moved * 1, "time": time}
        return (time * ~moved,), Payment({"hurry": paid}, moved, info)


def at(row, number):
    """One run of a batch, in Python's numbers."""
    return jax.tree.map(lambda leaf: leaf[number].item(), row)


FORMS = [Stay(), Equation(), Released(), Potential(0.9, {"P0": 2.0}), Schedule(0.5), Explore(), Hurry()]
XS = st.sampled_from([-0.3, -0.1, -0.05, 0.0, 0.05, 0.1, 0.3])
BATCH = 3


def with_cycle(behaviour):
    """With a cycle through all of its phases, whatever edges it had."""
    names = behaviour.phase_names
    cycle = tuple(Edge(*pair) for pair in zip(names, (*names[1:], names[0]), strict=True))
    edges = tuple(dict.fromkeys((*behaviour.edges, *cycle)))
    return dataclasses.replace(behaviour, edges=edges, cycles=(cycle,))


def named(behaviour):
    """With phases that are called P0, P1 and so on, none of which may last for ever."""
    new = {name: f"P{number}" for number, name in enumerate(behaviour.phase_names)}
    phases = tuple(
        dataclasses.replace(phase, name=new[phase.name], dwell=limited(phase.dwell))
        for phase in behaviour.phases
    )
    edges = tuple(Edge(new[edge.source], new[edge.target]) for edge in behaviour.edges)
    return dataclasses.replace(behaviour, phases=phases, edges=edges)


def limited(dwell):
    """A dwell time with an end."""
    return Dwell(0.0 if dwell is None else dwell.at_least, 1.0 if dwell is None else min(dwell.at_most, 1.0))


def followed(reward, signals, ended, step):
    """Rewards, infos and memories of a batch of runs, step after step, as NumPy arrays."""
    memory, rows = reward.init(signals[0]), []
    for sample in signals[1:]:
        memory, paid, info = step(memory, sample, ended)
        rows.append(jax.tree.map(np.asarray, (paid, info._asdict(), memory.form, memory.cycles)))
    return rows


@settings(max_examples=8)
@given(
    descriptions(),
    st.lists(st.lists(XS, min_size=BATCH, max_size=BATCH), min_size=2, max_size=8),
    st.lists(st.booleans(), min_size=BATCH, max_size=BATCH),
    st.sampled_from([0.0, 2.5]),
)
@pytest.mark.parametrize("form", FORMS, ids=lambda form: type(form).__name__)
def test_floats_numpy_jax_and_torch_agree(form, description, runs, ended, bonus):
    torch = pytest.importorskip("torch")
    reward = DescribedReward(with_cycle(named(behaviour_of(description))), form, 0.25, bonus)
    signals, ended = np.array(runs)[..., None], np.array(ended)
    expected = followed(reward, signals, ended, reward.step)
    with jax.enable_x64(True):
        in_jax = followed(reward, jnp.asarray(signals), jnp.asarray(ended), reward.step)
    in_torch = followed(reward, torch.from_numpy(signals), torch.from_numpy(ended), reward.step)
    jax.tree.map(np.testing.assert_array_equal, in_jax, expected)
    jax.tree.map(np.testing.assert_array_equal, in_torch, expected)
    for number in range(BATCH):
        run = RunReward(reward)
        run.begin(signals[0, number].tolist())
        for sample, row in zip(signals[1:], expected, strict=True):
            paid, info, form_memory, cycles = at(row, number)
            step = run.step(sample[number].tolist(), bool(ended[number]))
            assert (step.paid, step.memory) == (paid, (form_memory, cycles))
            assert (step.location, step.cycles, step.form) == (info["phase"], info["cycles"], info["form"])
            assert step.verdict == {name: info[name] for name in step.verdict}


class Line(gymnasium.Env):
    """A point on a line, which the action moves."""

    observation_space = gymnasium.spaces.Box(-9.0, 9.0, (1,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
    metadata = {"render_modes": [], "render_fps": 4}  # noqa: RUF012

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = (options or {}).get("x", self.np_random.uniform(-0.3, 0.3))
        return np.array([self.x]), {}

    def step(self, action):
        self.x += float(action[0])
        return np.array([self.x]), 0.0, abs(self.x) > 1, False, {}


@pytest.fixture
def line():
    left, right = Phase("left", "", Comparison("x", "<", -0.2)), Phase("right", "", Comparison("x", ">", 0.2))
    cycle = (Edge("left", "right"), Edge("right", "left"))
    return Behaviour("line", "", (Signal("x"),), (left, right), cycle, (cycle,))


ONE = {"x": lambda env, observation, info: observation[0]}
MANY = {"x": lambda env, observations, infos: observations[:, 0]}


def same(one, other):
    """Equal keys and arrays all the way down."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return all(map(same, one, other))
    if isinstance(one, np.ndarray) and one.dtype == object:
        return same((*one,), (*other,))
    return type(one) is type(other) and np.array_equal(one, other)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("form", [Explore(2.0), Hurry()], ids=lambda form: type(form).__name__)
def test_a_form_of_your_own_works_in_the_wrappers(form, mode, line):
    options = {"form": form, "observe": "memory", "cycle_bonus": 10.0}
    ours = VectorBehaviourReward(SyncVectorEnv([Line] * 2, autoreset_mode=mode), line, MANY, **options)
    loop = SyncVectorEnv([lambda: BehaviourReward(Line(), line, ONE, **options)] * 2, autoreset_mode=mode)
    assert ours.observation_space == loop.observation_space
    assert same(ours.reset(seed=3), loop.reset(seed=3))
    rng, paid = np.random.default_rng(0), 0.0
    for _ in range(60):
        actions = rng.uniform(-0.6, 0.6, (2, 1))
        step = ours.step(actions)
        assert same(step, loop.step(actions))
        paid += step[1].sum()
        ended = step[2] | step[3]
        if mode is AutoresetMode.DISABLED and ended.any():
            assert same(
                ours.reset(options={"reset_mask": ended.copy()}),
                loop.reset(options={"reset_mask": ended.copy()}),
            )
    assert paid > 0


def test_a_form_of_your_own_pays_what_it_should(line):
    env = BehaviourReward(Line(), line, ONE, form=Explore(), observe="memory")
    observation, _ = env.reset(options={"x": 0.0})
    assert observation.tolist() == [0.0, 0, 0]
    steps = [env.step([action]) for action in (-0.5, 0.0, 1.0, -1.0, 0.5)]
    assert [step[1] for step in steps] == [1.0, 0.0, 1.0, 0.0, 0.0]
    assert steps[-1][0][1:].tolist() == [1, 1]
    assert steps[-1][-1]["behaviour"]["form"] == {"seen": 2.0}


def test_a_form_that_needs_dt_says_so(line):
    with pytest.raises(ParameterError, match="Hurry needs dt"):
        DescribedReward(line, Hurry())
