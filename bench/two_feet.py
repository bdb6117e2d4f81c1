"""Walker2d, paid for going on one foot and the other: by coachable, by rtamt, by pyrewardmachines.

All three are wrappers in the same position, read the same signals by the same reader, and pay the same: +1
for a step that follows the behaviour (r_or in the variant `stay`), and −1 for any other.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path
from types import MappingProxyType
from typing import Any

import gymnasium

from coachable.behaviours.library import load_behaviour
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.signals import signal_pack
from coachable.rewards.forms import Schedule

ENVIRONMENT = "Walker2d-v5"
_FOLDER = Path(__file__).parent / "behaviours"
TWO_FEET, PERRY = (load_behaviour(_FOLDER / f"{name}.behaviour") for name in ("two-feet", "perry-walker2d"))


class _Paid(gymnasium.Wrapper, abc.ABC):
    """Adds what a monitor of the signals pays; it begins anew with every episode."""

    def __init__(self, env: gymnasium.Env):
        super().__init__(env)
        self._read = signal_pack(env).reader(env, TWO_FEET.signal_names)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.begin(self._read(observation, info))
        return observation, info

    def step(self, action: Any):
        """One step, paid for."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        paid = self.pay(self._read(observation, info))
        return observation, float(reward) + paid, terminated, truncated, info

    @abc.abstractmethod
    def begin(self, signals: dict[str, float]) -> None:
        """See the first sample of an episode."""

    @abc.abstractmethod
    def pay(self, signals: dict[str, float]) -> float:
        """See one more sample."""


_UPRIGHT = "(pitch > -0.5) and (pitch < 0.5)"
_LEFT = f"({_UPRIGHT} and (left_foot_contact > 0.5) and (right_foot_contact < 0.5))"
_BOTH = f"({_UPRIGHT} and (left_foot_contact > 0.5) and (right_foot_contact > 0.5))"
_RIGHT = f"({_UPRIGHT} and (left_foot_contact < 0.5) and (right_foot_contact > 0.5))"
_INSIDE = f"({_LEFT} or {_BOTH} or {_RIGHT})"
# In one piece, and no `prev` twice: online, rtamt 0.4.10 cannot reset a specification that has others in it,
# and it loses count of an operator that is written twice.
_FOLLOWS = (
    f"({_INSIDE} and not (prev {_INSIDE})) or ({_LEFT} and (prev ({_LEFT} or {_RIGHT}))) "
    f"or ({_BOTH} and (prev ({_BOTH} or {_LEFT}))) or ({_RIGHT} and (prev ({_RIGHT} or {_BOTH})))"
)


class RtamtReward(_Paid):
    """The behaviour in past-time signal temporal logic; what rtamt's robustness is positive for is paid."""

    def __init__(self, env: gymnasium.Env):
        import rtamt  # pyright: ignore[reportMissingImports]

        super().__init__(env)
        self._specification = rtamt.StlDiscreteTimeOnlineSpecification()
        for name in (*TWO_FEET.signal_names, "follows"):
            self._specification.declare_var(name, "float")
        self._specification.spec = f"follows = {_FOLLOWS}"
        self._specification.parse()
        self._samples = 0

    def begin(self, signals: dict[str, float]) -> None:
        """Forget the last episode."""
        if self._samples:
            self._specification.reset()
        self._samples = 0
        self.pay(signals)

    def pay(self, signals: dict[str, float]) -> float:
        """±1 by the sign of the robustness."""
        robustness: Any = self._specification.update(self._samples, list(signals.items()))
        self._samples += 1
        return 1.0 if robustness > 0 else -1.0


class Place(Enum):
    """What the reward machine is told of a sample; each is a state of it, too."""

    LEFT = 0
    BOTH = 1
    RIGHT = 2
    OUTSIDE = 3


class RewardMachineReward(_Paid):
    """The behaviour as a reward machine of pycrm, with a labelling function as one would write it by hand."""

    def __init__(self, env: gymnasium.Env):
        from pycrm.automaton import RewardMachine, RmToCrmAdapter  # pyright: ignore[reportMissingImports]
        from pycrm.label import LabellingFunction  # pyright: ignore[reportMissingImports]

        super().__init__(env)
        edges = {(Place.LEFT, Place.BOTH), (Place.BOTH, Place.RIGHT), (Place.RIGHT, Place.LEFT)}

        def pays(before: Place, after: Place) -> int:
            inside = after is not Place.OUTSIDE
            goes_on = before in (after, Place.OUTSIDE) or (before, after) in edges
            return 1 if inside and goes_on else -1

        class Walking(RewardMachine):
            @property
            def u_0(self) -> int:
                return Place.OUTSIDE.value

            def _get_state_transition_function(self) -> dict:
                return {before.value: {after.name: after.value for after in Place} for before in Place}

            def _get_reward_transition_function(self) -> dict:
                return {
                    before.value: {after.name: pays(before, after) for after in Place} for before in Place
                }

        class Where(LabellingFunction):
            @LabellingFunction.event
            def place(self, obs, action, next_obs):
                if -0.5 < next_obs["pitch"] < 0.5:
                    if next_obs["left_foot_contact"] > 0.5:
                        return Place.BOTH if next_obs["right_foot_contact"] > 0.5 else Place.LEFT
                    if next_obs["right_foot_contact"] > 0.5:
                        return Place.RIGHT
                return Place.OUTSIDE

        self._machine, self._where = RmToCrmAdapter(Walking(Place)), Where()
        self._state, self._counters = self._machine.u_0, self._machine.c_0

    def begin(self, signals: dict[str, float]) -> None:
        """Forget the last episode."""
        self._state, self._counters = self._machine.u_0, self._machine.c_0
        self.pay(signals)

    def pay(self, signals: dict[str, float]) -> float:
        """What the machine's transition pays."""
        events = self._where(None, None, signals)
        self._state, self._counters, reward = self._machine.transition(self._state, self._counters, events)
        return float(reward(None, None, signals))


_TIMES = {"left": 0.3, "both": 0.1, "right": 0.3}

WRAPPERS: Mapping[str, Callable[[gymnasium.Env], gymnasium.Wrapper]] = MappingProxyType(
    {
        "coachable": lambda env: BehaviourReward(env, TWO_FEET),
        "coachable, Perry's phases": lambda env: BehaviourReward(env, PERRY),
        "coachable, schedule": lambda env: BehaviourReward(env, TWO_FEET, form=Schedule(durations=_TIMES)),
        "rtamt, online": RtamtReward,
        "pyrewardmachines": RewardMachineReward,
    }
)
"""Around an environment, by who pays."""
