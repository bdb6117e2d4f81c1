"""Proximal policy optimisation (Schulman et al., 2017, arXiv 1707.06347), with stable-baselines3's meaning.

One *lane* is one training run: one environment, one policy. It goes round in a circle:

    collect   n_steps of the task with the present policy        → a Rollout
    estimate  advantages and returns                             (gae.py)
    learn     n_epochs × num_minibatches steps of Adam on the clipped surrogate

Functions here know one lane; `update_lanes` is many of them at once. A lane's numbers depend on its own key
and task and on nothing that runs beside it.
"""

from dataclasses import replace
from functools import partial
from math import log, pi
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from coachable.envs.walking_task import Task
from coachable.learning.config import PPOConfig
from coachable.learning.gae import generalised_advantages
from coachable.learning.networks import ActorCritic, initial_networks

ADAM_DECAYS = (0.9, 0.999)


class Adam(eqx.Module):
    """The optimiser's memory; all parameters in one vector, so that a step is a handful of long loops."""

    first_moment: Float[Array, " parameters"]
    second_moment: Float[Array, " parameters"]
    count: Float[Array, ""]


class TrainState(eqx.Module):
    """All that a lane is between two updates: resume from it and the lane goes on to the bit."""

    networks: ActorCritic
    adam: Adam
    task_state: Any
    key: PRNGKeyArray
    num_updates: Int[Array, ""]
    episode_return: Float[Array, ""]
    """Return so far of the training episode under way."""
    episode_length: Int[Array, ""]


class Rollout(eqx.Module):
    """Consecutive steps of one lane. Row t is what happened from s_t to s_{t+1}.

    `steps` is the number of steps, and behind it, where a lane has several environments, that of those.
    """

    observations: Float[Array, "*steps observations"]
    next_observations: Float[Array, "*steps observations"]
    """Where the step led, before any reset."""
    actions: Float[Array, "*steps actions"]
    """As sampled; the task squashes them into its box."""
    log_probabilities: Float[Array, "*steps"]
    rewards: Float[Array, "*steps"]
    terminated: Bool[Array, "*steps"]
    truncated: Bool[Array, "*steps"]


class Episodes(eqx.Module):
    """The training episode as of every step of a rollout; a finished one stands where `ended` is true."""

    ended: Bool[Array, "*steps"]
    episode_return: Float[Array, "*steps"]
    length: Int[Array, "*steps"]
    fell: Bool[Array, "*steps"]


class Diagnostics(eqx.Module):
    """How an update went, by the definitions of stable-baselines3 2.9 (`PPO.train`).

    Over the samples t of a minibatch, with the networks before its step of Adam, the advantages A_t
    normalised in the minibatch, and ρ_t = π(a_t | s_t) / π_old(a_t | s_t):

        approx_kl          = mean (ρ_t − 1 − log ρ_t)
        clip_fraction      = mean 1[|ρ_t − 1| > ε]
        value_loss         = mean (R_t − V(s_t))²
        policy_loss        = −mean min(ρ_t A_t, clip(ρ_t, 1 ± ε) A_t)
        entropy            = H(π(· | s_t)) = Σ_i (log σ_i + ½ log 2πe)

    Each is the mean over the minibatches of all epochs; `approx_kl`, of the last epoch only. Mirror images
    (`with_images`) are samples, too; with them the first two also tell how far a policy is from its image. Of
    the whole rollout, with the values V before the update, and of the policy after it:

        explained_variance = 1 − Var(R_t − V(s_t)) / Var(R_t)
        std                = mean σ_i

    Sources: Schulman et al., 2017, eqs. 6, 7 and 9; for `approx_kl`, the estimator k₃ of KL(π_old ‖ π) in
    J. Schulman, "Approximating KL divergence" (2020).
    """

    approx_kl: Float[Array, ""]
    clip_fraction: Float[Array, ""]
    explained_variance: Float[Array, ""]
    """1: the values predict the returns; 0: no better than a constant. NaN if all returns are equal."""
    value_loss: Float[Array, ""]
    policy_loss: Float[Array, ""]
    entropy: Float[Array, ""]
    std: Float[Array, ""]


class Predictions(eqx.Module):
    """What is kept of a minibatch for `Diagnostics`, from before its step of Adam."""

    log_ratios: Float[Array, "*minibatches batch"]
    """log ρ_t, see `loss`."""
    values: Float[Array, "*minibatches batch"]
    """V(s_t) less the bias of the value network's last layer."""


class Batch(eqx.Module):
    """What the learner sees of a rollout or a minibatch; samples are columns (see `ActorCritic`)."""

    observations: Float[Array, "observations batch"]
    actions: Float[Array, "actions batch"]
    log_probabilities: Float[Array, " batch"]
    advantages: Float[Array, " batch"]
    returns: Float[Array, " batch"]


def init(key: PRNGKeyArray, task: Task, config: PPOConfig) -> TrainState:
    """A lane before its first step."""
    key, network_key, task_key = jax.random.split(key, 3)
    task_state = task.init(task_key)
    dtype = task.observation(task_state).dtype
    networks = initial_networks(
        network_key,
        task.observation_size,
        task.action_size,
        config.hidden_sizes,
        dtype,
        num_seen=task.num_seen,
    )
    return initial_state(key, networks, task_state)


def initial_state(key: PRNGKeyArray, networks: ActorCritic, task_state: Any) -> TrainState:
    """A lane with these networks before its first step."""
    dtype = networks.log_std.dtype
    zeros = jnp.zeros_like(ravel_pytree(networks)[0])
    return TrainState(
        networks=networks,
        adam=Adam(zeros, zeros, jnp.zeros((), dtype)),
        task_state=task_state,
        key=key,
        num_updates=jnp.zeros((), jnp.int32),
        episode_return=jnp.zeros((), dtype),
        episode_length=jnp.zeros((), jnp.int32),
    )


def update_lanes(
    tasks: Task, config: PPOConfig, states: TrainState
) -> tuple[TrainState, Episodes, Diagnostics]:
    """One PPO update of every lane; `tasks` and `states` are stacked over lanes.

    The physics of all lanes advances side by side, which fills the processor's vectors; learning takes one
    lane after another, so that its weights stay in the cache.
    """
    states, rollouts, episodes = jax.vmap(partial(collect, config=config))(tasks, states)
    states, diagnostics = lax.map(lambda lane: improve(config, *lane), (states, rollouts))
    return states, episodes, diagnostics


def update(task: Task, config: PPOConfig, state: TrainState) -> tuple[TrainState, Episodes, Diagnostics]:
    """One PPO update of one lane."""
    state, rollout, episodes = collect(task, state, config)
    state, diagnostics = improve(config, state, rollout)
    return state, episodes, diagnostics


def collect(task: Task, state: TrainState, config: PPOConfig) -> tuple[TrainState, Rollout, Episodes]:
    """Run the present policy for `n_steps`, over as many episodes as that takes."""
    networks, mean_action = state.networks, state.networks.actor()
    key, noise_key, reset_key = jax.random.split(state.key, 3)
    noise = jax.random.normal(noise_key, (config.n_steps, task.action_size), networks.log_std.dtype)
    reset_keys = jax.random.split(reset_key, config.n_steps)

    def step(carry, inputs):
        task_state, episode_return, length = carry
        epsilon, key = inputs
        observation = task.observation(task_state)
        action = mean_action(observation) + jnp.exp(networks.log_std) * epsilon
        task_state, outcome = task.step(task_state, action)
        row = Rollout(
            observations=observation,
            next_observations=outcome.observation,
            actions=action,
            log_probabilities=gaussian_log_probability(epsilon, networks.log_std),
            rewards=outcome.reward,
            terminated=outcome.terminated,
            truncated=outcome.truncated,
        )
        ended = outcome.terminated | outcome.truncated
        episode = Episodes(ended, episode_return + outcome.reward, length + 1, outcome.fell)
        before = (task_state, episode.episode_return, episode.length)
        after = (task.reset(task_state, key), jnp.zeros_like(episode_return), jnp.zeros_like(length))
        return jax.tree.map(partial(jnp.where, ended), after, before), (row, episode)

    carry = (state.task_state, state.episode_return, state.episode_length)
    carry, (rollout, episodes) = lax.scan(step, carry, (noise, reset_keys))
    task_state, episode_return, length = carry
    state = replace(
        state, task_state=task_state, key=key, episode_return=episode_return, episode_length=length
    )
    return state, rollout, episodes


def improve(
    config: PPOConfig,
    state: TrainState,
    rollout: Rollout,
    rate: float | Float[Array, ""] = 1.0,
    image: Rollout | None = None,
) -> tuple[TrainState, Diagnostics]:
    """Advantages, fresh permutations, and `n_epochs` passes over the rollout.

    **Arguments:** `rate`, what the learning rate is multiplied with; `image`, the rollout in the mirror, to
    be learned from as well: every minibatch gets the image of each of its samples (see `with_images`).
    """
    values, next_values = values_of(state.networks, rollout)
    ended = rollout.terminated | rollout.truncated
    advantages = generalised_advantages(
        rollout.rewards, values, next_values, rollout.terminated, ended, config.gamma, config.gae_lambda
    )
    batch = Batch(
        observations=columns(rollout.observations),
        actions=columns(rollout.actions),
        log_probabilities=rollout.log_probabilities.ravel(),
        advantages=advantages.ravel(),
        returns=(advantages + values).ravel(),
    )
    key, permutation_key = jax.random.split(state.key)
    permutations = random_permutations(permutation_key, config.n_epochs, config.rollout_size)
    if image is not None:
        batch, permutations = with_images(batch, image), beside_images(permutations, config)
    networks, adam, diagnostics = learn(state.networks, state.adam, batch, permutations, config, rate)
    state = replace(state, networks=networks, adam=adam, key=key, num_updates=state.num_updates + 1)
    return state, diagnostics


def columns(rows: Float[Array, "*steps numbers"]) -> Float[Array, "numbers batch"]:
    """The samples of a rollout as columns."""
    return rows.reshape(-1, rows.shape[-1]).T


def with_images(batch: Batch, image: Rollout) -> Batch:
    """The batch, and behind it the mirror image (P s, Q a) of each of its samples (s, a).

    An image has its sample's advantage and return, as the robot and its pay are the same in the mirror, and
    its sample's log-probability: it was drawn as if by the mirror image of the old policy, and Q keeps
    volumes, so π_old(a | s) is the density that it was drawn with. What the old policy itself gives Q a in
    P s is that density only if it is symmetric. Source: Abdolhosseini, Ling, Xie, Peng and van de Panne, *On
    learning symmetric locomotion* (MIG 2019), method DUP, and `get_mirror_function` in their code,
    github.com/UBCMOCCA/SymmetricRL.
    """
    images = replace(batch, observations=columns(image.observations), actions=columns(image.actions))
    return jax.tree.map(lambda ours, theirs: jnp.concatenate([ours, theirs], axis=-1), batch, images)


def beside_images(
    permutations: Int[Array, "permutations size"], config: PPOConfig
) -> Int[Array, "permutations twice_size"]:
    """Orders of a batch `with_images`: what was a minibatch, and then the images of its samples.

    So there are as many steps of Adam as without images, as in the authors' code, and what is the same in the
    mirror stays so in each of them.
    """
    pieces = permutations.reshape(-1, config.num_minibatches, config.batch_size)
    both = jnp.concatenate([pieces, pieces + permutations.shape[-1]], axis=-1)
    return both.reshape(len(permutations), -1)


def values_of(
    networks: ActorCritic, rollout: Rollout
) -> tuple[Float[Array, "*steps"], Float[Array, "*steps"]]:
    """V(s_t) and V(s_{t+1}) of every step, the latter before any reset."""

    def values_at(observations):
        return networks.values(columns(observations)).reshape(observations.shape[:-1])

    last = rollout.next_observations[-1:]
    values = values_at(jnp.concatenate([rollout.observations, last]))
    # The next row's value serves, unless a truncation put a fresh episode there.
    next_values = lax.cond(
        jnp.any(rollout.truncated), lambda: values_at(rollout.next_observations), lambda: values[1:]
    )
    return values[:-1], next_values


def random_permutations(
    key: PRNGKeyArray, num_permutations: int, size: int
) -> Int[Array, "permutations size"]:
    """Independent random orders of 0 … size − 1.

    Each sorts random words that carry their index in the low bits: one sort of plain integers, where
    `jax.random.permutation` sorts pairs, twice. Words that tie in the other bits keep their order: about one
    of two million pairs at size 2048.
    """
    low_bits = jnp.uint32(2 ** (size - 1).bit_length() - 1)
    words = jax.random.bits(key, (num_permutations, size), jnp.uint32)
    words = (words & ~low_bits) | jnp.arange(size, dtype=jnp.uint32)[None]
    return (lax.sort(words, dimension=1, is_stable=False) & low_bits).astype(jnp.int32)


def learn(
    networks: ActorCritic,
    adam: Adam,
    batch: Batch,
    permutations: Int[Array, "epochs batch"],
    config: PPOConfig,
    rate: float | Float[Array, ""] = 1.0,
) -> tuple[ActorCritic, Adam, Diagnostics]:
    """Adam on the clipped surrogate: an epoch a permutation of the batch, a step a minibatch."""
    parameters, unravel = ravel_pytree(networks)
    num_last = 1 + networks.log_std.size  # the value's bias and log σ end the vector

    def epoch(carry, permutation):
        samples = minibatches(batch, permutation, config)
        last_before = carry[0][-num_last:]
        carry, (predictions, last) = lax.scan(minibatch, carry, samples)
        last = jnp.concatenate([last_before[None], last[:-1]])
        return carry, epoch_means(predictions, last, samples, config)

    def minibatch(carry, samples):
        parameters, adam = carry
        gradient, predictions = jax.grad(loss, has_aux=True)(unravel(parameters), samples, config)
        parameters, adam = adam_step(parameters, adam, ravel_pytree(gradient)[0], config, rate)
        # Kept are the new ones: the old ones are overwritten, and reading any of them once more, be it only
        # for the diagnostics, would make the compiler copy them all.
        return (parameters, adam), (predictions, parameters[-num_last:])

    (parameters, adam), means = lax.scan(epoch, (parameters, adam), permutations)
    networks = unravel(parameters)
    diagnostics = Diagnostics(
        **{name: epochs.mean() for name, epochs in means.items()} | {"approx_kl": means["approx_kl"][-1]},
        explained_variance=explained_variance(batch),
        std=jnp.exp(networks.log_std).mean(),
    )
    return networks, adam, diagnostics


def epoch_means(
    predictions: Predictions, last: Float[Array, "minibatches last"], samples: Batch, config: PPOConfig
) -> dict[str, Float[Array, ""]]:
    """The `Diagnostics` of minibatches, by name, as means over an epoch.

    **Arguments:** of each of the epoch's minibatches, `predictions`, the value's bias and log σ before its
    step, in `last`, and `samples`.
    """
    ratios, values = jnp.exp(predictions.log_ratios), predictions.values + last[:, :1]
    return {
        "approx_kl": (ratios - 1 - predictions.log_ratios).mean(),
        "clip_fraction": (jnp.abs(ratios - 1) > config.clip_range).mean(dtype=ratios.dtype),
        "value_loss": jnp.square(samples.returns - values).mean(),
        "policy_loss": -clipped_surrogates(ratios, samples.advantages, config).mean(),
        "entropy": gaussian_entropy(last[:, 1:].T).mean(),
    }


def explained_variance(batch: Batch) -> Float[Array, ""]:
    """1 − Var(R − V) / Var(R) with the values V = R − A before the update; NaN if all returns are equal."""
    variance = jnp.var(batch.returns)
    return jnp.where(variance == 0, jnp.nan, 1 - jnp.var(batch.advantages) / variance)


def minibatches(batch: Batch, permutation: Int[Array, " batch"], config: PPOConfig) -> Batch:
    """The batch shuffled and cut along a leading axis, advantages normalised within each minibatch."""

    def cut(samples):
        shape = (*samples.shape[:-1], config.num_minibatches, -1)
        return jnp.moveaxis(samples[..., permutation].reshape(shape), -2, 0)

    pieces = jax.tree.map(cut, batch)
    mean = pieces.advantages.mean(axis=1, keepdims=True)
    deviation = pieces.advantages.std(axis=1, ddof=1, keepdims=True)
    return eqx.tree_at(lambda b: b.advantages, pieces, (pieces.advantages - mean) / (deviation + 1e-8))


def loss(networks: ActorCritic, samples: Batch, config: PPOConfig) -> tuple[Float[Array, ""], Predictions]:
    """The loss of a minibatch, and the predictions it rests on; the mean is over its samples t.

        ρ_t = π(a_t | s_t) / π_old(a_t | s_t)
        L = −mean min(ρ_t A_t, clip(ρ_t, 1 ± ε) A_t) + c_v mean (R_t − V(s_t))² − c_e mean H(π(· | s_t))
            + c_J mean ‖∂μ/∂s (s_t)‖²_F

    Source: eqs. 7 and 9 of the paper; no clipping and no ½ in the value loss, as in stable-baselines3. The
    last term is Jacobian regularisation (Hoffman, Roberts & Yaida, 2019, arXiv 1908.02729, eq. 4) of the
    mean action μ before it is squashed.
    """
    means, values_less_bias = networks.without_value_bias(samples.observations)
    values = values_less_bias + networks.value_bias
    log_std = networks.log_std
    standardised = (samples.actions - means) * jnp.exp(-log_std)[:, None]
    log_ratios = gaussian_log_probability(standardised, log_std) - samples.log_probabilities
    predictions = Predictions(log_ratios, values_less_bias)
    surrogate = clipped_surrogates(jnp.exp(log_ratios), samples.advantages, config).mean()
    value_loss = jnp.square(samples.returns - values).mean()
    entropy = gaussian_entropy(log_std)
    whole = -surrogate + config.vf_coef * value_loss - config.ent_coef * entropy
    if not config.jacobian_penalty:  # the program, and so every bit, is as if there were no such term
        return whole, predictions
    penalty = squared_slope(networks, samples.observations).mean()
    return whole + config.jacobian_penalty * penalty, predictions


def clipped_surrogates(
    ratios: Float[Array, "*batch"], advantages: Float[Array, "*batch"], config: PPOConfig
) -> Float[Array, "*batch"]:
    """min(ρ A, clip(ρ, 1 ± ε) A) of every sample (eq. 7 of the paper, before the mean)."""
    clipped = jnp.clip(ratios, 1 - config.clip_range, 1 + config.clip_range)
    return jnp.minimum(ratios * advantages, clipped * advantages)


def squared_slope(
    networks: ActorCritic, observations: Float[Array, "observations batch"]
) -> Float[Array, " batch"]:
    """‖∂μ/∂s‖²_F of the policy's mean action μ, for every column s of `observations`."""
    means, pull_back = jax.vjp(networks.means, observations)
    # A column's mean depends on no other column, so one pull-back gives a row of every column's Jacobian.
    rows = [pull_back(jnp.zeros_like(means).at[action].set(1.0))[0] for action in range(len(means))]
    return jnp.asarray(sum(jnp.square(row).sum(axis=0) for row in rows))


def gaussian_log_probability(
    standardised: Float[Array, "actions *batch"], log_std: Float[Array, " actions"]
) -> Float[Array, "*batch"]:
    """log N(a; μ, σ²) of independent components, from (a − μ) / σ."""
    normalisation = jnp.sum(log_std) + 0.5 * log(2 * pi) * log_std.size
    return -0.5 * jnp.sum(jnp.square(standardised), axis=0) - normalisation


def gaussian_entropy(log_std: Float[Array, "actions *batch"]) -> Float[Array, "*batch"]:
    """H = Σ_i (log σ_i + ½ log 2πe) of independent components."""
    return jnp.sum(log_std + 0.5 * log(2 * pi) + 0.5, axis=0)


def adam_step(
    parameters: Float[Array, " parameters"],
    adam: Adam,
    gradient: Float[Array, " parameters"],
    config: PPOConfig,
    rate: float | Float[Array, ""] = 1.0,
) -> tuple[Float[Array, " parameters"], Adam]:
    """Adam (Kingma & Ba, 2015, algorithm 1) after clipping the gradient's global norm.

    Both in PyTorch's form, which stable-baselines3 uses: ε stands outside the bias correction of the root.
    """
    norm = jnp.sqrt(jnp.sum(jnp.square(gradient)))
    gradient = gradient * jnp.minimum(1.0, config.max_grad_norm / (norm + 1e-6))
    decay_1, decay_2 = ADAM_DECAYS
    count = adam.count + 1
    first = decay_1 * adam.first_moment + (1 - decay_1) * gradient
    second = decay_2 * adam.second_moment + (1 - decay_2) * jnp.square(gradient)
    step_size = config.learning_rate * rate / (1 - decay_1**count)
    correction = 1 / (1 - decay_2**count)
    parameters = parameters - step_size * first / (jnp.sqrt(second * correction) + config.adam_epsilon)
    return parameters, Adam(first, second, count)
