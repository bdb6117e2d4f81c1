"""A learned controller: a network, the box that its actions are kept in, and how it is to be sampled."""

import json
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from coachable.envs.squashing import DETERMINISTIC, SQUASHINGS, Deterministic, expected_action
from coachable.foundation.data import shown
from coachable.foundation.errors import ParameterError, RunFolderError
from coachable.foundation.suggestion import suggestion

ACTIVATIONS = {"tanh": jnp.tanh, "relu": jax.nn.relu}


class Policy(eqx.Module):
    """u = squash(W_n σ(… σ(W_1 x + b_1) …) + b_n): what a trained lane does when it does not explore.

    `squashing` keeps the action u in the box [low, high]: "clip" cuts the network's output, "tanh" maps
    ℝ onto the box. A network that was trained on normalised observations is given (x − shift) / scale, cut
    to ±bound, for x. With `deterministic="expected-action"` u is not the mean action, clipped, but the mean
    of the action that is applied where it explores with `std`; see `expected_action`.
    """

    weights: tuple[Float[Array, "_ _"], ...]
    biases: tuple[Float[Array, "_"], ...]
    low: Float[Array, " controls"]
    """Least action; of the compass walker a torque [N m]."""
    high: Float[Array, " controls"]
    """Greatest action; of the compass walker a torque [N m]."""
    shift: Float[Array, " state"] | None = None
    scale: Float[Array, " state"] | None = None
    std: Float[Array, " controls"] | None = None
    """σ of the exploring policy, before its actions are clipped; `None` where it is not one number each."""
    activation: str = eqx.field(static=True, default="tanh")
    squashing: str = eqx.field(static=True, default="clip")
    deterministic: Deterministic = eqx.field(static=True, default="clipped-mean")
    observation_names: tuple[str, ...] = eqx.field(static=True, default=())
    clock: str = eqx.field(static=True, default="free")
    bound: float = eqx.field(static=True, default=10.0)
    memory: str = eqx.field(static=True, default="")
    """What it observes behind a plant's state, as JSON: `behaviour`, the text, and `reward_variant`, the form
    whose memory it is. Empty for a state feedback."""
    mirror: str = eqx.field(static=True, default="")
    """How it is mirrored by phase, as JSON; see `PhaseMirror`. Empty if it is not."""

    def __check_init__(self) -> None:
        for name, known in (
            ("activation", ACTIVATIONS),
            ("squashing", SQUASHINGS),
            ("deterministic", DETERMINISTIC),
        ):
            if getattr(self, name) not in known:
                raise RunFolderError(
                    f"a policy's {name} must be one of {', '.join(known)}; got {getattr(self, name)!r}"
                )
        if self.deterministic == "expected-action" and (self.std is None or self.squashing != "clip"):
            raise RunFolderError("a policy gives its expected action only with its std, and clipped")

    def acting(self, deterministic: str) -> "Policy":
        """The same policy with another rule for what it does when it does not explore.

        **Raises:** `ParameterError` for an unknown rule, and where the mean of the applied action has no
        closed form.
        """
        if deterministic not in DETERMINISTIC:
            hint = suggestion(str(deterministic), DETERMINISTIC)
            raise ParameterError(f"deterministic = {deterministic!r}: {hint}")
        if deterministic == "expected-action" and self.squashing != "clip":
            raise ParameterError(
                "deterministic = 'expected-action': the mean of an action that is squashed by tanh has no "
                "closed form; take clipped-mean, which squashes the mean"
            )
        if deterministic == "expected-action" and self.std is None:
            raise ParameterError(
                "deterministic = 'expected-action': this policy's file lacks the σ with which it explored; "
                "train it anew, or take clipped-mean"
            )
        return replace(self, deterministic=deterministic)  # pyright: ignore[reportArgumentType]

    @property
    def clips(self) -> bool:
        """Whether actions are cut at the bounds, where their slope jumps."""
        return self.squashing == "clip" and self.deterministic == "clipped-mean"

    def __call__(self, x: Float[Array, " state"]) -> Float[Array, " controls"]:
        """The applied action for what the network observes; of the compass walker torques [N m].

        This is the network alone: x holds the numbers of its memory, where it observes one, and nothing is
        mirrored. `PolicyController` runs a policy with both.
        """
        activate = ACTIVATIONS[self.activation]
        if self.shift is not None and self.scale is not None:
            x = jnp.clip((x - self.shift) / self.scale, -self.bound, self.bound)
        *hidden, (weight, bias) = zip(self.weights, self.biases, strict=True)
        for hidden_weight, hidden_bias in hidden:
            x = activate(hidden_weight @ x + hidden_bias)
        if self.deterministic == "expected-action" and self.std is not None:
            return expected_action(weight @ x + bias, self.std, self.low, self.high)
        return SQUASHINGS[self.squashing](weight @ x + bias, self.low, self.high)

    def tensors(self) -> dict[str, np.ndarray]:
        """The network's arrays by name, as they are written to a file."""
        named = {"low": self.low, "high": self.high}
        if self.shift is not None and self.scale is not None:
            named |= {"shift": self.shift, "scale": self.scale}
        if self.std is not None:
            named |= {"std": self.std}
        for i, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True), start=1):
            named |= {f"layer_{i}.weight": weight, f"layer_{i}.bias": bias}
        return {name: np.asarray(array) for name, array in named.items()}

    def description(self) -> dict[str, Any]:
        """What else a reader needs in order to run the network, ready for JSON."""
        return {
            "layers": [int(self.weights[0].shape[1]), *(int(weight.shape[0]) for weight in self.weights)],
            "activation": self.activation,
            "squashing": self.squashing,
            "deterministic": self.deterministic,
            "low": np.asarray(self.low).tolist(),
            "high": np.asarray(self.high).tolist(),
            "observation_names": list(self.observation_names),
            "clock": self.clock,
            **({} if self.scale is None else {"bound": self.bound}),
            **({"memory": json.loads(self.memory)} if self.memory else {}),
            **({"mirror": json.loads(self.mirror)} if self.mirror else {}),
        }

    @classmethod
    def of(cls, tensors: Mapping[str, np.ndarray], description: Mapping[str, Any]) -> "Policy":
        """The inverse of `tensors` and `description`.

        Raises `RunFolderError` if something is missing or does not fit together.
        """
        sizes: Any = description.get("layers")
        if not _are_sizes(sizes):
            raise RunFolderError(f"the policy's layers must be two or more whole numbers, got {shown(sizes)}")
        for name, array in tensors.items():
            if not np.issubdtype(array.dtype, np.floating) or array.ndim not in (1, 2):
                raise RunFolderError(
                    f"the policy's {name} is {array.dtype}{list(array.shape)}, not of floats"
                )
        try:
            numbers = range(1, len(sizes))
            policy = cls(
                weights=tuple(jnp.asarray(tensors[f"layer_{i}.weight"]) for i in numbers),
                biases=tuple(jnp.asarray(tensors[f"layer_{i}.bias"]) for i in numbers),
                low=jnp.asarray(tensors["low"]),
                high=jnp.asarray(tensors["high"]),
                activation=description["activation"],
                squashing=description["squashing"],
                observation_names=tuple(description["observation_names"]),
                clock=description["clock"],
                **(
                    {
                        name: jnp.asarray(tensors[name])
                        for name in ("shift", "scale")
                        if "bound" in description
                    }
                ),
                **({"bound": description["bound"]} if "bound" in description else {}),
                std=jnp.asarray(tensors["std"]) if "std" in tensors else None,
                deterministic=description.get("deterministic", "clipped-mean"),
                memory=_json(description.get("memory")),
                mirror=_json(description.get("mirror")),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise RunFolderError(f"the policy's file lacks {error}") from error
        shapes = [weight.shape for weight in policy.weights]
        expected = [(outputs, inputs) for inputs, outputs in pairwise(sizes)]
        if shapes != expected or [bias.shape for bias in policy.biases] != [(n,) for n in sizes[1:]]:
            raise RunFolderError(
                f"the policy's layers should be {sizes}, but its weights have shapes {shapes}"
            )
        if not all(np.isfinite(array).all() for array in tensors.values()):
            raise RunFolderError("the policy's weights are not all finite")
        if policy.std is not None and (policy.std.shape != policy.low.shape or (policy.std <= 0).any()):
            raise RunFolderError("the policy's std must be one number above 0 for each action")
        return policy


def _json(data: Any) -> str:
    """As a policy keeps it; empty for what is not there."""
    return "" if data is None else json.dumps(data, sort_keys=True)


def _are_sizes(sizes: Any) -> bool:
    return (
        isinstance(sizes, list | tuple) and len(sizes) >= 2 and all(type(n) is int and n >= 1 for n in sizes)
    )
