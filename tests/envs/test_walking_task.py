"""The walking task pays and ends as both semantics say, line by line, and across episodes."""

import dataclasses
import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.automata.tracker import Memory, Stay
from coachable.behaviours import Behaviour, Comparison, Dwell, Phase, Signal, load_behaviour
from coachable.envs.walking_task import NO_BOX, make_task
from coachable.foundation.errors import ParameterError
from coachable.plants import START, ChatterRule, CompassParameters, CompassWalker, Outcome, advance
from coachable.rewards.described_reward import DescribedReward, RewardMemory
from coachable.rewards.forms import Equation, Potential, Schedule
from coachable.rewards.setup import PAPER_SETUPS, TERM_NAMES, RewardSetup

SETUP = RewardSetup("mixed", forward=0.3, orthant=0.7)
PAPER, RELEASED = "paper", "released-code"
each_semantics = pytest.mark.parametrize("semantics", [PAPER, RELEASED])

pytestmark = pytest.mark.usefixtures("x64")


compiled_step = jax.jit(lambda task, state, u: task.step(state, u))


def step(task, state, u):
    """One program for each kind of task; few kinds, for compiling them is most of the time here."""
    return compiled_step(task, state, jnp.asarray(u, float))


class LineByLine:
    """Both semantics in plain Python, with attributes that live as long as they should."""

    def __init__(self, semantics, seconds, shared_evaluation_every=0):
        self.released = semantics == RELEASED
        self.num_steps = round(seconds / 0.01)
        self.every = shared_evaluation_every
        self.total = 0
        self.last_action = self.last_orthant = None
        walker = CompassWalker(backward_passing_counts=self.released)
        rule = ChatterRule(None, 1e-3) if self.released else ChatterRule()
        self.advance = jax.jit(lambda x, foot_x, u: advance(walker, x, foot_x, u, 0.01, chatter=rule))
        self.reset()

    def reset(self):
        self.x, self.foot_x, self.step_count, self.last_hip = np.array(START), 0.0, 0, None
        if not self.released:
            self.last_action, self.last_orthant, self.last_hip = None, self.orthant(self.x), 0.0

    def orthant(self, x):
        """1 … 4, or −1 outside; a zero is a minus in the paper and nowhere in the code."""
        signs = {"+--+": 1, "++-+": 2, "-+-+": 3, "-+--": 4}
        if self.released and (x == 0).any():
            return -1
        return signs.get("".join("+" if value > 0 else "-" for value in x), -1)

    def step(self, u):
        self.total += 1
        self.step_count += 1
        moved = self.advance(jnp.asarray(self.x), jnp.asarray(self.foot_x), jnp.asarray(u))
        fell = int(moved.outcome) != Outcome.WALKING
        if self.released and int(moved.outcome) == Outcome.FELL:
            self.x, self.foot_x = np.array(moved.segment_x), float(moved.segment_foot_x)
        else:
            self.x, self.foot_x = np.array(moved.x), float(moved.foot_x)
        x, hip, done = self.x, self.foot_x - np.sin(self.x[0]), fell or self.step_count == self.num_steps
        terms = dict.fromkeys(TERM_NAMES, 0.0)
        if self.last_action is not None:
            change = np.sum((u - self.last_action) ** 2)
            terms["jerk"] = change if self.released else np.sqrt(change)
        if done and self.released:
            terms["distance"] = self.foot_x
        elif done and not fell:
            terms["distance"] = hip
        terms["fall"] = float(fell)
        if self.last_hip is not None:
            terms["forward"] = 1.0 if hip > self.last_hip else -1.0
        orthant, last = self.orthant(x), self.last_orthant
        if last is not None:
            if self.released:
                follows = orthant in (last, (last + 1) % 5)
            else:
                follows = orthant != -1 and (last == -1 or orthant in (last, last % 4 + 1))
            terms["orthant"] = 1.0 if follows else -1.0
        self.last_action, self.last_orthant, self.last_hip = u, orthant, hip
        observation = self.x
        if self.every and self.total % self.every == 0:
            self.x, self.foot_x = np.array(START), 0.0
        return observation, np.array(list(terms.values())), done, fell


def random_torques(seed, num):
    """Sometimes walking, sometimes wild, so that episodes end in every way."""
    rng = np.random.default_rng(seed)
    walking = np.array([-1.35, -0.18]) + rng.normal(0, 0.02, (num, 2))
    wild = rng.uniform(-2, 0, (num, 2))
    return np.clip(np.where((np.arange(num) // 150 % 2 == 0)[:, None], walking, wild), -2, 0)


@pytest.mark.parametrize(("semantics", "every"), [(PAPER, 0), (RELEASED, 0), (RELEASED, 170)])
def test_a_run_is_paid_line_by_line(semantics, every):
    task = make_task(SETUP, semantics, seconds=1.2, shared_evaluation_every=every)
    oracle = LineByLine(semantics, 1.2, every)
    reset, state = eqx.filter_jit(task.reset), task.init()
    falls, ends = 0, 0
    for u in random_torques(seed=1, num=1500):
        state, timestep = step(task, state, u)
        observation, terms, done, fell = oracle.step(u)
        np.testing.assert_allclose(timestep.observation, observation, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(timestep.terms, terms, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(timestep.reward, terms @ SETUP.weights, rtol=1e-12, atol=1e-12)
        assert (bool(timestep.terminated), bool(timestep.fell)) == (done, fell)
        assert not timestep.truncated
        np.testing.assert_array_equal(task.observation(state), timestep.observation)
        if done:
            falls, ends = falls + fell, ends + 1
            state = reset(state)
            oracle.reset()
    assert falls >= 3
    assert ends - falls >= 3


def test_shared_evaluation_moves_the_walker_but_not_what_the_controller_sees():
    task = make_task(SETUP, RELEASED, shared_evaluation_every=7)
    state = task.init()
    for _ in range(7):
        before, (state, timestep) = state, step(task, state, [-1.0, -0.5])
    np.testing.assert_array_equal(state.x, START)
    assert state.foot_x == 0
    np.testing.assert_array_equal(task.observation(state), timestep.observation)
    assert not np.allclose(timestep.observation, before.observation)
    assert state.num_steps == 7
    assert state.hip_x == timestep.hip_x


def falling_step(semantics):
    """A step in which the walker falls, from a state that is well under way."""
    task = make_task(SETUP, semantics)
    x, foot_x = jnp.array([1.55, 0.2, 3.0, 0.0]), jnp.array(0.7)
    before = eqx.tree_at(
        lambda s: (s.walk.x, s.observation, s.walk.foot_x, s.hip_x, s.walk.num_steps),
        task.init(),
        (x, x, foot_x, task.plant.base(x, foot_x)[0], jnp.asarray(9, jnp.int32)),
    )
    return (task, before, *step(task, before, [-1.0, -0.5]))


def test_a_fall_in_the_paper_ends_on_the_ground_and_pays_no_distance():
    task, _, state, timestep = falling_step(PAPER)
    assert timestep.fell
    np.testing.assert_allclose(task.plant.base(state.x, state.foot_x)[1], 0, atol=1e-12)
    assert timestep.terms[TERM_NAMES.index("fall")] == 1
    assert timestep.terms[TERM_NAMES.index("distance")] == 0


def test_a_fall_in_the_released_code_is_seen_from_before_the_step():
    _, before, state, timestep = falling_step(RELEASED)
    assert timestep.fell
    np.testing.assert_array_equal(state.x, before.x)
    np.testing.assert_array_equal(timestep.observation, before.observation)
    assert timestep.hip_x == before.hip_x
    assert timestep.terms[TERM_NAMES.index("distance")] == before.foot_x == 0.7
    assert timestep.terms[TERM_NAMES.index("forward")] == -1


@each_semantics
def test_an_episode_on_the_free_clock_has_exactly_its_steps(semantics):
    for seconds, num_steps in ((1.2, 120), (0.014, 1)):
        task = make_task(SETUP, semantics, seconds=seconds)
        state = task.init()
        for count in range(1, num_steps + 1):
            state, timestep = step(task, state, [-1.35, -0.18])
            assert bool(timestep.terminated) == (count == num_steps)
            np.testing.assert_allclose(timestep.time, 0.01 * count, rtol=1e-14)


@each_semantics
def test_the_touchdown_clock_samples_at_touchdowns(semantics):
    task = make_task(SETUP, semantics, clock="touchdown", seconds=3.0)
    state = task.init()
    times, touchdowns, ended = [0.0], 0, False
    while not ended:
        foot_x, (state, timestep) = state.foot_x, step(task, state, [-1.35, -0.18])
        ended = bool(timestep.terminated)
        lasted = float(timestep.time) - times[-1]
        times.append(float(timestep.time))
        if timestep.foot_x != foot_x:
            touchdowns += 1
            assert 0 < lasted < 0.01
            np.testing.assert_allclose(timestep.observation[0], -timestep.observation[1], atol=1e-12)
            assert state.walk.touchdowns_in_a_row == 1
        else:
            np.testing.assert_allclose(lasted, 0.01, rtol=1e-10)
            assert state.walk.touchdowns_in_a_row == 0
    assert touchdowns >= 3
    assert times[-2] < 3.0 <= times[-1]
    assert not timestep.fell
    assert len(times) - 1 <= task.longest_episode


@each_semantics
def test_a_third_touchdown_in_a_row_is_chatter_on_the_touchdown_clock(semantics):
    task = make_task(SETUP, semantics, clock="touchdown", seconds=3.0)
    about_to_touch_down = jnp.array([-0.298, 0.302, -1.46, -0.90])

    def with_touchdowns(count):
        state = eqx.tree_at(
            lambda s: (s.walk.x, s.observation, s.walk.touchdowns_in_a_row),
            task.init(),
            (about_to_touch_down, about_to_touch_down, jnp.asarray(count, jnp.int32)),
        )
        return step(task, state, jnp.zeros(2))[1]

    assert not with_touchdowns(1).fell
    chattered = with_touchdowns(2)
    assert chattered.fell
    assert chattered.terminated
    assert chattered.terms[TERM_NAMES.index("fall")] == 1


@each_semantics
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_state_that_is_not_finite_ends_the_episode_as_a_fall_and_is_not_seen(semantics, bad):
    task = make_task(SETUP, semantics, box=NO_BOX)
    state, _ = step(task, task.init(), [-1.0, -0.5])
    after, timestep = step(task, state, [bad, 0.0])
    assert timestep.fell
    assert timestep.terminated
    np.testing.assert_array_equal(timestep.observation, state.x)
    assert jnp.isfinite(task.reset(after).x).all()


@each_semantics
def test_actions_are_clipped_to_the_box(semantics):
    task = make_task(SETUP, semantics)
    _, wild = step(task, task.init(), [7.0, -9.0])
    _, tame = step(task, task.init(), [0.0, -2.0])
    np.testing.assert_array_equal(wild.control, [0.0, -2.0])
    jax.tree.map(np.testing.assert_array_equal, wild, tame)
    free = make_task(SETUP, semantics, box=NO_BOX)
    _, unclipped = step(free, free.init(), [7.0, -9.0])
    np.testing.assert_array_equal(unclipped.control, [7.0, -9.0])


def test_lanes_with_different_setups_are_one_vmapped_program():
    tasks = [make_task(setup) for setup in PAPER_SETUPS.values()]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *tasks)

    step_all = jax.jit(jax.vmap(lambda task, state, u: task.step(state, u), (0, 0, None)))
    states, _ = step_all(stacked, jax.vmap(lambda task: task.init())(stacked), jnp.array([-1.0, -0.5]))
    _, together = step_all(stacked, states, jnp.array([-1.2, -0.1]))
    np.testing.assert_allclose(together.terms, np.tile(together.terms[:1], (4, 1)))
    for index, task in enumerate(tasks):
        np.testing.assert_allclose(together.reward[index], together.terms[index] @ task.weights)


@each_semantics
@pytest.mark.parametrize("x64_on", [False, True])
def test_numbers_keep_the_precision_the_task_was_made_in(semantics, x64_on):
    with jax.enable_x64(x64_on):
        task = make_task(SETUP, semantics, shared_evaluation_every=3)
        before = task.init()
        state, timestep = eqx.filter_eval_shape(task.step, before, jnp.array([-1.0, -0.5]))
        dtype = jnp.float64 if x64_on else jnp.float32
        assert all(
            a.dtype == b.dtype for a, b in zip(jax.tree.leaves(before), jax.tree.leaves(state), strict=True)
        )
        for leaf in jax.tree.leaves(timestep):
            assert leaf.dtype in (dtype, jnp.int32, jnp.bool_)
        again = eqx.filter_eval_shape(task.reset, state)
        assert jax.tree.structure(again) == jax.tree.structure(before)


@pytest.mark.parametrize("x64_on", [False, True])
@pytest.mark.parametrize("form", [Equation(), Potential(0.9), Schedule(1.0)], ids=lambda form: form.name)
def test_what_a_form_remembers_keeps_its_types(form, x64_on):
    with jax.enable_x64(x64_on):
        task = make_task(SETUP, behaviour=load_behaviour("compass-walking-timed"), reward_variant=form)
        before = task.init()
        after, _ = eqx.filter_eval_shape(task.step, before, jnp.array([-1.0, -0.5]))
        types = [[(leaf.dtype, leaf.shape) for leaf in jax.tree.leaves(state)] for state in (before, after)]
        assert types[0] == types[1]


def test_the_reward_variant_can_be_chosen():
    def orthant_of_second_step_in_o1(variant):
        task = make_task(SETUP, reward_variant=variant)
        inside = eqx.tree_at(lambda s: s.walk.x, task.init(), jnp.array([0.2, -0.1, -1.0, 1.0]))
        state, entered = step(task, inside, jnp.zeros(2))
        _, stayed = step(task, state, jnp.zeros(2))
        return [float(timestep.terms[TERM_NAMES.index("orthant")]) for timestep in (entered, stayed)]

    assert orthant_of_second_step_in_o1(None) == [1, 1]
    assert orthant_of_second_step_in_o1("stay") == [1, 1]
    assert orthant_of_second_step_in_o1("equation") == [1, -1]


def test_a_behaviour_of_ones_own_is_what_is_paid_for():
    forward = Behaviour(
        "lean", "", (Signal("theta_1", "rad", ""),), (Phase("F", "", Comparison("theta_1", "<", -0.1)),), ()
    )
    task = make_task(SETUP, behaviour=forward)
    states = jnp.array([[-0.2, 0.0, 0.0, 0.0], [0.2, 0.0, 0.0, 0.0]])
    assert jax.vmap(task.locate)(states).tolist() == [0, 1]


def orthant_terms(behaviour, semantics, num_steps=60):
    """What r_or pays under the constant torque, the phases, and the states that they are of."""
    task = make_task(SETUP, semantics, behaviour=behaviour, reward_variant="stay")

    def step(state, _):
        state, timestep = task.step(state, jnp.array([-1.35, -0.18]))
        return state, (timestep.terms[TERM_NAMES.index("orthant")], timestep.phase, timestep.observation)

    _, steps = jax.jit(lambda: jax.lax.scan(step, task.init(), length=num_steps))()
    return [np.asarray(column).tolist() for column in steps]


@each_semantics
def test_dwell_times_are_paid_in_the_task(semantics):
    walking = load_behaviour("compass-walking")
    where = walking.phase_names.index("O3")
    limited = dataclasses.replace(walking.phases[where], dwell=Dwell(5.0, 0.03))
    others = tuple(limited if phase.name == "O3" else phase for phase in walking.phases)
    paid, phases, states = orthant_terms(dataclasses.replace(walking, phases=others), semantics)
    inside = [index for index, phase in enumerate(phases) if phase == where]
    first, last = inside[0], inside[-1]
    assert inside == list(range(first, last + 1))
    assert last - first > 5

    without, start = DescribedReward(walking), np.array(START)
    memory = without.init(start) if semantics == PAPER else without.init_unseen(start)
    plain = []
    for state in states:
        memory, pay, _ = without.step(memory, np.array(state))
        plain.append(float(pay))
    changed = [index for index, pay in enumerate(paid) if pay != plain[index]]
    # Four samples on it has been there for more than 0.03 s, and leaving comes before the 5 s are over.
    too_long, too_short = range(first + 4, last + 1), [last + 1] if first > 0 or semantics == PAPER else []
    assert changed == [index for index in [*too_long, *too_short] if plain[index] == 1]
    assert {paid[index] for index in changed} == {-1}


def test_the_next_episode_of_the_released_code_forgets_how_long_it_was_where_it_was():
    walking = load_behaviour("compass-walking")
    phases = tuple(dataclasses.replace(phase, dwell=Dwell(0.1, 0.2)) for phase in walking.phases)
    task = make_task(SETUP, RELEASED, behaviour=dataclasses.replace(walking, phases=phases))
    start = task.init()
    assert start.memory.phase.location == task.behaviour_reward.tracker.none_yet
    stay = Stay(jnp.asarray(0.07), jnp.asarray(True), jnp.asarray(0.0))
    remembered = Memory(jnp.asarray(1, jnp.int32), (stay,) * len(phases))
    again = task.reset(dataclasses.replace(start, memory=RewardMemory(remembered))).memory.phase
    assert (again.location, again.stays[1].time, again.stays[1].entered) == (1, 0, False)


def test_mistakes_are_refused_where_they_are_made():
    lame = Behaviour(
        "lame", "", (Signal("knee", "rad", ""),), (Phase("K", "", Comparison("knee", ">", 0)),), ()
    )
    with pytest.raises(ParameterError, match="'knee'"):
        make_task(SETUP, behaviour=lame)
    for seconds in (0.0, -1.0, float("nan"), float("inf"), 1e308):
        with pytest.raises(ParameterError, match="seconds"):
            make_task(SETUP, seconds=seconds)
    unchecked = inspect.unwrap(make_task)  # as users have it, without the tests' type checks
    with pytest.raises(ParameterError, match=r"semantics 'papper'.*'paper'"):
        unchecked(SETUP, "papper")
    with pytest.raises(ParameterError, match=r"clock 'fre'.*'free'"):
        unchecked(SETUP, clock="fre")


def test_another_walker_walks_differently():
    light = make_task(SETUP, parameters=CompassParameters(hip_mass=0.3, a=0.4))
    heavy = make_task(SETUP)
    steps = [step(task, task.init(), [-1.0, -0.5])[1] for task in (light, heavy)]
    assert not np.allclose(steps[0].observation, steps[1].observation)


def test_the_paper_default_is_the_shipped_behaviour():
    classifier = make_task(SETUP).behaviour_reward.tracker.classifier
    assert classifier.outside == len(load_behaviour("compass-walking").phases)


def test_legs_that_fall_backward_together_fall_as_in_the_released_code():
    """Without torque the released code's episodes last 181 steps, and their legs pass each other often."""
    task = make_task(PAPER_SETUPS["sparse"], RELEASED)

    state, ended = task.init(), []
    for count in range(1, 363):
        state, timestep = step(task, state, jnp.zeros(2))
        if timestep.terminated:
            ended.append(count)
            state = task.reset(state)
    assert ended == [181, 362]


TIMED = load_behaviour("compass-walking-timed")


def walked(task, num_steps):
    """Under the constant torque that walks."""

    def one(state, _):
        observation = task.observation(state)
        state, timestep = task.step(state, jnp.array([-1.35, -0.18]))
        return state, (observation, timestep)

    return jax.jit(lambda: jax.lax.scan(one, task.init(), length=num_steps))()[1]


def test_what_is_observed_of_the_memory_is_what_the_form_shows_of_it():
    form = {"form": "schedule", "skip_fine": 1.0}
    setup = RewardSetup("seeing", orthant=0.1, reward_variant=form, observe="memory")
    task = make_task(setup, behaviour=TIMED, seconds=2.0)
    blind = make_task(dataclasses.replace(setup, observe="nothing"), behaviour=TIMED, seconds=2.0)
    names = DescribedReward(TIMED, Schedule(1.0), 0.01).observation_names
    assert (task.observation_size, task.num_seen, task.memory_names) == (4 + len(names),) * 2 + (names,)
    observations, timesteps = walked(task, 120)
    _, unseen = walked(blind, 120)
    np.testing.assert_array_equal(timesteps.observation[:, :4], unseen.observation)
    np.testing.assert_array_equal(timesteps.reward, unseen.reward)
    np.testing.assert_array_equal(observations[1:], timesteps.observation[:-1])
    reward = DescribedReward(TIMED, Schedule(1.0), 0.01)
    states = np.concatenate([np.array([START]), unseen.observation])
    memory = reward.init(states[0])
    for x, seen in zip(states[1:], np.asarray(timesteps.observation), strict=True):
        memory, _, _ = reward.step(memory, x)
        np.testing.assert_allclose(seen[4:], reward.observe(memory, x), atol=1e-9)
    assert np.ptp(timesteps.observation[:, 4:], axis=0).min() > 0.9
    hidden = make_task(dataclasses.replace(setup, observe="value-only"), behaviour=TIMED, seconds=2.0)
    assert (hidden.observation_size, hidden.num_seen) == (task.observation_size, 4)


@pytest.mark.parametrize("clock", ["free", "touchdown"])
def test_the_time_truncates_where_the_setup_says_so_and_a_fall_terminates(clock):
    setup = dataclasses.replace(SETUP, time_limit="truncates")
    task, as_paper = (make_task(one, clock=clock, seconds=1.0) for one in (setup, SETUP))
    _, cut = walked(task, 140)
    _, ended = walked(as_paper, 140)
    assert not ended.truncated.any()
    last = int(np.argmax(ended.terminated))
    assert (np.argmax(cut.truncated), cut.terminated.any()) == (last, False)
    np.testing.assert_array_equal(cut.terms[: last + 1], ended.terms[: last + 1])  # the distance is paid
    assert cut.terms[last, TERM_NAMES.index("distance")] == pytest.approx(float(cut.hip_x[last]))
    fallen = eqx.tree_at(lambda s: s.walk.x, task.init(), jnp.array([1.5, 1.5, 9.0, 9.0]))
    _, timestep = step(task, fallen, jnp.zeros(2))
    assert (bool(timestep.terminated), bool(timestep.truncated)) == (True, False)


def test_a_setup_s_own_form_wins():
    setup = dataclasses.replace(SETUP, reward_variant="equation")
    assert make_task(setup, reward_variant="stay").behaviour_reward.form == Equation()
    assert make_task(SETUP, reward_variant="equation").behaviour_reward.form == Equation()
