"""What a training is: setups that pay for a behaviour in somebody's environment, seeds, and a trainer."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import Any

from coachable.behaviours.library import SHIPPED
from coachable.experiments.study import Lane, Trainer, check_choices, steps_an_update
from coachable.foundation.data import seeds, table, text_of, typed, types
from coachable.foundation.errors import PlanError
from coachable.foundation.suggestion import suggestion
from coachable.foundation.toml_writer import toml_text
from coachable.rewards.forms import Variant

TRAINERS = ("sb3-ppo", "sb3-sac", "sb3-td3")
EVALUATION_SEED = 1_000_000
"""Evaluations begin where no seed of a training begins: episode i is reset with this seed + i."""
_NAME = re.compile(r"[A-Za-z0-9_+-]+")
_SHIPPED_SETTINGS = resources.files("coachable.experiments") / "settings"


@dataclass(frozen=True, kw_only=True)
class DescribedSetup:
    """How a lane is paid: the environment's own reward, and the behaviour's.

    Raises `PlanError` at construction, naming the key, if a value makes no sense.
    """

    name: str
    weight: float = 1.0
    """What the behaviour's reward is multiplied with; 0 watches the behaviour without paying for it."""
    replace: bool = False
    """Whether it is paid in the place of the environment's own."""
    terms: Mapping[str, float] = field(default_factory=dict, hash=False)
    """If given, the environment's own reward is put together anew: weights of numbers that its info tells."""
    reward_variant: Variant = "stay"
    cycle_bonus: float = 0.0
    append_phase: bool = False

    def __post_init__(self) -> None:
        for key, value in {"weight": self.weight, "cycle_bonus": self.cycle_bonus, **self.terms}.items():
            if not isfinite(value):
                raise PlanError(f"{key} must be a finite number, got {value!r}")


@dataclass(frozen=True, kw_only=True)
class Training:
    """A resolved plan: nothing about the runs is left open.

    Raises `PlanError` at construction, naming the key, if a value makes no sense.
    """

    name: str
    env: str
    """The id for `gymnasium.make`; `module:id` imports a module of yours first."""
    env_options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """What else `gymnasium.make` is given."""
    behaviour: str = ""
    """The described behaviour: a shipped name or a file."""
    signals: Mapping[str, int | str] = field(default_factory=dict, hash=False)
    """Where the behaviour's signals are: a column of the observation, or a key of the info. Without any, the
    environment's signal pack."""
    trainer: Trainer = "sb3-ppo"
    steps: int = 1_000_000
    """Training steps a lane, rounded up to whole rollouts."""
    evaluate_every: int = 20_000
    """Training steps between two evaluations."""
    evaluation_episodes: int = 5
    """Episodes an evaluation; always the same starts."""
    first_seed: int = 0
    num_seeds: int = 1
    setups: tuple[DescribedSetup, ...] = (DescribedSetup(name="both"),)
    sb3: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """The trainer's settings that differ from its defaults; see `learning.sb3.Learner`."""

    def __post_init__(self) -> None:
        if self.trainer not in TRAINERS:
            hint = "ppo is for the compass walker; take sb3-ppo" if self.trainer == "ppo" else None
            raise PlanError(f"trainer = {self.trainer!r}: {hint or suggestion(self.trainer, TRAINERS)}")
        for key, least in {
            "steps": 1,
            "evaluate_every": 1,
            "evaluation_episodes": 1,
            "first_seed": 0,
            "num_seeds": 1,
        }.items():
            if getattr(self, key) < least:
                raise PlanError(f"{key} must be at least {least}, got {getattr(self, key)}")
        if not self.env:
            raise PlanError('which environment? Give --env, or a line such as env = "Walker2d-v5"')
        if not self.behaviour:
            raise PlanError("which behaviour? Give --behaviour, a shipped name or a file")
        steps_an_update(self.trainer, self.sb3)
        # Half of it, for a lane's environments begin with one seed after another from the lane's on.
        if self.seeds.stop > EVALUATION_SEED // 2:
            raise PlanError(f"seeds must be less than {EVALUATION_SEED // 2:,}, got {self.seeds.stop - 1:,}")
        names = [setup.name for setup in self.setups]
        for name in (self.name, *names):
            if not _NAME.fullmatch(name):
                raise PlanError(f"{name!r} must be made of letters, digits, '+', '-' and '_': it names files")
        if not names or len({*names}) < len(names):
            raise PlanError(f"a training needs setups, each with a name of its own; got {names}")

    @property
    def seeds(self) -> range:
        """The seeds of every setup."""
        return range(self.first_seed, self.first_seed + self.num_seeds)

    @property
    def lanes(self) -> tuple[Lane, ...]:
        """Every (setup, seed), seed by seed: stopped half-way, as many of each setup are done."""
        return tuple(Lane(setup.name, seed) for seed in self.seeds for setup in self.setups)

    @property
    def steps_an_update(self) -> int:
        """Training steps between two moments at which a lane's weights change."""
        return steps_an_update(self.trainer, self.sb3)

    @property
    def total_steps(self) -> int:
        """Training steps a lane: `steps` rounded up to whole updates."""
        return -(-self.steps // self.steps_an_update) * self.steps_an_update

    def setup(self, name: str) -> DescribedSetup:
        """The setup of this name."""
        return next(setup for setup in self.setups if setup.name == name)

    def to_toml(self) -> str:
        """The plan as TOML; `load_training` of the written file gives an equal training."""
        return toml_text(self.to_data())

    def to_data(self) -> dict[str, Any]:
        """The plan as the nested tables of its TOML form."""
        plain = {key: getattr(self, key) for key in _PLAIN}
        setups = {setup.name: dataclasses.asdict(setup) for setup in self.setups}
        return {
            **plain,
            "seeds": {"first": self.first_seed, "count": self.num_seeds},
            "env_options": dict(self.env_options),
            "signals": dict(self.signals),
            "setups": {
                name: {k: v for k, v in values.items() if k != "name"} for name, values in setups.items()
            },
            "sb3": dict(self.sb3),
        }


_PLAIN: dict[str, type] = {
    "name": str,
    "env": str,
    "behaviour": str,
    "trainer": str,
    "steps": int,
    "evaluate_every": int,
    "evaluation_episodes": int,
}


def load_training(path: Path | None, **options: Any) -> Training:
    """A training from a TOML file, or from nothing, with options on top of it.

    **Arguments:** `options`, where not None, replace the file's keys, `seeds` (a count) among them; `weight`
    is that of every setup; `settings` are laid over the table `sb3`.

    **Raises:** `PlanError` naming the file and the key, with the nearest one that is known.
    """
    if path is None:
        return resolve({}, "the options", **options)
    return parse_training(text_of(path), str(path), path.parent, **options)


def parse_training(text: str, source: str, folder: Path | None = None, **options: Any) -> Training:
    """`load_training` for TOML text that messages call `source`, with a behaviour's file in `folder`."""
    data = _toml(text, source)
    behaviour = data.get("behaviour")
    if folder is not None and isinstance(behaviour, str) and behaviour not in SHIPPED:
        data["behaviour"] = str(folder / behaviour)
    return resolve(data, source, **options)


def resolve(data: Mapping[str, Any], source: str, **options: Any) -> Training:
    """A training from the tables of a plan, with options as in `load_training`."""
    given = {key: value for key, value in options.items() if value is not None}
    weight, count, settings = (given.pop(key, None) for key in ("weight", "seeds", "settings"))
    known = {*_PLAIN, "seeds", "env_options", "signals", "setups", "sb3"}
    values: dict[str, Any] = {}
    for key, value in data.items():
        if key not in known:
            raise PlanError(f"{source}: unknown key {key!r}; {suggestion(key, sorted(known))}")
        if key == "seeds":
            said = seeds(value, source)
            values |= {"first_seed" if k == "first" else "num_seeds": v for k, v in said.items()}
        elif key == "setups":
            values[key] = _setups(value, source)
        else:
            values[key] = typed(value, _PLAIN.get(key, dict), source, key)
    values |= given
    values |= {} if count is None else {"num_seeds": count}
    values |= {} if settings is None else {"sb3": {**values.get("sb3", {}), **settings}}
    if weight is not None:
        setups = values.get("setups", Training.setups)
        values["setups"] = tuple(dataclasses.replace(setup, weight=float(weight)) for setup in setups)
    values.setdefault("env", "")
    values.setdefault("name", re.sub(r"[^A-Za-z0-9_+-]+", "-", values["env"]).strip("-") or "training")
    try:
        return Training(**values)
    except PlanError as error:
        raise PlanError(f"{source}: {error}") from None


def trainer_settings(name_or_path: str) -> dict[str, Any]:
    """A trainer's settings: those that ship under a name, or a TOML file's.

    **Raises:** `PlanError` for one that is neither.
    """
    path = Path(name_or_path)
    if path.is_file():
        return _toml(text_of(path), str(path))
    if name_or_path in shipped_settings():
        file = _SHIPPED_SETTINGS / f"{name_or_path}.toml"
        return _toml(file.read_text(encoding="utf-8"), f"settings {name_or_path!r}")
    hint = suggestion(name_or_path, shipped_settings())
    raise PlanError(f"{name_or_path!r} are neither settings that ship nor a file; {hint}")


def shipped_settings() -> list[str]:
    """Names of the settings that come with the package."""
    names = (entry.name for entry in _SHIPPED_SETTINGS.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def _setups(value: Any, source: str) -> tuple[DescribedSetup, ...]:
    if not isinstance(value, Mapping):
        raise PlanError(f"{source}: setups must be tables by name, got {value!r}")
    return tuple(_setup(name, said, source) for name, said in value.items())


def _setup(name: str, value: Any, source: str) -> DescribedSetup:
    key = f"setups.{name}"
    said = table(value, types(DescribedSetup) | {"terms": dict}, source, key)
    terms = {
        term: typed(w, float, source, f"{key}.terms.{term}") for term, w in said.pop("terms", {}).items()
    }
    try:
        check_choices(said)
        return DescribedSetup(name=name, **said, terms=terms)
    except PlanError as error:
        raise PlanError(f"{source}: {key}: {error}") from None


def _toml(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise PlanError(f"{source} is not TOML: {error}") from None
