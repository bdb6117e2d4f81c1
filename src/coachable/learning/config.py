"""The settings of proximal policy optimisation, by stable-baselines3's names and with its defaults."""

from dataclasses import dataclass, fields
from typing import ClassVar

from coachable.envs.squashing import SQUASHINGS, Squashing
from coachable.foundation.data import real_number, whole_number
from coachable.foundation.errors import PlanError

_MOST = {"n_steps": 10**7, "batch_size": 10**7, "n_epochs": 10**4, "hidden_sizes": 10**4, "n_envs": 10**4}
"""Whole numbers, and what they are at most: more would take all memory or time."""


@dataclass(frozen=True)
class PPOConfig:
    """Settings of PPO with one environment a lane. Defaults: stable-baselines3 2.9.

    Raises `PlanError` at construction if a value makes no sense.
    """

    learning_rate: float = 3e-4
    """Adam's step size, constant."""
    n_steps: int = 2048
    """Environment steps a rollout, that is, between two updates."""
    batch_size: int = 64
    """Samples a minibatch; divides `n_steps`."""
    n_epochs: int = 10
    """Passes over the rollout an update."""
    gamma: float = 0.99
    """Discount a step."""
    gae_lambda: float = 0.95
    """Decay of the advantage estimator: 0 is one-step TD, 1 is Monte Carlo."""
    clip_range: float = 0.2
    """How far the probability ratio may leave 1 before its gradient is cut."""
    ent_coef: float = 0.0
    """Weight of the entropy bonus."""
    vf_coef: float = 0.5
    """Weight of the value loss."""
    max_grad_norm: float = 0.5
    """Bound on the gradient's global Euclidean norm."""
    adam_epsilon: float = 1e-5
    """Added to Adam's denominator."""
    hidden_sizes: tuple[int, int] = (64, 64)
    """Widths of the two tanh layers, of the policy and of the value network alike."""
    jacobian_penalty: float = 0.0
    """Weight of the mean squared slope of the mean action, as of `ppo.loss`; 0 leaves it out."""
    squashing: Squashing = "clip"
    """How the task keeps actions in its box: cut off, or by tanh. Densities are of actions before that."""

    _rollout: ClassVar[str] = "n_steps"

    def __post_init__(self) -> None:
        if isinstance(self.hidden_sizes, list):  # as it comes from a TOML file
            object.__setattr__(self, "hidden_sizes", tuple(self.hidden_sizes))
        self._require("squashing", self.squashing in tuple(SQUASHINGS), " or ".join(map(repr, SQUASHINGS)))
        whole = [name for name in _MOST if hasattr(self, name)]
        for name in whole:
            value, most = getattr(self, name), _MOST[name]
            if isinstance(value, tuple):
                numbers = tuple(whole_number(each, f"ppo.{name}", PlanError, 1, most) for each in value)
            else:
                numbers = whole_number(value, f"ppo.{name}", PlanError, 1, most)
            object.__setattr__(self, name, numbers)
        for field in fields(self):
            if field.name not in (*whole, "squashing", "normalize"):
                number = real_number(getattr(self, field.name), f"ppo.{field.name}", PlanError)
                object.__setattr__(self, field.name, number)
        for name in ("learning_rate", "clip_range", "max_grad_norm", "adam_epsilon"):
            self._require(name, getattr(self, name) > 0, "greater than 0")
        for name in ("gamma", "gae_lambda"):
            self._require(name, 0 <= getattr(self, name) <= 1, "between 0 and 1")
        for name in ("ent_coef", "vf_coef", "jacobian_penalty"):
            self._require(name, getattr(self, name) >= 0, "at least 0")
        self._require(
            "hidden_sizes",
            type(self.hidden_sizes) is tuple and len(self.hidden_sizes) == 2,
            "two integers ≥ 1",
        )
        self._require("batch_size", self.batch_size >= 2, "at least 2: advantages are normalised within it")
        divides = self.rollout_size % self.batch_size == 0
        self._require("batch_size", divides, f"a divisor of {self._rollout} = {self.rollout_size}")

    def _require(self, name: str, satisfied: bool, what: str) -> None:
        if not satisfied:
            raise PlanError(f"ppo.{name} must be {what}, got {getattr(self, name)!r}")

    @property
    def rollout_size(self) -> int:
        """Samples a rollout."""
        return self.n_steps

    @property
    def num_minibatches(self) -> int:
        """Minibatches an epoch."""
        return self.rollout_size // self.batch_size


@dataclass(frozen=True)
class EnvironmentPPOConfig(PPOConfig):
    """Settings of PPO with several Gymnasium environments a lane, and what is usual there."""

    n_steps: int = 128
    """Steps a rollout of each environment."""
    n_envs: int = 16
    """Environments that are stepped side by side."""
    gamma: float = 0.995
    """Discount a step; at a hundred steps a second a stride's end still counts for more than half."""
    normalize: bool = True
    """Whether observations are shifted and scaled by their running mean and standard deviation, and rewards
    scaled by that of the discounted return."""
    anneal: float = 0.4
    """Over which share of the steps, the last ones, the learning rate falls along a line to 0: what a policy
    has learned does not come and go then. 1 is the schedule of PPO's authors for MuJoCo, 0 is none."""

    _rollout = "n_steps × n_envs"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require("normalize", type(self.normalize) is bool, "true or false")
        self._require("anneal", 0 <= self.anneal <= 1, "between 0 and 1")

    @property
    def rollout_size(self) -> int:
        """Samples a rollout, of all environments."""
        return self.n_steps * self.n_envs
