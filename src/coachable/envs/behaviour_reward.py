"""A described reward on a Gymnasium environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs
from jaxtyping import Float

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.observed_memory import MemoryObserver, Observe
from coachable.envs.signals.reading import OnNaN, Signals, reader_of_one, require_info, reward_number
from coachable.envs.signals.time_step import one_step_counted, time_step
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import RewardForm
from coachable.rewards.run_reward import RunReward, RunStep


class BehaviourReward(gymnasium.Wrapper, RecordConstructorArgs):
    """Pays for a described behaviour on top of what an environment pays, or in its place.

        env = BehaviourReward(gymnasium.make("Walker2d-v5"), "walking.behaviour", weight=0.5)

    The environment's own reward, ends, seeds and options are kept. The memory is that of `DescribedReward`
    and begins anew with every reset; the first observation of an episode counts as the step before its first.

    **Info**, after a step and after a reset, under the key `behaviour`:

    | key | meaning |
    |---|---|
    | `phase` | name of the phase, or `outside` |
    | `location` | its number: 0 … K−1, or K outside all K phases |
    | `verdict` | whether it `follows` the behaviour, took an `edge`, left `too_short`, stays `too_long` |
    | `cycles` | how many cycles the step completed; counted if there is a cycle bonus |
    | `form` | what else the form of the reward has to report; absent if that is nothing |
    | `rewards` | `base`, what the environment paid; `behaviour`, what this wrapper paid, with its weight |

    **Arguments:**
        behaviour: a `Behaviour`, or what `load_behaviour` takes.
        signals: what the behaviour reads: functions of (unwrapped environment, observation, info) by the
            signals' names, or a `SignalPack`. By default the environment's pack, from which signals without a
            function are read as well.
        weight: what the behaviour's reward is multiplied with.
        replace: whether it is paid in the place of the environment's own.
        form, cycle_bonus: how the behaviour pays; see `DescribedReward`.
        dt: the time between two steps [s]; by default the environment's `dt`, or else 1/`render_fps`. It
            must be given where a wrapper takes several steps for one.
        on_nan: `"raise"`, or `"outside"` to take a state with a NaN signal as outside of all phases.
        observe: `"memory"` to append to the observation what the form shows of its memory, without which the
            problem is not Markov: for most forms the phase, as K+1 numbers of which one is 1. To a row of
            numbers they are appended, in a `Dict` they are a further entry.
        key: where the info, and in a `Dict` the memory, is found if `behaviour` is taken.

    **Raises:** `ParameterError` for a missing signal, a weight that is not finite, an observation to
    which nothing can be appended and what `DescribedReward` raises; from `reset` and `step` `SignalError` for
    a signal or a reward that is no number, and an info that is no dict.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        behaviour: Behaviour | str | Path,
        signals: Signals = None,
        weight: int | float = 1.0,
        replace: bool = False,
        *,
        form: RewardForm | str = "stay",
        cycle_bonus: int | float = 0.0,
        dt: int | float | None = None,
        on_nan: OnNaN = "raise",
        observe: Observe = "nothing",
        key: str = "behaviour",
    ):
        RecordConstructorArgs.__init__(
            self,
            behaviour=behaviour,
            signals=signals,
            weight=weight,
            replace=replace,
            form=form,
            cycle_bonus=cycle_bonus,
            dt=dt,
            on_nan=on_nan,
            observe=observe,
            key=key,
            _disable_deepcopy=True,
        )
        gymnasium.Wrapper.__init__(self, env)
        _require_ends_seen(env)
        require_known_on_nan(on_nan)
        real_number(weight, "weight", ParameterError)
        self.behaviour_reward = described_reward(env, behaviour, form, dt, cycle_bonus)
        self._run = RunReward(self.behaviour_reward)
        self.on_nan: OnNaN = on_nan
        self.weight, self.replace, self.key = weight, replace, key
        self._read = reader_of_one(env, self.behaviour_reward.behaviour.signal_names, signals, on_nan)
        self._observer = MemoryObserver.of(
            observe, self.behaviour_reward.observation_names, env.observation_space, key
        )
        if self._observer is not None:
            self.observation_space = self._observer.space
        self._steps: int | None = None
        self._untried_dt = untried_dt(self.behaviour_reward, dt)
        self.expected_phase = len(self.behaviour_reward.behaviour.phases)
        """The phase that the form expects now: that of its expected run, or the one that the robot is in."""

    @property
    def is_tried(self) -> bool:
        """Whether a step was seen to last as long as it is said to, or nothing depends on that."""
        return self._untried_dt is None

    @property
    def observer(self) -> MemoryObserver | None:
        """What puts the memory's numbers into observations."""
        return self._observer

    @property
    def memory_place(self) -> int | None:
        """Where in the flattened observation the memory's numbers begin; `None` if at the end, or nowhere."""
        return None if self._observer is None else self._observer.place

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; nothing is remembered of the last one."""
        self._steps = None
        observation, info = self.env.reset(seed=seed, options=options)
        require_info(info, self.env, 0)
        begun = self._run.begin(self._read(self.env, observation, info, 0))
        self._steps, self.expected_phase = 0, begun.expected
        if self._observer is not None:
            observation = self._observer.append(observation, begun.observed)
        return observation, self._info(info, begun, 0.0, 0.0)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step of the environment, paid for where it led."""
        if self._steps is None:
            raise ResetNeeded("no episode has begun; call reset()")
        if self._untried_dt is None:
            observation, base, terminated, truncated, info = self.env.step(action)
        else:
            with one_step_counted(self.env, self._untried_dt):
                observation, base, terminated, truncated, info = self.env.step(action)
            self._untried_dt = None
        reward, seen, info = self.paid(observation, base, terminated, info)
        if self._observer is not None:
            observation = self._observer.append(observation, seen)
        return observation, reward, terminated, truncated, info

    def paid(
        self, observation: Any, base: Any, terminated: Any, info: dict[str, Any]
    ) -> tuple[float, Float[np.ndarray, " numbers"], dict[str, Any]]:
        """What a step of the environment is paid, the numbers of the memory after it, and its info.

        **Arguments:** what the environment says of its step, which is the next one of the episode.
        """
        self._steps = (self._steps or 0) + 1
        require_info(info, self.env, self._steps)
        base = reward_number(base, self.env, self._steps)
        step = self._run.step(self._read(self.env, observation, info, self._steps), bool(terminated))
        self.expected_phase = step.expected
        ours = self.weight * step.paid
        reward = ours if self.replace else base + ours
        return reward, step.observed, self._info(info, step, base, ours)

    def _info(self, info: dict[str, Any], step: RunStep, base: float, ours: float) -> dict[str, Any]:
        """The environment's info with the behaviour's."""
        if self.key in info:
            raise taken(self.key)
        behaviour = {
            "phase": step.phase,
            "location": step.location,
            "verdict": {**step.verdict},
            "cycles": step.cycles,
            "rewards": {"base": base, "behaviour": ours},
        }
        if step.form:
            behaviour["form"] = {**step.form}
        return {**info, self.key: behaviour}


def described_reward(
    env: Any,
    behaviour: Behaviour | str | Path,
    form: RewardForm | str,
    dt: int | float | None,
    cycle_bonus: int | float,
) -> DescribedReward:
    """The reward of a behaviour in an environment, which knows its own dt."""
    behaviour = behaviour if isinstance(behaviour, Behaviour) else load_behaviour(behaviour)
    return DescribedReward(behaviour, form, time_step(env) if dt is None else dt, cycle_bonus)


def _require_ends_seen(env: gymnasium.Env) -> None:
    """Refuse an environment that begins anew by itself: the next episode would go on from the last one."""
    while isinstance(env, gymnasium.Wrapper):
        if isinstance(env, gymnasium.wrappers.Autoreset):
            raise ParameterError(
                "Autoreset begins episodes that a BehaviourReward around it does not see; "
                "put Autoreset around the BehaviourReward"
            )
        env = env.env


def untried_dt(reward: DescribedReward, dt: int | float | None) -> float | None:
    """The time step that is the environment's own and matters, so that the first step has to show it."""
    return reward.dt if dt is None and reward.tracker.has_dwells else None


def taken(key: str) -> ParameterError:
    """The error for an environment whose info has an entry of this name already."""
    return ParameterError(f"the environment's info has an entry {key!r} already; give another key")


def require_known_on_nan(on_nan: str) -> None:
    """Raise `ParameterError` for a value that is not an `OnNaN`."""
    if on_nan not in ("raise", "outside"):
        raise ParameterError(f"unknown on_nan {on_nan!r}; {suggestion(on_nan, ('raise', 'outside'))}")
