"""One lane of a training: the environment with the described reward around it, and its evaluation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import equinox as eqx
import gymnasium
import numpy as np

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.signals.sources import signal_sources
from coachable.experiments.lane_processes import News, Tell
from coachable.experiments.layout import evaluation_steps
from coachable.experiments.log import Columns, Log
from coachable.experiments.sb3_lane import EpisodeLog, Episodes, Note, finished, train_lane
from coachable.experiments.study import Lane
from coachable.experiments.training import EVALUATION_SEED, DescribedSetup, Training
from coachable.foundation.errors import CoachableError, MissingExtraError, ParameterError, PlanError
from coachable.learning.policy import Policy

OWN = "environment"
"""What an info calls that which the environment itself paid."""


class OwnReward(gymnasium.Wrapper):
    """Tells what the environment paid, and pays, if `terms` say so, for other parts of it.

    **Raises:** from `step`, `ParameterError` for a term that the info does not tell.
    """

    def __init__(self, env: gymnasium.Env, terms: Mapping[str, float]):
        super().__init__(env)
        self._terms = terms

    def step(self, action: Any) -> Any:
        """One step; its info tells what the environment itself paid."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        own = float(reward)
        if self._terms:
            if missing := [name for name in self._terms if name not in info]:
                raise ParameterError(f"the environment's info has no term {missing[0]!r}; it has {[*info]}")
            reward = sum(weight * float(info[name]) for name, weight in self._terms.items())
        return observation, reward, terminated, truncated, {**info, OWN: own}


def make_env(
    training: Training, setup: DescribedSetup, behaviour: Behaviour, render_mode: str | None = None
) -> BehaviourReward:
    """The environment of a setup.

    **Raises:** `PlanError` if there is no such environment, or it is not made with these options, and what
    `BehaviourReward` raises.
    """
    options: dict[str, Any] = dict(training.env_options)
    if render_mode is not None:
        options["render_mode"] = render_mode
    try:
        env = gymnasium.make(training.env, disable_env_checker=True, **options)
    except gymnasium.error.DependencyNotInstalled as error:
        extra = "box2d" if "box2d" in str(error).lower() else "mujoco"
        raise MissingExtraError(training.env, extra) from None
    except (gymnasium.error.Error, ImportError) as error:
        raise PlanError(f"{training.env!r} cannot be made: {error}") from None
    # Whatever it is that somebody's constructor raises, it raises it at the options of the plan.
    except Exception as error:
        told = ", ".join(f"{name} = {value!r}" for name, value in options.items())
        given = f" with {told} (env_options)" if told else ""
        raise PlanError(f"{training.env!r} cannot be made{given}: {type(error).__name__}: {error}") from error
    return BehaviourReward(
        OwnReward(env, setup.terms),
        behaviour,
        signals=signal_sources(training.signals),
        weight=setup.weight,
        replace=setup.replace,
        form=setup.reward_variant,
        cycle_bonus=setup.cycle_bonus,
        observe="memory" if setup.append_phase else "nothing",
    )


@dataclass(frozen=True, eq=False)
class TrainingLane:
    """One lane, to be trained in a process of its own."""

    training: Training
    behaviour: Behaviour
    lane: Lane
    path: Path
    """Its checkpoint, and in the end all that came of it."""
    track: Path | None = None
    """The folder of its TensorBoard events."""

    @property
    def name(self) -> str:
        """`setup-seed`."""
        return self.lane.name

    def finished(self) -> News | None:
        """What there was to tell last, if the lane was trained to its end."""
        return finished(self.path)

    def run(self, tell: Tell) -> None:
        """Train and evaluate the lane."""
        from coachable.learning.sb3 import Learner

        training = self.training
        make = partial(make_env, training, training.setup(self.lane.setup), self.behaviour)
        outside = len(self.behaviour.phases)
        episodes = Episodes()
        learner = Learner(
            training.trainer,
            lambda: EpisodeLog(make(), episodes, partial(_paid, outside=outside)),
            training.sb3,
            self.lane.seed,
        )
        evaluation = make()

        def evaluate(policy: Policy) -> Columns:
            return walk_episodes(evaluation, policy, training.evaluation_episodes, outside)

        with _tracked(self.track) as note:
            due, steps = evaluation_steps(training), training.total_steps
            train_lane(learner, episodes, evaluate, due, steps, self.path, tell, note=note)


def walk_episodes(env: gymnasium.Env, policy: Policy, count: int, outside: int) -> Columns:
    """What a policy reaches in episodes that always begin at the same starts; a row each."""
    log = Log()
    act = actor(policy)
    for episode in range(count):
        observation, info = env.reset(seed=EVALUATION_SEED + episode)
        start = info.get("x_position", np.nan)
        sums = {"return": 0.0, OWN: 0.0, "behaviour": 0.0, "in_cycle": 0.0}
        length, terminated, truncated = 0, False, False
        while not (terminated or truncated):
            observation, reward, terminated, truncated, info = env.step(act(observation))
            length += 1
            for name, number in ({"return": float(reward)} | _paid(info, outside)).items():
                sums[name] += number
        row = {
            **sums,
            "episode": episode,
            "length": length,
            "fell": bool(terminated),
            "distance": info.get("x_position", np.nan) - start,
        }
        log.add({name: np.array([value]) for name, value in row.items()})
    return with_share(log.columns())


def actor(policy: Policy) -> Callable[[np.ndarray], np.ndarray]:
    """The policy as a function of an observation, compiled once for all policies of its shape."""
    return lambda observation: np.asarray(_act(policy, np.asarray(observation, np.float32)))


_act = eqx.filter_jit(lambda policy, observation: policy(observation))


def with_share(columns: Columns) -> Columns:
    """Episodes with the share of their steps in the cycle, in the place of their number."""
    rest = {name: values for name, values in columns.items() if name != "in_cycle"}
    return rest | {"share_in_cycle": columns["in_cycle"] / columns["length"]}


def _paid(info: Mapping[str, Any], outside: int) -> dict[str, float]:
    told = info["behaviour"]
    return {
        OWN: info[OWN],
        "behaviour": told["rewards"]["behaviour"],
        "in_cycle": float(told["location"] != outside),
    }


@contextmanager
def _tracked(folder: Path | None) -> Iterator[Note]:
    """What takes the notes of a lane: as events for TensorBoard, or nowhere."""
    if folder is None:
        yield lambda step, what, numbers: None
        return
    from tensorboardX import SummaryWriter

    with SummaryWriter(str(folder), flush_secs=10) as writer:

        def note(step: int, what: str, numbers: Mapping[str, float]) -> None:
            for name, number in numbers.items():
                writer.add_scalar(f"{what}/{name}", number, step)

        yield note


def require_trainable(training: Training, behaviour: Behaviour) -> None:
    """Make every setup's environment once, and take a step: what is wrong with it shows before work begins.

    **Raises:** what `make_env`, `Learner` and `BehaviourReward` raise.
    """
    from coachable.learning.sb3 import Learner, process_as_it_was, require_boxes

    for setup in training.setups:
        make = partial(make_env, training, setup, behaviour)
        env = make()
        try:
            require_boxes(env)
            with process_as_it_was():
                learner = Learner(training.trainer, make, training.sb3, training.first_seed)
                learner.policy()
                learner.close()
            env.reset(seed=0)
            env.step(env.action_space.sample())
        except CoachableError as error:
            raise PlanError(f"setup {setup.name!r}: {error}") from None
        except (KeyError, IndexError) as error:
            raise PlanError(f"setup {setup.name!r}: a signal is not where the plan says: {error!r}") from None
        finally:
            env.close()
