"""What a trainer sees of an environment."""

import abc
from typing import Any

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray


class Timestep(eqx.Module):
    """What one control step led to, before any reset."""

    observation: Float[Array, " observation"]
    reward: Float[Array, ""]
    """weights · terms."""
    terminated: Bool[Array, ""]
    """Whether the episode ended for good: a fall, or T, at which the return of the paper ends."""
    truncated: Bool[Array, ""]
    """Whether it was cut short: by T where that truncates."""
    fell: Bool[Array, ""]
    """Whether the walker fell, its feet chattered, or its state left the finite numbers."""
    terms: Float[Array, "5"]
    """The reward's terms without their weights, in the order of `TERM_NAMES`."""
    hip_x: Float[Array, ""]
    """Where the hip is [m]."""
    foot_x: Float[Array, ""]
    """Where the stance foot is [m]."""
    time: Float[Array, ""]
    """Since the start of the episode [s]."""
    phase: Int[Array, ""]
    """Location in the behaviour: 0 … K−1, or K outside all K phases."""
    control: Float[Array, " control"]
    """The control applied during the step."""


class Task(eqx.Module):
    """What a trainer sees of an environment; one item, without a batch. Times count control steps."""

    @property
    @abc.abstractmethod
    def observation_size(self) -> int:
        """Numbers in an observation."""

    @property
    def num_seen(self) -> int:
        """How many of them, from the first on, the policy sees; the value network sees all."""
        return self.observation_size

    @property
    @abc.abstractmethod
    def action_size(self) -> int:
        """Numbers in an action."""

    @abc.abstractmethod
    def init(self, key: PRNGKeyArray) -> Any:
        """Return the state in which a run starts."""

    @abc.abstractmethod
    def reset(self, state: Any, key: PRNGKeyArray) -> Any:
        """Return the first state of the next episode; what outlives an episode is taken from `state`."""

    @abc.abstractmethod
    def observation(self, state: Any) -> Float[Array, " observation"]:
        """Return what the next action is computed from."""

    @abc.abstractmethod
    def step(self, state: Any, action: Float[Array, " action"]) -> tuple[Any, Timestep]:
        """Take one control step; the state returned is the one after it, even where the episode ended."""
