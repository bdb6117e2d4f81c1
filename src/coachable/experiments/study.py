"""What a study is: which reward setups and seeds are trained, on what, with which settings."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import prod
from typing import Any, Literal, Protocol, runtime_checkable

from coachable.foundation.errors import PlanError
from coachable.foundation.suggestion import suggestion
from coachable.foundation.toml_writer import toml_text
from coachable.learning.config import PPOConfig
from coachable.plants.compass import CompassParameters
from coachable.rewards.forms import VARIANTS, Variant
from coachable.rewards.setup import PAPER_SETUPS, RewardSetup, Semantics

CHOICES = {
    "semantics": ("paper", "released-code"),
    "reward_variant": VARIANTS,
    "clock": ("free", "touchdown"),
    "trainer": ("ppo", "sb3-ppo", "sb3-sac", "sb3-td3"),
}
Trainer = Literal["ppo", "sb3-ppo", "sb3-sac", "sb3-td3"]
_NAME = re.compile(r"[A-Za-z0-9_+-]+")


@dataclass(frozen=True)
class Lane:
    """One (setup, seed) run, trained beside others."""

    setup: str
    seed: int

    @property
    def name(self) -> str:
        """`setup-seed`, as in the run folder."""
        return f"{self.setup}-{self.seed}"


@dataclass(frozen=True, kw_only=True)
class Study:
    """A resolved plan: nothing about the runs is left open.

    Raises `PlanError` at construction, naming the key, if a value makes no sense.
    """

    name: str
    semantics: Semantics = "paper"
    """`paper` (what the paper means) or `released-code` (what its code does)."""
    reward_variant: Variant = "stay"
    """Table of the phase reward: `stay`, `equation` or `released`."""
    behaviour: str = "compass-walking"
    """The described behaviour: a shipped name or a file."""
    clock: Literal["free", "touchdown"] = "free"
    """`free` samples every 0.01 s; `touchdown` restarts the sample clock at every touchdown."""
    trainer: Trainer = "ppo"
    """`ppo` is ours; the others are stable-baselines3's and need the [sb3] extra."""
    steps: int = 500_000
    """Training steps a lane, rounded up to whole rollouts."""
    evaluate_every: int = 10_000
    """Training steps between two evaluations."""
    first_seed: int = 0
    num_seeds: int = 15
    setups: tuple[RewardSetup, ...] = tuple(PAPER_SETUPS.values())
    plant: CompassParameters = field(default_factory=CompassParameters)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    """Settings of `ppo`."""
    sb3: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Settings of the other trainers that differ from their defaults; see `learning.sb3.Learner`."""

    def __post_init__(self) -> None:
        check_choices(vars(self))
        for key, least in {"steps": 1, "evaluate_every": 1, "first_seed": 0, "num_seeds": 1}.items():
            if getattr(self, key) < least:
                raise PlanError(f"{key} must be at least {least}, got {getattr(self, key)}")
        if self.first_seed + self.num_seeds > 2**31:
            raise PlanError(f"seeds must stay below 2³¹, got {self.first_seed} and {self.num_seeds} on")
        names = [setup.name for setup in self.setups]
        if not names:
            raise PlanError("a study needs at least one setup")
        for name in (self.name, *names):
            if not _NAME.fullmatch(name):
                raise PlanError(f"{name!r} must be made of letters, digits, '+', '-' and '_': it names files")
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise PlanError(f"the setup {repeated[0]!r} is there more than once")
        if self.trainer == "ppo" and self.sb3:
            raise PlanError(
                "the table sb3 is for the trainers sb3-…; the settings of ppo are in the table ppo"
            )
        if self.trainer != "ppo":
            steps_an_update(self.trainer, self.sb3)
        if self.semantics == "released-code" and self.sb3.get("n_envs", 1) != 1:
            raise PlanError("released-code evaluates in the one environment it trains in: n_envs must be 1")

    @property
    def steps_an_update(self) -> int:
        """Training steps between two moments at which a lane's weights change."""
        return self.ppo.n_steps if self.trainer == "ppo" else steps_an_update(self.trainer, self.sb3)

    @property
    def num_updates(self) -> int:
        """Updates a lane: whole rollouts that cover `steps`, as stable-baselines3 counts."""
        return -(-self.steps // self.steps_an_update)

    @property
    def total_steps(self) -> int:
        """Training steps a lane: `steps` rounded up to whole updates."""
        return self.num_updates * self.steps_an_update

    @property
    def seeds(self) -> range:
        """The seeds of every setup."""
        return range(self.first_seed, self.first_seed + self.num_seeds)

    @property
    def lanes(self) -> tuple[Lane, ...]:
        """Every (setup, seed), setup by setup."""
        return tuple(Lane(setup.name, seed) for setup in self.setups for seed in self.seeds)

    @property
    def distance(self) -> str:
        """The column of an evaluation that is its distance: `hip_x`, or `foot_x` in `released-code`."""
        return "hip_x" if self.semantics == "paper" else "foot_x"

    def to_toml(self) -> str:
        """The plan as TOML; `load_plan` of the written file gives an equal study."""
        return toml_text(self.to_data())

    def to_data(self) -> dict[str, Any]:
        """The plan as the nested tables of its TOML form."""
        plain = (
            "name",
            "semantics",
            "reward_variant",
            "behaviour",
            "clock",
            "trainer",
            "steps",
            "evaluate_every",
        )
        setups = {setup.name: dataclasses.asdict(setup) for setup in self.setups}
        return {
            **{key: getattr(self, key) for key in plain},
            "seeds": {"first": self.first_seed, "count": self.num_seeds},
            "setups": {
                name: {k: v for k, v in weights.items() if k != "name"} for name, weights in setups.items()
            },
            "plant": dataclasses.asdict(self.plant),
            **({"ppo": dataclasses.asdict(self.ppo)} if self.trainer == "ppo" else {"sb3": dict(self.sb3)}),
        }


def steps_an_update(trainer: Trainer, settings: Mapping[str, Any]) -> int:
    """Environment steps between two moments at which the weights of stable-baselines3's algorithms change."""
    defaults = {"n_steps": 2048, "n_envs": 1} if trainer == "sb3-ppo" else {"train_freq": 1}
    factors = {name: settings.get(name, default) for name, default in defaults.items()}
    for name, factor in factors.items():
        if type(factor) is not int or factor < 1:
            raise PlanError(f"sb3.{name} must be a whole number, at least 1, got {factor!r}")
    return prod(factors.values())


def check_choices(values: Mapping[str, Any]) -> None:
    """**Raises:** `PlanError` if a key that has a few possible values has another one."""
    for key, choices in CHOICES.items():
        if key in values and values[key] not in choices:
            raise PlanError(f"{key} = {values[key]!r}: {suggestion(str(values[key]), choices)}")


@runtime_checkable
class Plan(Protocol):
    """What a run folder is made from."""

    def to_data(self) -> dict[str, Any]:
        """The plan as the nested tables of its TOML form."""
        ...


def differences(ours: Plan, theirs: Plan) -> list[str]:
    """One line a key in which two plans differ: `key: ours → theirs`."""
    left, right = _flat(ours.to_data()), _flat(theirs.to_data())
    return [
        f"{key}: {left.get(key, 'absent')!r} → {right.get(key, 'absent')!r}"
        for key in dict.fromkeys((*left, *right))
        if left.get(key) != right.get(key) or (key in left) != (key in right)
    ]


def _flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in data.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return flat
