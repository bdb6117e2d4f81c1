"""Training by stable-baselines3: any environment with boxes for observations and actions. Needs [sb3]."""

from __future__ import annotations

import inspect
import random
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any

import gymnasium
import jax.numpy as jnp
import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from coachable.foundation.data import real_number, whole_number
from coachable.foundation.errors import PlanError
from coachable.foundation.suggestion import suggestion
from coachable.learning.policy import Policy

ALGORITHMS = {"sb3-ppo": PPO, "sb3-sac": SAC, "sb3-td3": TD3}
ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}
_NOT_SETTINGS = {
    "self",
    "policy",
    "env",
    "seed",
    "device",
    "verbose",
    "tensorboard_log",
    "action_noise",
    "_init_setup_model",
}
_AT_LEAST_ONE = (
    "batch_size",
    "buffer_size",
    "n_envs",
    "n_epochs",
    "n_steps",
    "policy_delay",
    "target_update_interval",
    "train_freq",
)
_SHARES = ("gamma", "gae_lambda", "tau")
"""Settings from 0 to 1."""
_ELSEWHERE = {
    "policy": "it is MlpPolicy; leave it out",
    "n_timesteps": "write steps in the plan, outside of the trainer's settings",
    "noise_type": "it is normal noise, of the deviation noise_std; leave it out",
    "env_wrapper": "put the wrapper around the environment where it is registered",
    "frame_stack": "put the wrapper around the environment where it is registered",
}
"""What the zoo's files have beside, and where it is here."""
_SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf")
"""Settings that may fall over a training."""
_NORMALIZE = ("norm_obs", "norm_reward", "clip_obs", "clip_reward")
"""Arguments of `VecNormalize` in a table `normalize`."""
_LOGGED = {
    "approx_kl": "approx_kl",
    "clip_fraction": "clip_fraction",
    "explained_variance": "explained_variance",
    "value_loss": "value_loss",
    "critic_loss": "value_loss",
    "policy_gradient_loss": "policy_loss",
    "actor_loss": "policy_loss",
    "std": "std",
}
"""What a diagnostic of `ppo.Diagnostics` is called in the loggers of the algorithms, under `train/`."""
_BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def check_settings(trainer: str, settings: Mapping[str, Any]) -> None:
    """What can be checked of settings without an environment.

    **Raises:** `PlanError` for a setting that the trainer does not have, with the nearest one it has; for a
    value of another type than its default's, or with which no update can be made; and for what no policy
    file can hold.
    """
    parameters = inspect.signature(ALGORITHMS[trainer].__init__).parameters
    defaults: dict[str, Any] = {
        name: each.default for name, each in parameters.items() if name not in _NOT_SETTINGS
    }
    defaults |= {"normalize": False} | ({"n_envs": 1} if trainer == "sb3-ppo" else {"noise_std": 0.0})
    for name, value in settings.items():
        if name not in defaults:
            hint = _ELSEWHERE.get(name) or suggestion(name, defaults)
            raise PlanError(f"{trainer} has no setting {name!r}; {hint}")
        if name == "normalize" and isinstance(value, Mapping):
            _check_normalize(trainer, value)
            continue
        if name in _SCHEDULED and isinstance(value, str):
            _schedule(trainer, name, value)
            continue
        kind = type(defaults[name])
        fits = {
            bool: type(value) is bool,
            int: type(value) is int,
            float: type(value) in (int, float),
        }
        if not fits.get(kind, True):
            raise PlanError(f"{trainer}: {name} must be like {defaults[name]!r}, got {value!r}")
        if name in _AT_LEAST_ONE and value < 1:
            raise PlanError(f"{trainer}: {name} must be at least 1, got {value!r}")
        if value != value:
            raise PlanError(f"{trainer}: {name} must be a number, got {value!r}")
        if kind is int:
            whole_number(value, f"{trainer}: {name}", PlanError, -1, 10**8)
        elif kind is float:
            bounds = {"least": 0.0, "most": 1.0} if name in _SHARES else {}
            bounds |= {"least": 0.0} if name == "noise_std" else {}
            real_number(value, f"{trainer}: {name}", PlanError, **bounds)
    arguments = settings.get("policy_kwargs", {})
    if not isinstance(arguments, Mapping):
        raise PlanError(f"{trainer}: policy_kwargs must be a table, got {arguments!r}")
    activation = arguments.get("activation_fn", "tanh")
    if not isinstance(activation, str) or activation not in ACTIVATIONS:
        hint = suggestion(str(activation), ACTIVATIONS)
        raise PlanError(f"policy_kwargs.activation_fn = {activation!r}; {hint}")
    if settings.get("use_sde") or arguments.get("squash_output"):
        raise PlanError(
            f"{trainer}: use_sde and squash_output bound actions in ways that no policy file can hold"
        )


def _schedule(trainer: str, name: str, value: str) -> Callable[[float], float]:
    """What the zoo writes as `lin_0.0003`: from there to zero, linearly with what is left of the training."""
    word, _, number = value.partition("_")
    try:
        initial = float(number)
    except ValueError:
        initial = None
    if word != "lin":
        raise PlanError(f"{trainer}: {name} must be a number, or lin_ and a number, got {value!r}")
    first = real_number(initial, f"{trainer}: {name} after lin_", PlanError)
    return lambda left: left * first


def _check_normalize(trainer: str, table: Mapping[str, Any]) -> None:
    for name, value in table.items():
        if name not in _NORMALIZE:
            raise PlanError(f"{trainer}: normalize has no {name!r}; {suggestion(name, _NORMALIZE)}")
        if name.startswith("norm_"):
            if type(value) is not bool:
                raise PlanError(f"{trainer}: normalize.{name} must be true or false, got {value!r}")
        else:
            real_number(value, f"{trainer}: normalize.{name}", PlanError, above=0)


class Learner:
    """One lane: an algorithm with its environment, its networks, and all that a checkpoint has to hold.

    On the CPU, in one thread: cores are kept busy by lanes side by side. That, and the seeds of Python's,
    NumPy's and torch's own random generators, is set for the whole process; see `process_as_it_was`.

    **Arguments:**
        trainer: a key of `ALGORITHMS`.
        make_env: observations are a row of numbers, actions a bounded one.
        settings: arguments of the algorithm that differ from its defaults, and `normalize`, for running
            means and deviations of observations and returns (`VecNormalize`, a table of whose arguments it
            may be); `n_envs`, from how many
            environments PPO gathers `n_steps` each, one after another; `noise_std`, for normal noise on
            actions in [−1, 1]; `policy_kwargs.activation_fn`, by its name.
        seed: for the networks, the sampling and the environment.

    **Raises:** `PlanError` for spaces or settings that the algorithm cannot work with.
    """

    def __init__(
        self, trainer: str, make_env: Callable[[], gymnasium.Env], settings: Mapping[str, Any], seed: int
    ):
        check_settings(trainer, settings)
        torch.set_num_threads(1)
        settings = dict(settings)
        env = make_env()
        require_boxes(env)
        num_envs = settings.pop("n_envs", 1)
        vector_env: Any = DummyVecEnv([lambda: env, *[make_env] * (num_envs - 1)])
        if (normalize := settings.pop("normalize", False)) is not False:
            arguments = normalize if isinstance(normalize, Mapping) else {}
            vector_env = VecNormalize(vector_env, gamma=settings.get("gamma", 0.99), **arguments)
        for name in _SCHEDULED:
            if isinstance(value := settings.get(name), str):
                settings[name] = _schedule(trainer, name, value)
        if noise := settings.pop("noise_std", 0.0):
            size = env.action_space.shape or ()
            settings["action_noise"] = NormalActionNoise(np.zeros(size), np.full(size, float(noise)))
        if "policy_kwargs" in settings:
            settings["policy_kwargs"] = _policy_arguments(settings["policy_kwargs"])
        algorithm = ALGORITHMS[trainer]
        try:
            if not issubclass(algorithm, OnPolicyAlgorithm):
                _fuse_adam(settings)
            # Their own annotations are narrower than what they take (log_interval) and give (parameters).
            self._model: Any = algorithm(
                "MlpPolicy", vector_env, seed=seed, device="cpu", verbose=0, **settings
            )
        except (TypeError, ValueError, AssertionError) as error:
            raise PlanError(f"{trainer} does not take these settings: {error}") from None
        # Environments are seeded one after another from this on: no two lanes share one.
        self._seed = seed * num_envs
        vector_env.seed(self._seed)
        self._begun = False

    @property
    def num_steps(self) -> int:
        """Steps of the environment so far."""
        return self._model.num_timesteps

    @property
    def steps_an_update(self) -> int:
        """How many steps pass between two moments at which the weights change."""
        if isinstance(self._model, OnPolicyAlgorithm):
            return self._model.n_steps * self._model.n_envs
        frequency: Any = self._model.train_freq
        return frequency if isinstance(frequency, int) else frequency.frequency

    def learn(self, num_steps: int, between: Callable[[], None]) -> None:
        """Go on until there were this many steps, rounded up to whole updates.

        `between` is called whenever an update is over and the next rollout has not begun, and at the end:
        then, and only then, `arrays` is consistent.
        """
        left = num_steps - self.num_steps
        if left > 0:
            many_updates = not isinstance(self._model, OnPolicyAlgorithm)
            with _subnormals_as_zeros() if many_updates else nullcontext():
                # Its schedules take their progress from what the algorithm takes for the total.
                self._model.learn(
                    left, _Between(between), log_interval=None, reset_num_timesteps=not self._begun
                )
            self._begun = True
        between()

    def diagnostics(self) -> dict[str, float]:
        """The latest update in the numbers of `ppo.Diagnostics` that the algorithm reports, by name.

        Of SAC and TD3, `policy_loss` is the actor's loss and `value_loss` the critics'. Empty before the
        first update, and after `restore` until the next one.
        """
        logger = getattr(self._model, "_logger", None)  # which `learn` sets up
        logged: Mapping[str, Any] = logger.name_to_value if logger else {}
        found = {
            ours: float(logged[name]) for key, ours in _LOGGED.items() if (name := f"train/{key}") in logged
        }
        if (negative := logged.get("train/entropy_loss")) is not None:
            found["entropy"] = -float(negative)
        return found

    def policy(self) -> Policy:
        """What it does when it does not explore."""
        model = self._model
        if isinstance(model, OnPolicyAlgorithm):
            network = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
            squashing, std = "clip", jnp.exp(jnp.asarray(_array(model.policy.log_std)))
        elif isinstance(model, SAC):
            network, squashing, std = [*model.actor.latent_pi, model.actor.mu], "tanh", None
        else:
            network, squashing, std = [*model.actor.mu][:-1], "tanh", None
        linear = [part for part in network if isinstance(part, torch.nn.Linear)]
        kinds = {type(part) for part in network} - {torch.nn.Linear}
        box = self._model.action_space
        return Policy(
            weights=tuple(jnp.asarray(_array(part.weight)) for part in linear),
            biases=tuple(jnp.asarray(_array(part.bias)) for part in linear),
            low=jnp.asarray(box.low, jnp.float32),
            high=jnp.asarray(box.high, jnp.float32),
            activation=next((name for name, kind in ACTIVATIONS.items() if kind in kinds), "tanh"),
            squashing=squashing,
            std=std,
            **self._scaling(),
        )

    def close(self) -> None:
        """Close its environments."""
        self._model.env.close()

    def arrays(self) -> dict[str, np.ndarray]:
        """All that has to be kept for going on: networks, optimisers, replay buffer, random generators.

        The episode under way is not among it: who goes on begins another one.
        """
        model = self._model
        found = {"num_steps": np.array(model.num_timesteps)}
        for part, state in model.get_parameters().items():
            found |= {f"{part}/{name}": value for name, value in _flat(state).items()}
        if (log_ent_coef := getattr(model, "log_ent_coef", None)) is not None:
            found["log_ent_coef"] = _array(log_ent_coef)
        if (updates := getattr(model, "_n_updates", None)) is not None:
            found["n_updates"] = np.array(updates)
        if (buffer := getattr(model, "replay_buffer", None)) is not None:
            found |= {f"buffer/{name}": getattr(buffer, name)[: buffer.size()] for name in _BUFFER}
            found["buffer/position"] = np.array(buffer.pos)
        if (normaliser := model.get_vec_normalize_env()) is not None:
            for name, statistics in _statistics(normaliser).items():
                for moment in ("mean", "var", "count"):
                    found[f"{name}_{moment}"] = np.array(getattr(statistics, moment), np.float64)
        _, keys, position, has_gauss, gauss = np.random.get_state()
        found |= {
            "torch_random": torch.get_rng_state().numpy(),
            "numpy_random": np.asarray(keys),
            "numpy_random_rest": np.array([position, has_gauss, gauss], np.float64),
        }
        return {name: np.array(value, order="C") for name, value in found.items()}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Be what it was when `arrays` gave this.

        **Raises:** `KeyError` if something is not there.
        """
        model = self._model
        model.num_timesteps = int(arrays["num_steps"])
        parameters = model.get_parameters()
        for part, state in parameters.items():
            prefix = f"{part}/"
            kept = {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}
            _unflatten(state, kept)
        model.set_parameters(parameters)
        with torch.no_grad():
            if (log_ent_coef := getattr(model, "log_ent_coef", None)) is not None:
                log_ent_coef.copy_(torch.from_numpy(arrays["log_ent_coef"]))
        model._n_updates = int(arrays["n_updates"])
        if (buffer := getattr(model, "replay_buffer", None)) is not None:
            for name in _BUFFER:
                kept = arrays[f"buffer/{name}"]
                getattr(buffer, name)[: len(kept)] = kept
            buffer.pos = int(arrays["buffer/position"])
            buffer.full = len(arrays["buffer/rewards"]) == buffer.buffer_size
        if (normaliser := model.get_vec_normalize_env()) is not None:
            for name, statistics in _statistics(normaliser).items():
                for moment in ("mean", "var", "count"):
                    setattr(statistics, moment, arrays[f"{name}_{moment}"])
        torch.set_rng_state(torch.from_numpy(arrays["torch_random"]))
        position, has_gauss, gauss = arrays["numpy_random_rest"]
        np.random.set_state(("MT19937", arrays["numpy_random"], int(position), int(has_gauss), float(gauss)))
        # Else the episodes, and the random actions, of the run's beginning would come once more.
        model.env.seed((self._seed + model.num_timesteps) % 2**31)
        model.action_space.seed((self._seed + model.num_timesteps) % 2**31)
        self._begun = True

    def _scaling(self) -> dict[str, Any]:
        normaliser = self._model.get_vec_normalize_env()
        if normaliser is None or not normaliser.norm_obs:
            return {}
        statistics = normaliser.obs_rms
        return {
            "shift": jnp.asarray(statistics.mean, jnp.float32),
            "scale": jnp.asarray(np.sqrt(statistics.var + normaliser.epsilon), jnp.float32),
            "bound": float(normaliser.clip_obs),
        }


def _statistics(normaliser: VecNormalize) -> dict[str, Any]:
    """Running statistics by what they are of; observations that are not normalised have none."""
    named = {"observations": getattr(normaliser, "obs_rms", None), "returns": normaliser.ret_rms}
    return {name: statistics for name, statistics in named.items() if statistics is not None}


class _Between(BaseCallback):
    """Calls back before every rollout."""

    def __init__(self, between: Callable[[], None]):
        super().__init__()
        self._between = between

    def _on_rollout_start(self) -> None:
        self._between()

    def _on_step(self) -> bool:
        return True


def require_boxes(env: gymnasium.Env) -> None:
    """**Raises:** `PlanError` for observations or actions that the algorithms cannot work with."""
    observations, actions = env.observation_space, env.action_space
    if not isinstance(observations, gymnasium.spaces.Box) or len(observations.shape) != 1:
        raise PlanError(
            f"observations must be a row of numbers, but they are {observations}; put "
            "gymnasium.wrappers.FlattenObservation around the environment"
        )
    if not isinstance(actions, gymnasium.spaces.Box) or len(actions.shape) != 1:
        raise PlanError(f"actions must be a row of numbers within bounds, but they are {actions}")


def _fuse_adam(settings: dict[str, Any]) -> None:
    """Let Adam take one pass, not seven: the many small updates of an off-policy algorithm are cheaper."""
    arguments = settings.setdefault("policy_kwargs", {})
    arguments["optimizer_kwargs"] = {"fused": True, **arguments.get("optimizer_kwargs", {})}


@contextmanager
def _subnormals_as_zeros() -> Iterator[None]:
    """Adam's moments of units that have died shrink until they are subnormal, and rounding keeps them so;
    arithmetic with such numbers is slow. In here they are zero. Elsewhere in this thread they must not be:
    certificates rest on IEEE 754.
    """
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


@contextmanager
def process_as_it_was() -> Iterator[None]:
    """What a `Learner` sets for the whole process is afterwards what it was: random generators, threads."""
    python, numpy, of_torch = random.getstate(), np.random.get_state(), torch.get_rng_state()
    num_threads = torch.get_num_threads()
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(numpy)
        torch.set_rng_state(of_torch)
        torch.set_num_threads(num_threads)


def _policy_arguments(arguments: Mapping[str, Any]) -> dict[str, Any]:
    given = dict(arguments)
    if "activation_fn" in given:
        given["activation_fn"] = ACTIVATIONS[given["activation_fn"]]
    return given


def _array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().numpy().copy()


def _flat(state: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """The tensors of a module's state, or of an optimiser's: there its settings are left out."""
    if "param_groups" not in state:
        return {name: _array(tensor) for name, tensor in state.items()}
    return {
        f"{index}/{name}": _array(tensor)
        for index, tensors in state["state"].items()
        for name, tensor in tensors.items()
    }


def _unflatten(state: dict[str, Any], kept: Mapping[str, np.ndarray]) -> None:
    """Put what `_flat` took out of a state back into one like it."""
    if "param_groups" not in state:
        for name in state:
            state[name] = torch.from_numpy(kept[name].copy())
        return
    state["state"] = {}
    for path, array in kept.items():
        index, _, name = path.partition("/")
        state["state"].setdefault(int(index), {})[name] = torch.from_numpy(array.copy())
