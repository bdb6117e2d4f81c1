"""The experiment: problem × reward setups × seeds × trainer × budget, with nothing left open."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.problem import PlantProblem, Problem, Setup
from coachable.envs.squashing import DETERMINISTIC, Deterministic
from coachable.experiments.trainers.trainer import Trainer
from coachable.foundation.data import toml_text, whole_number
from coachable.foundation.errors import PlanError
from coachable.foundation.suggestion import suggestion
from coachable.rewards.setup import TERM_NAMES, DescribedSetup, RewardSetup

Which = Literal["last", "best"]
"""Of a lane's policies: after the last update, or at the best evaluation return."""

EVALUATION_SEED = 1_000_000
"""Evaluations in Gymnasium environments start where no training does: episode i has this seed + i."""

_BOUNDS = {
    "steps": (1, 10**12),
    "evaluate_every": (1, 10**12),
    "evaluation_episodes": (1, 10**6),
    "first_seed": (0, 2**31 - 1),
    "num_seeds": (1, 2**31 - 1),
}
_MOST_LANES = 100_000
_LONGEST_NAME = 100
_NAME = re.compile(r"[A-Za-z0-9_+-]+")


@dataclass(frozen=True)
class Lane:
    """One (setup, seed) of an experiment."""

    setup: str
    seed: int

    @property
    def name(self) -> str:
        """`setup-seed`, as in the run folder."""
        return f"{self.setup}-{self.seed}"


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A resolved plan: its parts are values, and no name or path has to be looked up again.

    **Raises:** `PlanError` at construction, naming the key, for a value that makes no sense, and for a
    trainer that cannot train the problem.
    """

    name: str
    problem: Problem
    setups: tuple[Setup, ...]
    trainer: Trainer
    described_by: str
    """Where the behaviour was read: a shipped name or a file. Its text is kept in the run folder."""
    steps: int = 500_000
    """Training steps a lane, rounded up to whole updates."""
    evaluate_every: int = 10_000
    """Training steps between two evaluations."""
    evaluation_episodes: int = 1
    """Episodes an evaluation, always from the same starts; a plant has one start."""
    first_seed: int = 0
    num_seeds: int = 1
    deterministic: tuple[Deterministic, ...] = ("clipped-mean",)
    """What policies do when they do not explore: by the first rule they are evaluated, chosen and kept; by
    further ones they are evaluated, too."""

    def __post_init__(self) -> None:
        for key, (least, most) in _BOUNDS.items():
            number = whole_number(getattr(self, key), key, PlanError, least, most)
            object.__setattr__(self, key, number)
        names = [setup.name for setup in self.setups]
        if not names:
            raise PlanError("an experiment needs at least one setup")
        for name in (self.name, *names):
            if not _NAME.fullmatch(name):
                raise PlanError(f"{name!r} must be made of letters, digits, '+', '-' and '_': it names files")
            if len(name) > _LONGEST_NAME:
                raise PlanError(f"{name[:20]}… names files, and must have at most {_LONGEST_NAME} letters")
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise PlanError(f"the setup {repeated[0]!r} is there more than once")
        if reason := self.trainer.cannot_train(self.problem):
            raise PlanError(reason)
        self._check_rules()
        # In a Gymnasium environment half of the evaluations' seed: a lane's environments are seeded one after
        # another from a multiple of the lane's seed on.
        end = 2**31 if self.problem.in_jax else EVALUATION_SEED // 2
        if self.seeds.stop > end:
            raise PlanError(f"seeds must be less than {end:,}, got {self.seeds.stop - 1:,}")
        lanes = len(names) * self.num_seeds
        if lanes > _MOST_LANES:
            raise PlanError(f"setups times seeds must be at most {_MOST_LANES:,}, got {lanes:,}")

    def _check_rules(self) -> None:
        rules = self.deterministic
        if not rules or len(set(rules)) < len(rules):
            raise PlanError(f"deterministic = {list(rules)}: name one rule, or each rule once")
        for rule in rules:
            if rule not in DETERMINISTIC:
                hint = suggestion(str(rule), DETERMINISTIC)
                raise PlanError(f"deterministic = {rule!r}: {hint}")
        if "expected-action" in rules and self.trainer.squashing != "clip":
            raise PlanError(
                "deterministic = 'expected-action': the mean of an action that is squashed by tanh has no "
                "closed form; take clipped-mean, which squashes the mean, or squashing = 'clip'"
            )
        if not self.trainer.compiled:
            if len(rules) > 1:
                raise PlanError(
                    f"trainer {self.trainer.name!r} evaluates by one rule: give one deterministic"
                )
            if hidden := [each.name for each in self.reward_setups if each.observe == "value-only"]:
                raise PlanError(
                    f"setup {hidden[0]!r}: observe = 'value-only' needs trainer = 'ppo'; {self.trainer.name} "
                    "shows its policy and its value network the same"
                )
        named = [s.name for s in self.setups if isinstance(s, DescribedSetup) and s.mirror == "samples"]
        if named and not self.trainer.mirrors_samples:
            raise PlanError(
                f"setup {named[0]!r}: mirror = 'samples' needs trainer = 'ppo'; {self.trainer.name} adds no "
                "mirrored samples, but its policies can be mirrored by phase: mirror = true"
            )

    @property
    def behaviour(self) -> Behaviour:
        """The problem's."""
        return self.problem.behaviour

    @property
    def seeds(self) -> range:
        """The seeds of every setup."""
        return range(self.first_seed, self.first_seed + self.num_seeds)

    @property
    def lanes(self) -> tuple[Lane, ...]:
        """Every (setup, seed).

        Setup by setup; in Gymnasium environments, where lanes are trained one after another, seed by seed, so
        that an interrupted run has as many of each setup.
        """
        if self.problem.in_jax:
            return tuple(Lane(setup.name, seed) for setup in self.setups for seed in self.seeds)
        return tuple(Lane(setup.name, seed) for seed in self.seeds for setup in self.setups)

    @property
    def num_updates(self) -> int:
        """Updates a lane: as many as cover `steps`."""
        return -(-self.steps // self.trainer.steps_an_update)

    @property
    def total_steps(self) -> int:
        """Training steps a lane: `steps` rounded up to whole updates."""
        return self.num_updates * self.trainer.steps_an_update

    @property
    def setup_names(self) -> tuple[str, ...]:
        """The setups' names, in the plan's order."""
        return tuple(setup.name for setup in self.setups)

    @property
    def reward_setups(self) -> tuple[RewardSetup, ...]:
        """The setups of a plant's experiment."""
        return tuple(setup for setup in self.setups if isinstance(setup, RewardSetup))

    def setup(self, name: str) -> Any:
        """The setup of this name."""
        return next(setup for setup in self.setups if setup.name == name)

    def reward_hashes(self) -> dict[str, str]:
        """A name for what each setup pays."""
        return {setup.name: self.problem.reward_hash(setup) for setup in self.setups}

    def require_plant(self, what: str) -> PlantProblem:
        """The problem, which must be a plant's.

        **Raises:** `PlanError` saying that `what` needs a plant.
        """
        if not isinstance(self.problem, PlantProblem):
            raise PlanError(
                f"{what} needs a plant of coachable; {self.problem.robot} is a Gymnasium environment"
            )
        return self.problem

    def to_toml(self) -> str:
        """The plan as TOML; reading it gives an equal experiment."""
        return toml_text(self.to_data())

    def to_data(self) -> dict[str, Any]:
        """The plan as the nested tables of its TOML form."""
        return {
            "name": self.name,
            "behaviour": self.described_by,
            "trainer": self.trainer.name,
            "steps": self.steps,
            "evaluate_every": self.evaluate_every,
            **({} if self.deterministic == ("clipped-mean",) else {"deterministic": [*self.deterministic]}),
            **({} if self.problem.in_jax else {"evaluation_episodes": self.evaluation_episodes}),
            "seeds": {"first": self.first_seed, "count": self.num_seeds},
            **self.problem.to_data(),
            "setups": {setup.name: _weights(setup) for setup in self.setups},
            **self.trainer.to_data(),
        }


def differences(ours: Experiment, theirs: Experiment) -> list[str]:
    """One line a key in which two plans differ: `key: ours → theirs`."""
    left, right = _flat(ours.to_data()), _flat(theirs.to_data())
    return [
        f"{key}: {left.get(key, 'absent')!r} → {right.get(key, 'absent')!r}"
        for key in dict.fromkeys((*left, *right))
        if left.get(key) != right.get(key) or (key in left) != (key in right)
    ]


def _weights(setup: Setup) -> dict[str, Any]:
    """The setup's table; of a plant's setup the settings beside its weights only if they are not as usual."""
    table = {
        key: value for key, value in dataclasses.asdict(setup).items() if key != "name" and value is not None
    }
    if isinstance(setup, RewardSetup):
        usual = dataclasses.asdict(RewardSetup(setup.name))
        table = {key: value for key, value in table.items() if key in TERM_NAMES or value != usual[key]}
    return table


def _flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in data.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return flat
