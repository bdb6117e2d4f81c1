"""The policy and the value network: separate tanh networks, kept side by side in the same arrays."""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray


class ActorCritic(eqx.Module):
    """Two networks of two tanh layers each: a Gaussian policy (mean, log σ) and the value of a state.

    They share nothing but their shape (stable-baselines3's `MlpPolicy`), so that one matrix product serves
    the first layers of both and one batched product the second. Samples are *columns*: an activation is
    (features, batch), which lets the two halves of the first layer be split without moving a number.
    """

    first_weight: Float[Array, "both_first observations"]
    """Rows of the policy's first layer, then of the value's."""
    first_bias: Float[Array, " both_first"]
    second_weight: Float[Array, "2 second first"]
    """The policy's second layer, then the value's."""
    second_bias: Float[Array, "2 second"]
    mean_weight: Float[Array, "actions second"]
    mean_bias: Float[Array, " actions"]
    value_weight: Float[Array, " second"]
    value_bias: Float[Array, ""]
    log_std: Float[Array, " actions"]
    """log σ of the policy; does not depend on the state. With `value_bias` last: see `ppo.learn`."""
    num_seen: int | None = eqx.field(static=True, default=None)
    """How many observations, from the first on, the policy sees; `None` for all."""

    def __call__(
        self, observations: Float[Array, "observations batch"]
    ) -> tuple[Float[Array, "actions batch"], Float[Array, " batch"]]:
        """The policy's mean action and the value, for every column of `observations`."""
        means, values = self.without_value_bias(observations)
        return means, values + self.value_bias

    def without_value_bias(
        self, observations: Float[Array, "observations batch"]
    ) -> tuple[Float[Array, "actions batch"], Float[Array, " batch"]]:
        """The policy's mean action and the value less `value_bias`, for every column of `observations`."""
        first = self.second_weight.shape[2]
        first_weight = self.first_weight
        if self.num_seen is not None:
            first_weight = first_weight.at[:first, self.num_seen :].set(0)
        hidden = jnp.tanh(first_weight @ observations + self.first_bias[:, None])
        hidden = jnp.tanh(self.second_weight @ hidden.reshape(2, first, -1) + self.second_bias[:, :, None])
        policy_features, value_features = hidden
        means = self.mean_weight @ policy_features + self.mean_bias[:, None]
        return means, self.value_weight @ value_features

    def actor(self) -> Callable[[Float[Array, " observations"]], Float[Array, " actions"]]:
        """The policy's mean action in one state, as a function; the value network is not run.

        Weights are transposed here, once, so that a product with a single state runs along memory.
        """
        layers = [(weight.T, bias) for weight, bias in self.policy_layers]

        def mean_action(observation):
            observation = observation[: self.num_seen]
            *hidden, (weight, bias) = layers
            for hidden_weight, hidden_bias in hidden:
                observation = jnp.tanh(observation @ hidden_weight + hidden_bias)
            return observation @ weight + bias

        return mean_action

    def means(self, observations: Float[Array, "observations batch"]) -> Float[Array, "actions batch"]:
        """The policy's mean action for every column of `observations`; the value network is not run."""
        (weight_1, bias_1), (weight_2, bias_2), (weight_3, bias_3) = self.policy_layers
        hidden = jnp.tanh(weight_1 @ observations[: self.num_seen] + bias_1[:, None])
        hidden = jnp.tanh(weight_2 @ hidden + bias_2[:, None])
        return weight_3 @ hidden + bias_3[:, None]

    def values(self, observations: Float[Array, "observations batch"]) -> Float[Array, " batch"]:
        """The value of every column of `observations`; the policy network is not run."""
        (weight_1, bias_1), (weight_2, bias_2), (weight_3, bias_3) = self.value_layers
        hidden = jnp.tanh(weight_1 @ observations + bias_1[:, None])
        hidden = jnp.tanh(weight_2 @ hidden + bias_2[:, None])
        return (weight_3 @ hidden + bias_3[:, None])[0]

    @property
    def policy_layers(self) -> tuple[tuple[Array, Array], ...]:
        """(weight, bias) of the policy's three layers; a weight is (outputs, inputs), of what it sees."""
        first = self.second_weight.shape[2]
        return (
            (self.first_weight[:first, : self.num_seen], self.first_bias[:first]),
            (self.second_weight[0], self.second_bias[0]),
            (self.mean_weight, self.mean_bias),
        )

    @property
    def value_layers(self) -> tuple[tuple[Array, Array], ...]:
        """(weight, bias) of the value network's three layers; a weight is (outputs, inputs)."""
        first = self.second_weight.shape[2]
        return (
            (self.first_weight[first:], self.first_bias[first:]),
            (self.second_weight[1], self.second_bias[1]),
            (self.value_weight[None], self.value_bias[None]),
        )

    @classmethod
    def from_layers(
        cls, policy: Sequence[tuple[Array, Array]], value: Sequence[tuple[Array, Array]], log_std: Array
    ) -> "ActorCritic":
        """The inverse of `policy_layers` and `value_layers`."""
        (p1, pb1), (p2, pb2), (p3, pb3) = policy
        (v1, vb1), (v2, vb2), (v3, vb3) = value
        num_seen, num_hidden = p1.shape[1], v1.shape[1] - p1.shape[1]
        if num_hidden:
            p1 = jnp.pad(p1, ((0, 0), (0, num_hidden)))
        return cls(
            first_weight=jnp.concatenate([p1, v1]),
            first_bias=jnp.concatenate([pb1, vb1]),
            second_weight=jnp.stack([p2, v2]),
            second_bias=jnp.stack([pb2, vb2]),
            mean_weight=p3,
            mean_bias=pb3,
            value_weight=v3[0],
            value_bias=vb3[0],
            log_std=log_std,
            num_seen=num_seen if num_hidden else None,
        )


def initial_networks(
    key: PRNGKeyArray,
    num_observations: int,
    num_actions: int,
    hidden_sizes: tuple[int, int],
    dtype=None,
    num_seen: int | None = None,
) -> ActorCritic:
    """Orthogonal weights; biases and log σ are 0.

    `num_seen` as in `ActorCritic`. The gain is √2 in the hidden layers, 0.01 for the mean action and 1 for
    the value. Source: stable-baselines3 2.9, `ActorCriticPolicy`, `ortho_init=True`.
    """
    first, second = hidden_sizes
    gains = (2**0.5, 2**0.5)

    def layers(key, num_observations, output_size, output_gain):
        sizes = ((first, num_observations), (second, first), (output_size, second))
        keys = jax.random.split(key, 3)
        return [
            (jax.nn.initializers.orthogonal(gain)(k, size, dtype), jnp.zeros(size[0], dtype))
            for k, size, gain in zip(keys, sizes, (*gains, output_gain), strict=True)
        ]

    policy_key, value_key = jax.random.split(key)
    policy = layers(policy_key, num_observations if num_seen is None else num_seen, num_actions, 0.01)
    value = layers(value_key, num_observations, 1, 1.0)
    return ActorCritic.from_layers(policy, value, jnp.zeros(num_actions, dtype))
