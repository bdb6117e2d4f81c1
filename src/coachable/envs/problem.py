"""A robot with a behaviour: what is trained, whoever trains it and whatever is paid for it."""

from __future__ import annotations

import abc
import json
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any, ClassVar

import gymnasium

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.behaviour_reward import BehaviourReward
from coachable.envs.gymnasium_env import PlantEnv
from coachable.envs.own_reward import ALIVE, OwnReward
from coachable.envs.signals.reading import OnNaN
from coachable.envs.signals.sources import SignalSources, signal_sources
from coachable.envs.squashing import Squashing
from coachable.envs.symmetry.derived import RobotMirror, derived_symmetry
from coachable.envs.symmetry.named_mirror import NamedMirror
from coachable.envs.symmetry.phase_mirror import MirroredEnv, PhaseMirror
from coachable.envs.walking_task import Clock, WalkingTask, make_task
from coachable.foundation.data import plain
from coachable.foundation.errors import MissingExtraError, ParameterError, PlanError
from coachable.foundation.suggestion import suggestion
from coachable.plants.named import name_of
from coachable.plants.plant import Plant
from coachable.rewards.controller_memory import memory_data
from coachable.rewards.described_reward import DescribedReward
from coachable.rewards.forms import RewardForm, form_from_data
from coachable.rewards.reward_hash import hash_of_paid, reward_hash
from coachable.rewards.setup import DescribedSetup, RewardSetup, Semantics

Setup = RewardSetup | DescribedSetup


class Problem(abc.ABC):
    """A robot with a behaviour: a Gymnasium environment always, and a task in JAX where its physics is."""

    in_jax: ClassVar[bool]
    """Whether there is a `Task`."""
    setup_type: ClassVar[type[Setup]]
    """What a reward setup of this problem is."""

    behaviour: Behaviour

    @property
    @abc.abstractmethod
    def robot(self) -> str:
        """The robot's name in headings and messages."""

    @property
    @abc.abstractmethod
    def distance(self) -> str:
        """The column of evaluations that holds how far the robot came [m]."""

    @abc.abstractmethod
    def environment(self, setup: Any, render_mode: str | None = None) -> gymnasium.Env:
        """The environment in which a lane of this setup is trained, its reward included."""

    def training_environment(self, setup: Any, evaluate_every: int) -> gymnasium.Env:
        """The environment as lanes that are evaluated every so many steps train in it."""
        return self.environment(setup)

    def sample_mirror(self, setup: Any) -> RobotMirror | None:
        """The mirror whose images of samples are learned from, too; `None` if none are."""
        return None

    def policy_description(self, setup: Any) -> dict[str, Any]:
        """Entries of a policy's description that its trainer does not know."""
        return {}

    @abc.abstractmethod
    def reward_hash(self, setup: Any) -> str:
        """A name for what the setup pays; see `rewards.reward_hash`."""

    @abc.abstractmethod
    def to_data(self) -> dict[str, Any]:
        """The problem as the tables of a plan's TOML form, without its behaviour."""


@dataclass(frozen=True, kw_only=True)
class PlantProblem(Problem):
    """A plant of ours with a behaviour, under a semantics and a sample clock.

    **Raises:** at construction `PlanError` for a behaviour that reads signals the plant does not have.
    """

    in_jax: ClassVar[bool] = True
    setup_type: ClassVar[type[Setup]] = RewardSetup

    behaviour: Behaviour
    plant: Plant
    """As the paper has it; `semantics` may change it."""
    semantics: Semantics = "paper"
    """`paper` (what the paper means) or `released-code` (what its code does)."""
    reward_variant: str | Mapping[str, Any] = "stay"
    """The reward form as plain data: its name, or a table with its fields; see `form_from_data`."""
    clock: Clock = "free"
    """`free` samples every 0.01 s; `touchdown` restarts the sample clock at every touchdown."""

    def __post_init__(self) -> None:
        for signal in self.behaviour.signal_names:
            if signal not in self.plant.state_names:
                raise PlanError(
                    f"behaviour {self.behaviour.name!r}: {self.plant.name} has no signal {signal!r}; "
                    + suggestion(signal, self.plant.state_names)
                )
        self.plant.under(self.semantics)

    @property
    def robot(self) -> str:
        """The plant's name."""
        return self.plant.name

    @property
    def form(self) -> RewardForm:
        """The reward form."""
        return form_from_data(self.reward_variant)

    @property
    def distance(self) -> str:
        """`hip_x`, or `foot_x` in `released-code`."""
        return "hip_x" if self.semantics == "paper" else "foot_x"

    def form_of(self, setup: RewardSetup) -> RewardForm:
        """The setup's own reward form, or else the problem's."""
        return self.form if setup.reward_variant is None else form_from_data(setup.reward_variant)

    def program_of(self, setup: RewardSetup) -> str:
        """What the compiled task of a setup depends on: setups that share it differ in weights alone."""
        return json.dumps([self.form_of(setup).to_data(), setup.observe, setup.time_limit], sort_keys=True)

    def task(self, setup: RewardSetup, *, squashing: Squashing = "clip", **options: Any) -> WalkingTask:
        """The task in JAX; `options` as in `make_task`."""
        return make_task(
            setup,
            self.semantics,
            self.form_of(setup),
            self.clock,
            behaviour=self.behaviour,
            plant=self.plant,
            squashing=squashing,
            **options,
        )

    def environment(
        self, setup: RewardSetup, render_mode: str | None = None, shared_evaluation_every: int = 0
    ) -> PlantEnv:
        """The task as a Gymnasium environment; `shared_evaluation_every` as in `make_task`."""
        return PlantEnv(
            setup,
            self.semantics,
            self.form_of(setup),
            self.clock,
            behaviour=self.behaviour,
            plant=self.plant,
            shared_evaluation_every=shared_evaluation_every,
            render_mode=render_mode,
        )

    def training_environment(self, setup: RewardSetup, evaluate_every: int) -> PlantEnv:
        """In `released-code` the evaluations move the walker that is trained."""
        released = self.semantics == "released-code"
        return self.environment(setup, shared_evaluation_every=evaluate_every if released else 0)

    def policy_description(self, setup: RewardSetup) -> dict[str, Any]:
        """What the policy observes, and the clock that it is sampled by."""
        seen, memory = self.plant.state_names, {}
        if setup.observe == "memory":
            reward = DescribedReward(self.behaviour, self.form_of(setup), WalkingTask.control_dt)
            seen += reward.observation_names
            memory = {"memory": memory_data(reward)}
        return {"observation_names": seen, "clock": self.clock, **memory}

    def reward_hash(self, setup: RewardSetup) -> str:
        """SHA-256 of what the setup pays."""
        return reward_hash(self.behaviour, self.form_of(setup), self.semantics, setup)

    def to_data(self) -> dict[str, Any]:
        """The keys `semantics`, `reward_variant`, `clock` and the table `plant`."""
        return {
            "semantics": self.semantics,
            "reward_variant": self.reward_variant,
            "clock": self.clock,
            "plant": {"kind": name_of(type(self.plant)), **asdict(self.plant.parameters)},
        }


@dataclass(frozen=True, kw_only=True)
class EnvironmentProblem(Problem):
    """A Gymnasium environment with a behaviour.

    **Raises:** at construction `ParameterError` for a mirror image of a robot whose behaviour has none.
    """

    in_jax: ClassVar[bool] = False
    setup_type: ClassVar[type[Setup]] = DescribedSetup

    behaviour: Behaviour
    env: str
    """The id for `gymnasium.make`; `module:id` imports a module first."""
    env_options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Further arguments of `gymnasium.make`."""
    signals: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Where signals are found, as `signal_sources` takes it; others are those of the pack."""
    dt: float | None = None
    """Time between two steps [s]; by default the environment's own."""
    on_nan: OnNaN = "raise"
    """What a signal that is NaN does; see `BehaviourReward`."""
    mirror_image: NamedMirror | None = None
    """What the robot looks like in a mirror, in place of what is derived of a MuJoCo robot."""

    def __post_init__(self):
        if self.mirror_image is not None and self.behaviour.symmetry is None:
            raise ParameterError(
                f"mirror: behaviour {self.behaviour.name!r} has no two sides, so nothing is mirrored; say so "
                "in it, as in `mirror left <-> right`, or leave the table out"
            )
        # Numbers of NumPy have no place in a plan, nor in what a reward is known by.
        for name in ("env_options", "signals", "dt"):
            object.__setattr__(self, name, plain(getattr(self, name)))

    @property
    def robot(self) -> str:
        """The environment's id."""
        return self.env

    @property
    def distance(self) -> str:
        """`distance`: how far `x_position` in the infos moved."""
        return "distance"

    def environment(self, setup: DescribedSetup, render_mode: str | None = None) -> gymnasium.Env:
        """The environment with the described reward around it; its observations are a row of numbers, if
        they can be.

        **Raises:** `PlanError` if there is no such environment, or it cannot be made with these options, and
        what `BehaviourReward` raises.
        """
        options: dict[str, Any] = dict(self.env_options)
        if render_mode is not None:
            options["render_mode"] = render_mode
        env = bare_environment(self.env, options)
        described = BehaviourReward(
            OwnReward(env, setup.terms),
            self.behaviour,
            signals=self.signal_sources,
            weight=setup.weight,
            replace=setup.replace,
            form=setup.form,
            cycle_bonus=setup.cycle_bonus,
            dt=self.dt,
            on_nan=self.on_nan,
            observe=setup.observe,
        )
        return _as_row(described)

    def training_environment(self, setup: DescribedSetup, evaluate_every: int) -> gymnasium.Env:
        """As a policy meets it: mirrored by phase, where it is."""
        env = self.environment(setup)
        mirror = self._mirror_in(env, setup)
        return env if mirror is None else MirroredEnv(env, mirror)

    def mirror(self, setup: DescribedSetup) -> PhaseMirror | None:
        """How the setup's policy is mirrored by phase; `None` if it is not.

        **Raises:** `ParameterError` with the reason, where the setup demands a mirror and there is none, and
        for a `mirror_image` that is not the robot's.
        """
        with closing(self.environment(setup)) as env:
            return self._mirror_in(env, setup)

    def sample_mirror(self, setup: DescribedSetup) -> RobotMirror | None:
        """That of all that the policy observes, memory included, if the setup says `mirror = "samples"`.

        **Raises:** as `mirror`.
        """
        if setup.mirror != "samples":
            return None
        with closing(self.environment(setup)) as env:
            mirror = self._map_in(env, setup)
        return None if mirror is None else RobotMirror(mirror.observation, mirror.action)

    def why_not_mirrored(self, setup: DescribedSetup) -> str:
        """Why a description with two sides is not mirrored, where the setup allows it; else nothing."""
        with closing(self.environment(setup)) as env:
            return self._mirror_or_reason(env, setup)[1]

    def _mirror_in(self, env: gymnasium.Env, setup: DescribedSetup) -> PhaseMirror | None:
        mirror = self._map_in(env, setup)
        return None if setup.mirror == "samples" else mirror

    def _map_in(self, env: gymnasium.Env, setup: DescribedSetup) -> PhaseMirror | None:
        mirror, reason = self._mirror_or_reason(env, setup)
        if reason and setup.mirror:
            demanded = "true" if setup.mirror is True else repr(setup.mirror)
            raise ParameterError(f"mirror = {demanded}: {reason}; leave it out, or write mirror = false")
        return mirror

    def _mirror_or_reason(self, env: gymnasium.Env, setup: DescribedSetup) -> tuple[PhaseMirror | None, str]:
        if setup.mirror is False:
            return None, ""
        if self.behaviour.symmetry is None:
            return None, "the description has no mirror" if setup.mirror else ""
        if not _is_row(env.observation_space):
            return None, f"what {self.env} observes is no row of numbers"
        reward: DescribedReward = env.get_wrapper_attr("behaviour_reward")
        names = reward.observation_names if setup.observe == "memory" else ()
        place: int | None = env.get_wrapper_attr("memory_place")
        if names and not _is_sorted(env):
            return None, f"the entries of what {self.env} observes are not sorted, which a memory would do"
        if self.mirror_image is not None:
            size = gymnasium.spaces.flatdim(env.observation_space) - len(names)
            return PhaseMirror.of(self.mirror_image.of(size, env), self.behaviour, names, place), ""
        robot = _robot_mirror(self)
        if isinstance(robot, str):
            return None, robot
        return PhaseMirror.of(robot, self.behaviour, names, place), ""

    def policy_description(self, setup: DescribedSetup) -> dict[str, Any]:
        """What the policy remembers, if it observes that or is mirrored by it."""
        with closing(self.environment(setup)) as env:
            mirror = self._mirror_in(env, setup)
            if setup.observe == "nothing" and mirror is None:
                return {}
            memory = memory_data(env.get_wrapper_attr("behaviour_reward"))
            place = env.get_wrapper_attr("memory_place")
        observed = memory if place is None else {**memory, "place": place}
        about = {"memory": observed} if setup.observe == "memory" else {}
        return about if mirror is None else about | {"mirror": {**mirror.to_data(), "memory": memory}}

    @property
    def signal_sources(self) -> SignalSources | None:
        """The sources of the signals that have one of their own."""
        return signal_sources(self.signals)

    def least_pay(self, setup: DescribedSetup) -> float | None:
        """What no step of a lane pays less than, but one that terminates; `None` where that is not known.

        It is known where nothing of the environment's own reward is paid, and the form says its part.
        """
        if min(setup.weight, setup.cycle_bonus) < 0 or not (setup.replace or set(setup.terms) == {ALIVE}):
            return None
        with closing(self.environment(setup)) as env:
            reward: DescribedReward = env.get_wrapper_attr("behaviour_reward")
        least = reward.bound_form.least_pay
        alive = 0.0 if setup.replace else setup.terms[ALIVE]
        return None if least is None else alive + setup.weight * least

    def reward_hash(self, setup: DescribedSetup) -> str:
        """SHA-256 of what the setup pays."""
        return hash_of_paid(
            self.behaviour,
            setup.form,
            weight=repr(setup.weight + 0.0),
            replace=setup.replace,
            terms={name: repr(weight + 0.0) for name, weight in sorted(setup.terms.items())},
            cycle_bonus=repr(setup.cycle_bonus + 0.0),
            signals=dict(sorted(self.signals.items())),
        )

    def to_data(self) -> dict[str, Any]:
        """The keys `env`, `dt` and `on_nan`, and the tables `env_options`, `signals` and `mirror`."""
        return {
            "env": self.env,
            **({} if self.dt is None else {"dt": self.dt}),
            "on_nan": self.on_nan,
            "env_options": dict(self.env_options),
            "signals": dict(self.signals),
            **({} if self.mirror_image is None else {"mirror": self.mirror_image.to_data()}),
        }


def bare_environment(env: str, options: Mapping[str, Any]) -> gymnasium.Env:
    """An environment by its id, with further arguments of `gymnasium.make`.

    **Raises:** `PlanError` if there is none, or it cannot be made with these options; `MissingExtraError` for
    a package that is missing.
    """
    try:
        return gymnasium.make(env, disable_env_checker=True, **options)
    except gymnasium.error.DependencyNotInstalled as error:
        extra = "box2d" if "box2d" in str(error).lower() else "mujoco"
        raise MissingExtraError(env, extra) from None
    except (gymnasium.error.Error, ImportError) as error:
        raise PlanError(f"{env!r} cannot be made: {error}") from None
    # Whatever an environment's constructor raises, it is the plan's options that it was given.
    except Exception as error:
        given = ", ".join(f"{name} = {value!r}" for name, value in options.items())
        given = f" with {given} (env_options)" if given else ""
        raise PlanError(f"{env!r} cannot be made{given}: {type(error).__name__}: {error}") from error


def _is_row(space: gymnasium.Space) -> bool:
    return isinstance(space, gymnasium.spaces.Box) and len(space.shape) == 1


def _is_sorted(env: gymnasium.Env) -> bool:
    """Whether the entries of what a described environment observes stay in their order with another one."""
    described = env.env if isinstance(env, gymnasium.wrappers.FlattenObservation) else env
    own = described.env.observation_space if isinstance(described, gymnasium.Wrapper) else None
    return not isinstance(own, gymnasium.spaces.Dict) or [*own] == sorted(own)


def _as_row(env: gymnasium.Env) -> gymnasium.Env:
    """The environment with observations that are a row of numbers, if they can be."""
    space = env.observation_space
    if _is_row(space) or not space.is_np_flattenable:
        return env
    return gymnasium.wrappers.FlattenObservation(env)


@lru_cache
def _robot_mirror(problem: EnvironmentProblem) -> RobotMirror | str:
    """The mirror image of a problem's robot, or why it has none: derived once for all copies in a process."""
    with closing(bare_environment(problem.env, problem.env_options)) as env:
        try:
            return derived_symmetry(_as_row(env), problem.behaviour, problem.signal_sources).mirror
        except ParameterError as error:
            return str(error)
