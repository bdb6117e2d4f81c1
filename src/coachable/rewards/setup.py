"""Reward setups: the weights of the reward's terms, and the paper's four by name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal

from coachable.foundation.data import plain, real, real_number, shown
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion
from coachable.rewards.forms import RewardForm, form_from_data

Semantics = Literal["paper", "released-code"]

Observe = Literal["nothing", "memory", "value-only"]
"""What of a reward form's memory is appended to observations: nothing; what the form shows of it; or that
for the value network alone (Pinto et al., *Asymmetric actor critic*, RSS 2018)."""

TimeLimit = Literal["terminates", "truncates"]
"""What the time T does to an episode: ends it for good, as the paper's return does, or cuts it short, so that
its future counts (Pardo et al., *Time limits in reinforcement learning*, ICML 2018)."""

OBSERVE: tuple[Observe, ...] = ("nothing", "memory", "value-only")
TIME_LIMITS: tuple[TimeLimit, ...] = ("terminates", "truncates")

TERM_NAMES = ("jerk", "distance", "fall", "forward", "orthant")
"""The order of the reward's terms, and of their weights, wherever they stand in an array."""


@dataclass(frozen=True)
class RewardSetup:
    """How much each term of the reward counts. The defaults are the weights that the paper's setups share.

    **Raises:** `ParameterError` for an empty name, a weight that is not a finite number, an unknown word and
    what `form_from_data` raises.
    """

    name: str
    jerk: int | float = -0.001
    """ω_jerk, for each N m (`paper`) or N² m² (`released-code`) by which the torques change in a step."""
    distance: int | float = 1.0
    """ω_dist, for each m walked by the end of the episode."""
    fall: int | float = -10.0
    """ω_fall, for falling."""
    forward: int | float = 0.0
    """ω_for, for each step in which the hip moves forward; −ω_for for one in which it does not."""
    orthant: int | float = 0.0
    """ω_or, for each step that follows the behaviour; −ω_or for one that does not."""
    reward_variant: str | Mapping[str, Any] | None = field(default=None, hash=False)
    """The reward form as plain data, if it is another one than the plan's; see `form_from_data`."""
    observe: Observe = "nothing"
    """What of the form's memory is observed; see `Observe`."""
    time_limit: TimeLimit = "terminates"
    """What T does to an episode; see `TimeLimit`."""

    def __post_init__(self):
        if not self.name.strip():
            raise ParameterError("a reward setup needs a name")
        for term in TERM_NAMES:
            given = getattr(self, term)
            if (weight := real(given)) is None or not math.isfinite(weight):
                raise ParameterError(
                    f"reward setup {self.name!r}: the weight {term} is {shown(given)}; give a finite number"
                )
            object.__setattr__(self, term, weight)
        for key, known in (("observe", OBSERVE), ("time_limit", TIME_LIMITS)):
            if (word := getattr(self, key)) not in known:
                raise ParameterError(
                    f"reward setup {self.name!r}: {key} = {word!r}: {suggestion(str(word), known)}"
                )
        if self.reward_variant is not None:
            object.__setattr__(self, "reward_variant", plain(self.reward_variant))
            form_from_data(self.reward_variant)

    @property
    def of_policy(self) -> RewardSetup:
        """The setup with what the policy observes: nothing of what the value network alone does."""
        return replace(self, observe="nothing") if self.observe == "value-only" else self

    @property
    def weights(self) -> tuple[float, float, float, float, float]:
        """The weights in the order of `TERM_NAMES`."""
        return (self.jerk, self.distance, self.fall, self.forward, self.orthant)


PAPER_SETUPS: Mapping[str, RewardSetup] = MappingProxyType(
    {
        setup.name: setup
        for setup in (
            RewardSetup("sparse"),
            RewardSetup("forward", forward=0.01),
            RewardSetup("orthant", orthant=0.01),
            RewardSetup("forward+orthant", forward=0.005, orthant=0.005),
        )
    }
)
"""The paper's four setups (its table of weights), by name."""


def paper_setup(name: str) -> RewardSetup:
    """One of the paper's four setups.

    **Raises:** `ParameterError` for another name, with the nearest one.
    """
    if name not in PAPER_SETUPS:
        raise ParameterError(f"unknown reward setup {name!r}; {suggestion(name, PAPER_SETUPS)}")
    return PAPER_SETUPS[name]


@dataclass(frozen=True, kw_only=True)
class DescribedSetup:
    """How a lane in a Gymnasium environment is paid: by the environment, and for the behaviour.

    **Raises:** `ParameterError` for a number that is not finite.
    """

    name: str
    weight: float = 1.0
    """Factor of the behaviour's reward; 0 watches the behaviour without paying for it."""
    replace: bool = False
    """Whether it is paid in place of the environment's own reward."""
    terms: Mapping[str, float] = field(default_factory=dict, hash=False)
    """If given, the environment's own reward is put together anew: weights of numbers in its info, or of
    `alive`, which is 1 for a step that does not terminate the episode."""
    reward_variant: str | Mapping[str, Any] = "stay"
    """The reward form as plain data: its name, or a table with its fields; see `form_from_data`."""
    cycle_bonus: float = 0.0
    """Paid for each completed cycle."""
    observe: Literal["nothing", "memory"] = "nothing"
    """Whether what the form lets a policy observe is appended to the observation."""
    mirror: bool | Literal["samples"] | None = None
    """Whether the policy is mirrored by phase; by default where description and robot have two sides.
    `samples`: it is not, but learns from the mirror images of its samples, too."""

    def __post_init__(self):
        _ = self.form
        if str(self.observe) == "value-only":
            raise ParameterError(
                "observe = 'value-only': a Gymnasium environment shows its policy and its value network the "
                "same; give memory or nothing"
            )
        if self.observe not in ("nothing", "memory"):
            hint = suggestion(str(self.observe), ("nothing", "memory"))
            raise ParameterError(f"observe = {self.observe!r}: {hint}")
        if self.mirror not in (None, True, False, "samples"):
            raise ParameterError(f"mirror must be true, false or 'samples', got {shown(self.mirror)}")
        for key, value in {"weight": self.weight, "cycle_bonus": self.cycle_bonus, **self.terms}.items():
            real_number(value, key, ParameterError)
        # NumPy's numbers have other names in the reward's hash.
        for key in ("weight", "cycle_bonus", "terms"):
            object.__setattr__(self, key, plain(getattr(self, key)))

    @property
    def form(self) -> RewardForm:
        """The reward form."""
        return form_from_data(self.reward_variant)
