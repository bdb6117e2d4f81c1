"""Walking as a task: a plant, a behaviour's reward and an episode of T seconds, in pure functions."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.squashing import SQUASHINGS, Squashing
from coachable.envs.task import Task as Task
from coachable.envs.task import Timestep as Timestep
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.named import make_plant
from coachable.plants.outcome import Outcome
from coachable.plants.plant import Plant
from coachable.plants.sampled import CLOCKS, SampledState, Sampling, sampled_step
from coachable.plants.sampled import Clock as Clock
from coachable.rewards.described_reward import DescribedReward, RewardMemory
from coachable.rewards.forms import RewardForm, form_from_data
from coachable.rewards.setup import Observe, RewardSetup, Semantics, TimeLimit
from coachable.rewards.terms import StepFacts, full_reward, reward_terms

Box = tuple[float | tuple[float, ...], float | tuple[float, ...]]
"""Lowest and highest control, each one number for all or one each."""

NO_BOX: Box = (-math.inf, math.inf)
"""A box that lets every control through, for the baselines."""

SHARED_EVALUATION_EVERY = 10_000
"""Training steps between two evaluations, each of which moves the training walker, in the released code."""


class WalkingState(eqx.Module):
    """Where a walking task stands. In `released-code` some of it outlives the episode, as in that code."""

    walk: SampledState
    observation: Float[Array, " state"]
    """x, except right after a shared evaluation moved the walker."""
    hip_x: Float[Array, ""]
    memory: RewardMemory
    """What the behaviour's reward remembers: the location before the next step, and more."""
    control: Float[Array, " control"]
    """Control of the step before."""
    total_steps: Int[Array, ""]
    """Control steps in this run."""

    @property
    def x(self) -> Float[Array, " state"]:
        """The plant's state."""
        return self.walk.x

    @property
    def foot_x(self) -> Float[Array, ""]:
        """Where the stance foot stands [m]."""
        return self.walk.foot_x

    @property
    def num_steps(self) -> Int[Array, ""]:
        """Control steps in this episode."""
        return self.walk.num_steps


class WalkingTask(Task):
    """An episode of a walking plant, paid by the terms of section III of Harnack et al., CDC 2023.

    A step holds the action, squashed into the box, for control_dt. With `clock="touchdown"` a touchdown ends
    the step early, so that the controller is asked again there; chatter is then a third touchdown without a
    full step in between. `weights` is an array, so that lanes with different reward setups are one vmapped
    program.
    """

    plant: Plant
    x0: Float[Array, " state"]
    weights: Float[Array, "5"]
    low: Float[Array, " control"]
    high: Float[Array, " control"]
    behaviour_reward: DescribedReward = eqx.field(static=True)
    semantics: Semantics = eqx.field(static=True, default="paper")
    clock: Clock = eqx.field(static=True, default="free")
    squashing: Squashing = eqx.field(static=True, default="clip")
    observe: Observe = eqx.field(static=True, default="nothing")
    time_limit: TimeLimit = eqx.field(static=True, default="terminates")
    control_dt: float = eqx.field(static=True, default=0.01)
    seconds: float = eqx.field(static=True, default=10.0)
    shared_evaluation_every: int = eqx.field(static=True, default=0)
    """After each so many training steps the released code's evaluation leaves the walker at x0; 0: never."""

    @property
    def observation_size(self) -> int:
        """The state's coordinates, and what is observed of the reward's memory."""
        return len(self.plant.state_names) + len(self.memory_names)

    @property
    def num_seen(self) -> int:
        """All of them but, with `observe="value-only"`, those of the memory."""
        num_hidden = len(self.memory_names) if self.observe == "value-only" else 0
        return self.observation_size - num_hidden

    @property
    def memory_names(self) -> tuple[str, ...]:
        """Names of the numbers behind the state's in an observation."""
        return () if self.observe == "nothing" else self.behaviour_reward.observation_names

    @property
    def action_size(self) -> int:
        """The controls."""
        return len(self.plant.control_names)

    @property
    def sampling(self) -> Sampling:
        """The sample clock, and the chatter rule of the semantics."""
        released = self.semantics == "released-code"
        rule = ChatterRule(None, self.control_dt / 10) if released else PAPER_CHATTER
        return Sampling(self.clock, self.control_dt, chatter=rule)

    @property
    def samples_in_time(self) -> int:
        """Full control steps that fill an episode."""
        return round(self.seconds / self.control_dt)

    @property
    def longest_episode(self) -> int:
        """No episode has more steps: with the touchdown clock two short ones may precede each full one."""
        return self.samples_in_time * (1 if self.clock == "free" else 3)

    def init(self, key: PRNGKeyArray | None = None) -> WalkingState:
        """Return the state in which a run starts: at x0, the stance foot at 0. Nothing is random."""
        dtype, reward = self.x0.dtype, self.behaviour_reward
        remember = reward.init if self.semantics == "paper" else reward.init_unseen
        return WalkingState(
            walk=SampledState.at(self.x0),
            observation=self.x0,
            hip_x=self.plant.base(self.x0, jnp.zeros((), dtype))[0],
            memory=remember(self._signals(self.x0)),
            control=jnp.zeros((self.action_size,), dtype),
            total_steps=jnp.zeros((), jnp.int32),
        )

    def reset(self, state: WalkingState, key: PRNGKeyArray | None = None) -> WalkingState:
        """Return the start of the next episode; the released code remembers its last location and torque."""

        def outlives(s):
            return (
                s.total_steps
                if self.semantics == "paper"
                else (s.total_steps, s.memory.phase.location, s.control)
            )

        return eqx.tree_at(outlives, self.init(), outlives(state))

    def observation(self, state: WalkingState) -> Float[Array, " observation"]:
        """Return the plant's state as the controller sees it, and what is observed of the memory."""
        return self._with_memory(state.observation, state.memory)

    def _with_memory(self, x: Float[Array, " state"], memory: RewardMemory) -> Float[Array, " observation"]:
        if self.observe == "nothing":
            return x
        zero = jnp.zeros((), x.dtype)
        return jnp.append(x, self.behaviour_reward.observed(memory.form, memory.phase.location, zero))

    def locate(self, x: Float[Array, " state"]) -> Int[Array, ""]:
        """Return the location of a state: a phase of the behaviour, or K outside."""
        return self.behaviour_reward.tracker.classifier(self._signals(x))

    def step(self, state: WalkingState, action: Float[Array, " control"]) -> tuple[WalkingState, Timestep]:
        """Hold the action, squashed into the box, for one control step and pay for where it led."""
        control = SQUASHINGS[self.squashing](action, self.low, self.high)
        sampling = self.sampling
        walk, taken = sampled_step(self.plant, sampling, state.walk, control)
        moved, fell = taken.moved, taken.fell
        if self.semantics == "released-code":
            base_fell = moved.outcome == Outcome.FELL
            walk = eqx.tree_at(
                lambda w: (w.x, w.foot_x),
                walk,
                (
                    jnp.where(base_fell, moved.segment_x, walk.x),
                    jnp.where(base_fell, moved.segment_foot_x, walk.foot_x),
                ),
            )
        x, foot_x = walk.x, walk.foot_x
        if sampling.restarts:
            time_is_up = taken.time_is_up(self.seconds, sampling)
        else:
            time_is_up = walk.num_steps >= self.samples_in_time

        hip_x = self.plant.base(x, foot_x)[0]
        ends = self.time_limit == "terminates"
        terminated, reward = (fell | time_is_up if ends else fell), self.behaviour_reward
        memory, paid, info = reward.step(state.memory, self._signals(x), terminated, moved.elapsed)
        facts = StepFacts(
            r_or=paid,
            unseen=state.memory.phase.location == reward.tracker.none_yet,
            hip_x=hip_x,
            previous_hip_x=state.hip_x,
            foot_x=foot_x,
            control=control,
            previous_control=state.control,
            first=state.num_steps == 0,
            fell=fell,
            time_is_up=time_is_up,
        )
        terms = reward_terms(facts, self.semantics)
        timestep = Timestep(
            observation=self._with_memory(x, memory),
            reward=full_reward(self.weights, terms),
            terminated=terminated,
            truncated=jnp.zeros((), bool) if ends else time_is_up & ~fell,
            fell=fell,
            terms=terms,
            hip_x=hip_x,
            foot_x=foot_x,
            time=taken.time,
            phase=info.phase,
            control=control,
        )
        after = WalkingState(
            walk=walk,
            observation=x,
            hip_x=hip_x,
            memory=memory,
            control=control,
            total_steps=state.total_steps + 1,
        )
        return self._shared_evaluation(after), timestep

    def _signals(self, x: Float[Array, " state"]) -> Float[Array, " signals"]:
        """Return what the behaviour speaks of."""
        return self.plant.signals(x, self.behaviour_reward.behaviour.signal_names)

    def _shared_evaluation(self, state: WalkingState) -> WalkingState:
        """Leave the walker where the released code's evaluation does, which runs on the same simulator."""
        if not self.shared_evaluation_every:
            return state
        evaluated = state.total_steps % self.shared_evaluation_every == 0
        return eqx.tree_at(
            lambda s: (s.walk.x, s.walk.foot_x),
            state,
            (jnp.where(evaluated, self.x0, state.x), jnp.where(evaluated, 0, state.foot_x)),
        )


def make_task(
    setup: RewardSetup,
    semantics: Semantics = "paper",
    reward_variant: RewardForm | str | None = None,
    clock: Clock = "free",
    parameters: Any = None,
    behaviour: Behaviour | None = None,
    seconds: float = 10.0,
    *,
    plant: Plant | str = "compass",
    box: Box | None = None,
    squashing: Squashing = "clip",
    shared_evaluation_every: int = 0,
) -> WalkingTask:
    """Return the walking task of a reward setup.

    Arguments:
        setup: the weights of the reward's terms, what is observed, and what T does.
        semantics: `paper`, or `released-code` with the quirks of the code that came with it.
        reward_variant: how r_or is read, unless the setup says so; by default `stay` in `paper` and
            `released` in `released-code`.
        clock: `free`, a sample every 0.01 s, or `touchdown`, where a touchdown restarts the sample clock.
        parameters: of the plant, a value of its parameters' dataclass; by default the plant's own.
        behaviour: what r_or pays for; by default the one that ships for the plant.
        seconds: T, the length of an episode.
        plant: a plant, or what `plant_class` takes. box: lowest and highest control; by default the plant's.
        squashing: how actions are kept in the box, `clip` or `tanh`.
        shared_evaluation_every: see `WalkingTask`; `SHARED_EVALUATION_EVERY` in released-code training.

    Raises `ParameterError` for an unknown plant, semantics, variant, clock or squashing, for parameters of
    another plant, for an episode shorter than one control step or longer than 100,000 s, and for a
    behaviour that reads signals the plant does not have.
    """
    for what, value, known in (
        ("semantics", semantics, _SEMANTICS),
        ("clock", clock, CLOCKS),
        ("squashing", squashing, tuple(SQUASHINGS)),
    ):
        if value not in known:
            raise ParameterError(f"unknown {what} {value!r}; {suggestion(value, known)}")
    seconds = real_number(seconds, "seconds", ParameterError, least=0.01, most=100_000)
    paper = semantics == "paper"
    plant = make_plant(plant, parameters).under(semantics)
    behaviour = behaviour or load_behaviour(plant.behaviour_under(semantics))
    low, high = plant.action_box if box is None else box
    form = form_from_data(setup.reward_variant) if setup.reward_variant is not None else reward_variant
    task = WalkingTask(
        plant=plant,
        behaviour_reward=DescribedReward(
            behaviour, form or ("stay" if paper else "released"), WalkingTask.control_dt
        ),
        x0=jnp.asarray(plant.start),
        weights=jnp.asarray(setup.weights),
        low=jnp.broadcast_to(jnp.asarray(low), len(plant.control_names)),
        high=jnp.broadcast_to(jnp.asarray(high), len(plant.control_names)),
        semantics=semantics,
        clock=clock,
        squashing=squashing,
        observe=setup.observe,
        time_limit=setup.time_limit,
        seconds=seconds,
        shared_evaluation_every=shared_evaluation_every,
    )
    task.plant.signals(task.x0, task.behaviour_reward.behaviour.signal_names)
    return task


_SEMANTICS: tuple[Semantics, ...] = ("paper", "released-code")
