"""Walking as a task: a plant, a behaviour's reward and an episode of T seconds, in pure functions."""

import math
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.squashing import SQUASHINGS, Squashing
from coachable.envs.task import Task as Task
from coachable.envs.task import Timestep as Timestep
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.plants.compass import PAPER_PARAMETERS, START, CompassParameters, CompassWalker
from coachable.plants.event_search import PAPER_CHATTER, ChatterRule
from coachable.plants.integrate import Advance, advance
from coachable.plants.outcome import Outcome
from coachable.rewards.described_reward import DescribedReward, RewardMemory
from coachable.rewards.forms import RewardForm
from coachable.rewards.setup import RewardSetup, Semantics
from coachable.rewards.terms import StepFacts, full_reward, reward_terms

Clock = Literal["free", "touchdown"]

ACTION_BOX = ((-2.0, -2.0), (0.0, 0.0))
"""Lowest and highest torque (ankle, hip) of a policy [N m]; the released code's, the paper has none."""

NO_BOX = ((-math.inf, -math.inf), (math.inf, math.inf))
"""A box that lets every torque through, for the baselines."""

SHARED_EVALUATION_EVERY = 10_000
"""Training steps between two evaluations, each of which moves the training walker, in the released code."""


class WalkingState(eqx.Module):
    """Where a walking task stands. In `released-code` some of it outlives the episode, as in that code."""

    x: Float[Array, "4"]
    foot_x: Float[Array, ""]
    observation: Float[Array, "4"]
    """x, except right after a shared evaluation moved the walker."""
    hip_x: Float[Array, ""]
    memory: RewardMemory
    """What the behaviour's reward remembers: the location before the next step, and more."""
    control: Float[Array, "2"]
    """Torque of the step before."""
    num_steps: Int[Array, ""]
    """Control steps in this episode."""
    full_steps: Int[Array, ""]
    """Those of them that lasted control_dt."""
    time_in_others: Float[Array, ""]
    """How long the rest of them lasted [s]; apart from the full ones so that rounding does not pile up."""
    touchdowns_in_a_row: Int[Array, ""]
    """Touchdowns since the last full step."""
    total_steps: Int[Array, ""]
    """Control steps in this run."""


class WalkingTask(Task):
    """Ten seconds of compass walking, paid by the terms of section III of Harnack et al., CDC 2023.

    A step holds the action, squashed into the box, for control_dt. With `clock="touchdown"` a touchdown ends
    the step early, so that the controller is asked again there; chatter is then a third touchdown without a
    full step in between. `weights` is an array, so that lanes with different reward setups are one vmapped
    program.
    """

    plant: CompassWalker
    x0: Float[Array, "4"]
    weights: Float[Array, "5"]
    low: Float[Array, "2"]
    high: Float[Array, "2"]
    behaviour_reward: DescribedReward = eqx.field(static=True)
    semantics: Semantics = eqx.field(static=True, default="paper")
    clock: Clock = eqx.field(static=True, default="free")
    squashing: Squashing = eqx.field(static=True, default="clip")
    control_dt: float = eqx.field(static=True, default=0.01)
    seconds: float = eqx.field(static=True, default=10.0)
    shared_evaluation_every: int = eqx.field(static=True, default=0)
    """After each so many training steps the released code's evaluation leaves the walker at x0; 0: never."""

    @property
    def observation_size(self) -> int:
        """The state's four coordinates."""
        return 4

    @property
    def action_size(self) -> int:
        """Ankle and hip torque."""
        return 2

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
        dtype, count = self.x0.dtype, jnp.zeros((), jnp.int32)
        zero = jnp.zeros((), dtype)
        reward = self.behaviour_reward
        remember = reward.init if self.semantics == "paper" else reward.init_unseen
        return WalkingState(
            x=self.x0,
            foot_x=zero,
            observation=self.x0,
            hip_x=self.plant.hip(self.x0, zero)[0],
            memory=remember(self._signals(self.x0)),
            control=jnp.zeros((2,), dtype),
            num_steps=count,
            full_steps=count,
            time_in_others=zero,
            touchdowns_in_a_row=count,
            total_steps=count,
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

    def observation(self, state: WalkingState) -> Float[Array, "4"]:
        """Return x (θ1, θ2, θ̇1, θ̇2) as the controller sees it."""
        return state.observation

    def locate(self, x: Float[Array, "4"]) -> Int[Array, ""]:
        """Return the location of a state: a phase of the behaviour, or K outside."""
        return self.behaviour_reward.tracker.classifier(self._signals(x))

    def step(self, state: WalkingState, action: Float[Array, "2"]) -> tuple[WalkingState, Timestep]:
        """Hold the action, squashed into the box, for one control step and pay for where it led."""
        control = SQUASHINGS[self.squashing](action, self.low, self.high)
        moved = self._advance(state, control)
        fell = moved.outcome != Outcome.WALKING
        x, foot_x = moved.x, moved.foot_x
        if self.semantics == "released-code":
            hip_fell = moved.outcome == Outcome.FELL
            x = jnp.where(hip_fell, moved.segment_x, x)
            foot_x = jnp.where(hip_fell, moved.segment_foot_x, foot_x)

        cut_short = (moved.touchdowns > 0) & (self.clock == "touchdown") | fell
        full_steps = state.full_steps + ~cut_short
        time_in_others = state.time_in_others + jnp.where(cut_short, moved.elapsed, 0)
        time = full_steps.astype(x.dtype) * self.control_dt + time_in_others
        num_steps, total_steps = state.num_steps + 1, state.total_steps + 1
        if self.clock == "free":
            time_is_up = num_steps >= self.samples_in_time
        else:
            time_is_up = time >= self.seconds - 1e-3 * self.control_dt  # sums of short steps are not exact

        hip_x = self.plant.hip(x, foot_x)[0]
        terminated, reward = fell | time_is_up, self.behaviour_reward
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
            observation=x,
            reward=full_reward(self.weights, terms),
            terminated=terminated,
            truncated=jnp.zeros((), bool),
            fell=fell,
            terms=terms,
            hip_x=hip_x,
            foot_x=foot_x,
            time=time,
            phase=info.phase,
            control=control,
        )
        after = WalkingState(
            x=x,
            foot_x=foot_x,
            observation=x,
            hip_x=hip_x,
            memory=memory,
            control=control,
            num_steps=num_steps,
            full_steps=full_steps,
            time_in_others=time_in_others,
            touchdowns_in_a_row=jnp.where(cut_short, state.touchdowns_in_a_row + moved.touchdowns, 0),
            total_steps=total_steps,
        )
        return self._shared_evaluation(after), timestep

    def _signals(self, x: Float[Array, "4"]) -> Float[Array, " signals"]:
        """Return what the behaviour speaks of."""
        return self.plant.signals(x, self.behaviour_reward.behaviour.signal_names)

    def _advance(self, state: WalkingState, control: Float[Array, "2"]) -> Advance:
        """Move the plant, under the chatter rule of the semantics and the clock."""
        restarts = self.clock == "touchdown"
        released = self.semantics == "released-code" and not restarts
        return advance(
            self.plant,
            state.x,
            state.foot_x,
            control,
            self.control_dt,
            stop_at_touchdown=restarts,
            touchdowns_before=state.touchdowns_in_a_row if restarts else 0,
            chatter=ChatterRule(None, self.control_dt / 10) if released else PAPER_CHATTER,
        )

    def _shared_evaluation(self, state: WalkingState) -> WalkingState:
        """Leave the walker where the released code's evaluation does, which runs on the same simulator."""
        if not self.shared_evaluation_every:
            return state
        evaluated = state.total_steps % self.shared_evaluation_every == 0
        return eqx.tree_at(
            lambda s: (s.x, s.foot_x),
            state,
            (jnp.where(evaluated, self.x0, state.x), jnp.where(evaluated, 0, state.foot_x)),
        )


def make_task(
    setup: RewardSetup,
    semantics: Semantics = "paper",
    reward_variant: RewardForm | str | None = None,
    clock: Clock = "free",
    parameters: CompassParameters = PAPER_PARAMETERS,
    behaviour: Behaviour | None = None,
    seconds: float = 10.0,
    *,
    box: tuple[tuple[float, float], tuple[float, float]] = ACTION_BOX,
    squashing: Squashing = "clip",
    shared_evaluation_every: int = 0,
) -> WalkingTask:
    """Return the walking task of a reward setup.

    Arguments:
        setup: the weights of the reward's terms.
        semantics: `paper`, or `released-code` with the quirks of the code that came with it.
        reward_variant: how r_or is read; by default `stay` in `paper` and `released` in `released-code`.
        clock: `free`, a sample every 0.01 s, or `touchdown`, where a touchdown restarts the sample clock.
        parameters: masses, lengths and gravity. behaviour: what r_or pays for; by default compass walking.
        seconds: T, the length of an episode. box: lowest and highest torque (ankle, hip) [N m].
        squashing: how actions are kept in the box, `clip` or `tanh`.
        shared_evaluation_every: see `WalkingTask`; `SHARED_EVALUATION_EVERY` in released-code training.

    Raises `ParameterError` for an unknown semantics, variant, clock or squashing, for an episode shorter than
    one control step, and for a behaviour that reads signals the walker does not have.
    """
    for what, value, known in (
        ("semantics", semantics, _SEMANTICS),
        ("clock", clock, _CLOCKS),
        ("squashing", squashing, tuple(SQUASHINGS)),
    ):
        if value not in known:
            raise ParameterError(f"unknown {what} {value!r}; {suggestion(value, known)}")
    if not 0.01 <= seconds < math.inf:
        raise ParameterError(
            f"seconds must be finite and at least one control step, 0.01 s, but it is {seconds!r}"
        )
    paper = semantics == "paper"
    behaviour = behaviour or load_behaviour("compass-walking" if paper else "compass-walking-released")
    task = WalkingTask(
        plant=CompassWalker(parameters, backward_passing_counts=not paper),
        behaviour_reward=DescribedReward(
            behaviour, reward_variant or ("stay" if paper else "released"), WalkingTask.control_dt
        ),
        x0=jnp.asarray(START),
        weights=jnp.asarray(setup.weights),
        low=jnp.asarray(box[0]),
        high=jnp.asarray(box[1]),
        semantics=semantics,
        clock=clock,
        squashing=squashing,
        seconds=seconds,
        shared_evaluation_every=shared_evaluation_every,
    )
    task.plant.signals(task.x0, task.behaviour_reward.behaviour.signal_names)
    return task


_SEMANTICS: tuple[Semantics, ...] = ("paper", "released-code")
_CLOCKS: tuple[Clock, ...] = ("free", "touchdown")
