"""A described reward on anybody's Gymnasium environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import load_behaviour
from coachable.envs.signals.reading import OnNaN, Signals, numbers_of_one, reader_of_one, time_step
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.rewards.described_reward import DescribedReward, Shaping
from coachable.rewards.phase_reward import Variant
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
    | `rewards` | `base`, what the environment paid; `behaviour`, what this wrapper paid, with its weight |

    **Arguments:**
        behaviour: a `Behaviour`, or what `load_behaviour` takes.
        signals: what the behaviour reads: functions of (unwrapped environment, observation, info) by the
            signals' names, or a `SignalPack`; by default the environment's pack.
        weight: what the behaviour's reward is multiplied with.
        replace: whether it is paid in the place of the environment's own.
        variant, cycle_bonus, shaping: the form of the reward; see `DescribedReward`.
        dt: the time between two steps [s]; by default the environment's `dt`, or else 1/`render_fps`.
        on_nan: `"raise"`, or `"outside"` to take a state with a NaN signal as outside of all phases.
        append_phase: whether the phase follows the observation, as K+1 numbers of which one is 1. The reward
            depends on it, so that without it the problem is not Markov.
        key: where the info is, if `behaviour` is taken.

    **Raises:** `ParameterError` for a missing signal, an observation to which no phase can be appended and
    what `DescribedReward` raises; from `reset` and `step` `SignalError` for a signal that is no number.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        behaviour: Behaviour | str | Path,
        signals: Signals = None,
        weight: int | float = 1.0,
        replace: bool = False,
        *,
        variant: Variant = "stay",
        cycle_bonus: int | float = 0.0,
        shaping: Shaping | None = None,
        dt: int | float | None = None,
        on_nan: OnNaN = "raise",
        append_phase: bool = False,
        key: str = "behaviour",
    ):
        RecordConstructorArgs.__init__(
            self,
            behaviour=behaviour,
            signals=signals,
            weight=weight,
            replace=replace,
            variant=variant,
            cycle_bonus=cycle_bonus,
            shaping=shaping,
            dt=dt,
            on_nan=on_nan,
            append_phase=append_phase,
            key=key,
            _disable_deepcopy=True,
        )
        gymnasium.Wrapper.__init__(self, env)
        require_known_on_nan(on_nan)
        self.behaviour_reward = described_reward(env, behaviour, variant, dt, cycle_bonus, shaping)
        self._run = RunReward(self.behaviour_reward)
        self.on_nan: OnNaN = on_nan
        self.weight, self.replace, self.append_phase, self.key = weight, replace, append_phase, key
        behaviour = self.behaviour_reward.behaviour
        self._signal_names = behaviour.signal_names
        self._read = reader_of_one(env, self._signal_names, signals)
        if append_phase:
            self.observation_space = with_phase(env.observation_space, len(behaviour.phases) + 1)
        self._steps: int | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; nothing is remembered of the last one."""
        self._steps = None
        observation, info = self.env.reset(seed=seed, options=options)
        values = self._read(observation, info)
        begun = self._run.begin(numbers_of_one(self._signal_names, values, self.on_nan, 0))
        self._steps = 0
        seen = self._seen(observation, begun.location) if self.append_phase else observation
        return seen, self._told(info, begun, 0.0, 0.0)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step of the environment, paid for where it led."""
        if self._steps is None:
            raise ResetNeeded("no episode has begun; call reset()")
        observation, base, terminated, truncated, info = self.env.step(action)
        self._steps += 1
        values = self._read(observation, info)
        step = self._run.step(
            numbers_of_one(self._signal_names, values, self.on_nan, self._steps), bool(terminated)
        )
        base, ours = float(base), self.weight * step.paid
        reward = ours if self.replace else base + ours
        seen = self._seen(observation, step.location) if self.append_phase else observation
        return seen, reward, terminated, truncated, self._told(info, step, base, ours)

    def _told(self, info: dict[str, Any], step: RunStep, base: float, ours: float) -> dict[str, Any]:
        """The environment's info with what there is to tell of the behaviour."""
        if self.key in info:
            raise taken(self.key)
        return {
            **info,
            self.key: {
                "phase": step.phase,
                "location": step.location,
                "verdict": {**step.verdict},
                "cycles": step.cycles,
                "rewards": {"base": base, "behaviour": ours},
            },
        }

    def _seen(self, observation: Any, location: int) -> Any:
        phase = np.zeros(len(self.behaviour_reward.phase_names), observation.dtype)
        phase[location] = 1
        return np.concatenate([observation, phase])


def described_reward(
    env: Any,
    behaviour: Behaviour | str | Path,
    variant: Variant,
    dt: int | float | None,
    cycle_bonus: int | float,
    shaping: Shaping | None,
) -> DescribedReward:
    """The reward of a behaviour in an environment, which knows its own dt."""
    behaviour = behaviour if isinstance(behaviour, Behaviour) else load_behaviour(behaviour)
    return DescribedReward(behaviour, variant, time_step(env) if dt is None else dt, cycle_bonus, shaping)


def with_phase(space: gymnasium.Space, locations: int) -> gymnasium.spaces.Box:
    """The space of observations with a phase behind them.

    **Raises:** `ParameterError` for one that is no row of numbers.
    """
    if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
        raise ParameterError(
            f"append_phase needs observations that are a row of numbers, but they are {space}; put "
            "gymnasium.wrappers.FlattenObservation around the environment first"
        )
    low, high = np.zeros(locations, space.dtype), np.ones(locations, space.dtype)
    return gymnasium.spaces.Box(
        np.concatenate([space.low, low]), np.concatenate([space.high, high]), dtype=space.dtype.type
    )


def taken(key: str) -> ParameterError:
    """What to raise if the info of the environment has an entry of this name already."""
    return ParameterError(f"the environment's info has an entry {key!r} already; give another key")


def require_known_on_nan(on_nan: str) -> None:
    """Raise `ParameterError` for what is no `OnNaN`."""
    if on_nan not in ("raise", "outside"):
        raise ParameterError(f"unknown on_nan {on_nan!r}; {suggestion(on_nan, ('raise', 'outside'))}")
