"""Our PPO on Gymnasium environments: many copies of one, stepped side by side in one process.

Learning is `ppo.improve`, as for plants. What is here is what an environment that is written in Python needs
beside it: its steps, the running scaling of observations and rewards, and how to go on after an interruption.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.wrappers.utils import RunningMeanStd
from jaxtyping import Array, Bool, Float

from coachable.envs.side_by_side.copies import Copies
from coachable.envs.squashing import SQUASHINGS
from coachable.envs.symmetry.derived import RobotMirror
from coachable.foundation.errors import PlanError
from coachable.foundation.trees import arrays_of, tree_from
from coachable.learning import ppo
from coachable.learning.config import EnvironmentPPOConfig
from coachable.learning.networks import initial_networks
from coachable.learning.policy import Policy

BOUND = 10.0
"""Scaled observations and rewards are cut to ± this, as in stable-baselines3's `VecNormalize`."""
LEAST_VARIANCE = 1e-8
"""Added to a variance before anything is divided by its root."""

MakeEnv = Callable[[], gymnasium.Env]


class Scaling(NamedTuple):
    """How observations are normalised: (x − shift) / scale."""

    shift: Float[Array, " observations"]
    scale: Float[Array, " observations"]

    def __call__(self, rows: Any) -> Float[Array, "*steps observations"]:
        """Observations as the networks see them; the same arithmetic as in `Policy`."""
        shift, scale = (jnp.broadcast_to(each, rows.shape) for each in self)
        return jnp.clip((rows - shift) / scale, -BOUND, BOUND)


class Gathered(NamedTuple):
    """The steps of a rollout as the environments gave them; see `ppo.Rollout`."""

    observations: Float[np.ndarray, "steps envs observations"]
    next_observations: Float[np.ndarray, "steps envs observations"]
    actions: Float[np.ndarray, "steps envs actions"]
    noise: Float[np.ndarray, "steps envs actions"]
    """(a − μ) / σ of every action."""
    rewards: Float[np.ndarray, "steps envs"]
    terminated: Bool[np.ndarray, "steps envs"]
    truncated: Bool[np.ndarray, "steps envs"]

    def image(self, mirror: RobotMirror) -> Gathered:
        """The same steps in the mirror, drawn with the same noise and paid the same."""
        return self._replace(
            observations=mirror.observation(self.observations),
            next_observations=mirror.observation(self.next_observations),
            actions=mirror.action(self.actions),
        )


class Learner:
    """One lane: several copies of an environment, a policy for all of them, and what a checkpoint holds.

    A rollout's observations are all scaled by the moments of the rollouts before it, so that what is learned
    from is what was acted on; the first one's are not scaled.

    **Arguments:**
        make_env: observations are a row of numbers, actions a bounded one.
        config: the settings.
        seed: for the networks, the sampling and the environments.
        mirror: of all that is observed; if given, it learns from the mirror images of its samples, too.

    **Raises:** `PlanError` for spaces that it cannot work with.
    """

    def __init__(
        self,
        make_env: MakeEnv,
        config: EnvironmentPPOConfig,
        seed: int,
        mirror: RobotMirror | None = None,
    ):
        self._copies = Copies(make_env, [(seed, number) for number in range(config.n_envs)])
        first = self._copies.envs[0]
        num_observations, num_actions = _sizes(first)
        box: Any = first.action_space
        key, network_key = jax.random.split(jax.random.key(seed))
        networks = initial_networks(network_key, num_observations, num_actions, config.hidden_sizes)
        self._config, self._mirror = config, mirror
        self._state = ppo.initial_state(key, networks, None)
        self._low, self._high = jnp.asarray(box.low, jnp.float32), jnp.asarray(box.high, jnp.float32)
        self._of_observations = RunningMeanStd(shape=(num_observations,))
        self._of_returns = RunningMeanStd()
        self._returns = np.zeros(config.n_envs)
        """Discounted return so far of every episode under way."""
        self._observations = np.zeros((config.n_envs, num_observations), np.float32)
        self._diagnostics: dict[str, float] = {}
        self._begun = False

    @property
    def num_steps(self) -> int:
        """Steps of all environments together so far."""
        return int(self._state.num_updates) * self.steps_an_update

    @property
    def steps_an_update(self) -> int:
        """The samples of a rollout."""
        return self._config.rollout_size

    def learn(self, num_steps: int, between: Callable[[], None]) -> None:
        """Go on until there were this many steps, rounded up to whole updates.

        `between` is called whenever an update is over and the next rollout has not begun, and at the end.
        """
        if not self._begun:
            for index in range(self._config.n_envs):
                self._observations[index] = self._copies.begin(index)
            self._begun = True
        while self.num_steps < num_steps:
            between()
            left, anneal = 1 - self.num_steps / num_steps, self._config.anneal
            self._update(left / anneal if left < anneal else 1.0)
        between()

    def diagnostics(self) -> Mapping[str, float]:
        """The latest update in the numbers of `ppo.Diagnostics`; empty before the first one."""
        return self._diagnostics

    def policy(self) -> Policy:
        """What it does when it does not explore."""
        networks, squashing = self._state.networks, self._config.squashing
        scaling = self._scaling()
        return Policy(
            weights=tuple(weight for weight, _ in networks.policy_layers),
            biases=tuple(bias for _, bias in networks.policy_layers),
            low=self._low,
            high=self._high,
            std=jnp.exp(networks.log_std) if squashing == "clip" else None,
            squashing=squashing,
            bound=BOUND,
            **(scaling._asdict() if self._config.normalize else {}),
        )

    def close(self) -> None:
        """Close its environments."""
        self._copies.close()

    def arrays(self) -> dict[str, np.ndarray]:
        """All that has to be kept for going on to the bit: networks, optimiser, moments, episodes."""
        state = replace(self._state, key=jax.random.key_data(self._state.key))
        found = arrays_of(state, "state")
        for name, moments in (("observations", self._of_observations), ("returns", self._of_returns)):
            found |= {
                f"{name}_{each}": np.asarray(getattr(moments, each)) for each in ("mean", "var", "count")
            }
        found |= {"returns": self._returns, "begun": np.array(self._begun), "seen": self._observations}
        found |= self._copies.arrays()
        return {name: np.array(array) for name, array in found.items()}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Be what it was when `arrays` gave this; environments are led to where they were.

        One that does not get there when it is given the same seed and actions begins another episode.

        **Raises:** `KeyError` if something is not there.
        """
        template = replace(self._state, key=jax.random.key_data(self._state.key))
        state = jax.tree.map(jnp.asarray, tree_from(template, arrays, "state"))
        self._state = replace(state, key=jax.random.wrap_key_data(state.key))
        for name, moments in (("observations", self._of_observations), ("returns", self._of_returns)):
            for each in ("mean", "var", "count"):
                setattr(moments, each, arrays[f"{name}_{each}"])
        self._returns, self._begun = arrays["returns"].copy(), bool(arrays["begun"])
        if not self._begun:
            return
        for index, seen in enumerate(arrays["seen"]):
            observation = self._copies.replay(index, arrays)
            if observation is None or not np.array_equal(np.asarray(observation, np.float32), seen):
                observation = self._copies.begin(index)
                self._returns[index] = 0.0
            self._observations[index] = observation

    def _update(self, rate: float) -> None:
        key, noise_key = jax.random.split(self._state.key)
        shape = (self._config.n_steps, self._config.n_envs, len(self._low))
        noise = np.asarray(_normal(noise_key, shape))
        scaling = self._scaling()
        gathered = self._gather(noise, scaling)
        if self._config.normalize:
            gathered = gathered._replace(rewards=self._scaled(gathered))
        sides = [gathered] if self._mirror is None else [gathered, gathered.image(self._mirror)]
        if self._config.normalize:
            # Of both sides, so that what is scaled and then mirrored is what is mirrored and then scaled.
            for side in sides:
                self._of_observations.update(_rows(side.observations).astype(np.float64))
        state = replace(self._state, key=key)
        state, diagnostics = _improve(self._config, state, gathered, scaling, rate, *sides[1:])
        if not all(np.isfinite(leaf).all() for leaf in jax.device_get(jax.tree.leaves(state.networks))):
            raise PlanError(
                f"the training diverged after {self.num_steps:,} steps: its networks hold what is no number. "
                "A smaller learning_rate or max_grad_norm may help, or normalize = true"
            )
        self._state = state
        self._diagnostics = {name: float(value) for name, value in vars(jax.device_get(diagnostics)).items()}

    def _gather(self, noise: Float[np.ndarray, "steps envs actions"], scaling: Scaling) -> Gathered:
        """A step of all environments, again and again."""
        num_steps, num_envs, _ = noise.shape
        each = num_steps, num_envs
        observations = np.empty((*each, self._observations.shape[1]), np.float32)
        after, actions = np.empty_like(observations), np.empty_like(noise)
        rewards = np.empty(each, np.float32)
        terminated, truncated = np.empty(each, bool), np.empty(each, bool)
        leaves, shape = jax.tree.flatten((self._state.networks, scaling, self._low, self._high))
        act = partial(_act, self._config.squashing, shape, leaves)
        for step in range(num_steps):
            observations[step] = self._observations
            actions[step], applied = jax.device_get(act(self._observations, noise[step]))
            after[step], rewards[step], terminated[step], truncated[step] = self._copies.step(applied)
            self._observations[:] = after[step]
            for index in np.flatnonzero(terminated[step] | truncated[step]):
                self._observations[index] = self._copies.begin(int(index))
        return Gathered(observations, after, actions, noise, rewards, terminated, truncated & ~terminated)

    def _scaled(self, gathered: Gathered) -> Float[np.ndarray, "steps envs"]:
        """The rewards over the standard deviation of the discounted return, as `VecNormalize` has it."""
        rewards, ended = gathered.rewards.astype(np.float64), gathered.terminated | gathered.truncated
        returns = np.empty_like(rewards)
        for step, paid in enumerate(rewards):
            returns[step] = self._returns = self._config.gamma * self._returns + paid
            self._returns = np.where(ended[step], 0.0, self._returns)
        self._of_returns.update(returns.ravel())
        scaled = rewards / np.sqrt(self._of_returns.var + LEAST_VARIANCE)
        return np.clip(scaled, -BOUND, BOUND).astype(np.float32)

    def _scaling(self) -> Scaling:
        moments = self._of_observations
        if not self._config.normalize or not int(self._state.num_updates):
            zeros = jnp.zeros(moments.mean.shape, jnp.float32)
            return Scaling(zeros, zeros + 1)
        scale = np.sqrt(moments.var + LEAST_VARIANCE)
        return Scaling(jnp.asarray(moments.mean, jnp.float32), jnp.asarray(scale, jnp.float32))


def _sizes(env: gymnasium.Env) -> tuple[int, int]:
    """How many numbers an observation and an action are.

    **Raises:** `PlanError` for other spaces than rows of numbers, the actions' within bounds.
    """
    observations, actions = env.observation_space, env.action_space
    if not isinstance(observations, gymnasium.spaces.Box) or len(observations.shape) != 1:
        raise PlanError(f"observations must be a row of numbers, but they are {observations}")
    if not isinstance(actions, gymnasium.spaces.Box) or len(actions.shape) != 1 or not actions.is_bounded():
        raise PlanError(f"actions must be a row of numbers within bounds, but they are {actions}")
    return observations.shape[0], actions.shape[0]


def _rows(array: np.ndarray) -> np.ndarray:
    return array.reshape(-1, array.shape[-1])


# In the thread that calls them: lanes side by side keep the cores busy.
_jit = partial(jax.jit, compiler_options={"xla_cpu_multi_thread_eigen": False})


@partial(_jit, static_argnums=1)
def _normal(key: Array, shape: tuple[int, ...]) -> Array:
    return jax.random.normal(key, shape)


@partial(_jit, static_argnums=(0, 1))
def _act(
    squashing: str,
    shape: Any,
    leaves: list[Array],
    observations: Float[Array, "envs observations"],
    noise: Float[Array, "envs actions"],
) -> tuple[Float[Array, "envs actions"], Float[Array, "envs actions"]]:
    """Actions as sampled, and as they are applied.

    **Arguments:** `leaves`, of the networks, the scaling and the actions' bounds: taken apart once a rollout,
    for that takes longer than the products do.
    """
    networks, scaling, low, high = jax.tree.unflatten(shape, leaves)
    means = networks.means(scaling(observations).T).T
    actions = means + jnp.exp(networks.log_std)[None] * noise
    return actions, SQUASHINGS[squashing](actions, low[None], high[None])


@partial(_jit, static_argnums=0)
def _improve(
    config: EnvironmentPPOConfig,
    state: ppo.TrainState,
    gathered: Gathered,
    scaling: Scaling,
    rate: float | Float[Array, ""],
    image: Gathered | None = None,
) -> tuple[ppo.TrainState, ppo.Diagnostics]:
    log_std = state.networks.log_std
    mirrored = None if image is None else _rollout(image, scaling, log_std)
    return ppo.improve(config, state, _rollout(gathered, scaling, log_std), rate, mirrored)


def _rollout(gathered: Gathered, scaling: Scaling, log_std: Float[Array, " actions"]) -> ppo.Rollout:
    noise = jnp.moveaxis(gathered.noise, -1, 0)
    return ppo.Rollout(
        observations=scaling(gathered.observations),
        next_observations=scaling(gathered.next_observations),
        actions=jnp.asarray(gathered.actions),
        log_probabilities=ppo.gaussian_log_probability(noise, log_std),
        rewards=jnp.asarray(gathered.rewards),
        terminated=jnp.asarray(gathered.terminated),
        truncated=jnp.asarray(gathered.truncated),
    )
