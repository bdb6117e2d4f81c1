"""Plans: from a file, a shipped name and options on top, to a resolved `Experiment`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module, resources
from pathlib import Path
from typing import Any, Literal, get_args

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import SHIPPED, load_behaviour
from coachable.envs.problem import EnvironmentProblem, PlantProblem, Problem, Setup
from coachable.envs.symmetry.named_mirror import NamedMirror
from coachable.experiments.experiment import Experiment
from coachable.experiments.trainers.environment_ppo import EnvironmentPPO
from coachable.experiments.trainers.ppo import PPO
from coachable.experiments.trainers.stable_baselines3 import Algorithm, StableBaselines3
from coachable.experiments.trainers.trainer import Trainer
from coachable.foundation.data import parse_toml, real_number, structure_given
from coachable.foundation.errors import CoachableError, ParameterError, PlanError
from coachable.foundation.files import read_text
from coachable.foundation.suggestion import suggestion
from coachable.learning.config import EnvironmentPPOConfig, PPOConfig
from coachable.plants.named import parameters_type, plant_class
from coachable.rewards.expected_run import has_expected_run
from coachable.rewards.forms import form_from_data
from coachable.rewards.setup import PAPER_SETUPS, DescribedSetup, RewardSetup

_VARIANTS = {"paper": "stay", "released-code": "released"}
"""The reward variant that a semantics brings along unless one is given."""

COMPASS_WALKER = "coachable/CompassWalker-v0"
"""The environment's id that stands for our plant."""

_CHOICES = {
    "semantics": tuple(_VARIANTS),
    "clock": ("free", "touchdown"),
}
_SHIPPED = resources.files("coachable.experiments") / "plans"
_SHIPPED_SETTINGS = resources.files("coachable.experiments") / "settings"
_ALGORITHMS: tuple[str, ...] = get_args(Algorithm)


@dataclass(frozen=True)
class _Seeds:
    first: int = 0
    count: int = 1


@dataclass(frozen=True)
class _Tables:
    """The TOML form of a plan: its keys and their kinds."""

    name: str = ""
    behaviour: str = ""
    trainer: str = "ppo"
    steps: int = 0
    evaluate_every: int = 0
    seeds: Mapping[str, Any] = field(default_factory=dict)
    setups: Mapping[str, Any] | tuple[str, ...] = ()
    ppo: Mapping[str, Any] = field(default_factory=dict)
    sb3: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    semantics: str = "paper"
    reward_variant: str | Mapping[str, Any] = "stay"
    clock: str = "free"
    plant: Mapping[str, Any] = field(default_factory=dict)
    env: str = ""
    env_options: Mapping[str, Any] = field(default_factory=dict)
    signals: Mapping[str, Any] = field(default_factory=dict)
    dt: float = 0.0
    on_nan: Literal["raise", "outside"] = "raise"
    mirror: NamedMirror | None = None
    evaluation_episodes: int = 1
    deterministic: str | tuple[str, ...] = ("clipped-mean",)


_OF_PLANTS = ("semantics", "reward_variant", "clock", "plant")
_OF_ENVIRONMENTS = ("env_options", "signals", "dt", "on_nan", "mirror", "evaluation_episodes")
_MERGED = ("seeds", "plant", "ppo", "sb3", "settings")
"""Tables whose keys are given one by one, by any layer."""

_DEFAULTS_OF_PLANTS = {"steps": 500_000, "evaluate_every": 10_000, "count": 15, "trainer": "ppo"}
_DEFAULTS_OF_ENVIRONMENTS = {
    "steps": 500_000,
    "evaluate_every": 25_000,
    "count": 1,
    "trainer": "ppo",
    "evaluation_episodes": 5,
}


def shipped_plans() -> list[str]:
    """Names of the plans that come with the package."""
    return _names(_SHIPPED)


def shipped_settings() -> list[str]:
    """Names of the trainers' settings that come with the package."""
    return _names(_SHIPPED_SETTINGS)


def load_plan(name_or_path: str | Path | None, **options: Any) -> Experiment:
    """An experiment from a shipped plan or a TOML file, with options on top of it; or from options alone.

    **Arguments:** `options`, where not None, replace the file's keys. `seeds` may be a count, `setups` names
    of the plan's setups or the paper's; `weight` is that of every setup of a Gymnasium environment, and
    `settings` are laid over the trainer's table.

    What neither the file nor an option gives is the default; `released-code` semantics bring their own reward
    variant and behaviour unless one is given. A behaviour is a shipped name or a file, which in a plan's file
    is looked for from the folder of the plan.

    **Raises:** `PlanError` naming the file and the key, with the nearest one that is known.
    """
    if name_or_path is None:
        return resolve(_options(options))
    if Path(name_or_path).is_file():
        path = Path(name_or_path)
        return parse_plan(read_text(path, error=PlanError), str(path), path.parent, **options)
    if (name := str(name_or_path)) in shipped_plans():
        text = (_SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
        return parse_plan(text, f"plan {name!r}", **options)
    raise PlanError(f"{name!r} is neither a plan that ships nor a file; {suggestion(name, shipped_plans())}")


def parse_plan(
    text: str, source: str, folder: Path | None = None, described: Behaviour | None = None, **options: Any
) -> Experiment:
    """`load_plan` for TOML text named `source` in messages, with a behaviour's file in `folder`.

    **Arguments:** `described`, the behaviour itself, where its text is kept elsewhere.
    """
    data = parse_toml(text, source, PlanError)
    described_by = data.get("behaviour")
    if folder is not None and isinstance(described_by, str) and described_by not in SHIPPED:
        data["behaviour"] = str(folder / described_by)
    return resolve((source, data), _options(options), described=described)


def with_options(experiment: Experiment, **options: Any) -> Experiment:
    """An experiment with options on top of it, as in `load_plan`."""
    data = experiment.to_data()
    if isinstance(problem := experiment.problem, PlantProblem):
        # What the semantics brought along, another semantics replaces.
        brought = {"reward_variant": _VARIANTS[problem.semantics]}
        with suppress(ParameterError):
            brought["behaviour"] = problem.plant.behaviour_under(problem.semantics)
        data = {key: value for key, value in data.items() if (key, value) not in brought.items()}
    if options.get("trainer") not in (None, experiment.trainer.name):
        data = {key: value for key, value in data.items() if key not in experiment.trainer.to_data()}
    return resolve((f"experiment {experiment.name!r}", data), _options(options))


def resolve(*layers: tuple[str, Mapping[str, Any]], described: Behaviour | None = None) -> Experiment:
    """An experiment from layers of plan data, (source, nested tables), later ones winning key by key.

    A layer's `setups` replace those below as a whole: a table of setups by name (weights left out are the
    paper's, or defaults), or a list of names taken from the layers below or the paper.

    **Raises:** `PlanError` naming the source and the key.
    """
    given: dict[str, Any] = {}
    for source, data in layers:
        for key, value in structure_given(_Tables, _plain(data), source, PlanError).items():
            given[key] = {**given.get(key, {}), **value} if key in _MERGED else value
    sources = " with ".join(source for source, data in layers if data) or layers[0][0]
    try:
        return _resolved(given, layers, sources, described)
    except ParameterError as error:
        raise PlanError(f"{sources}: {error}") from None


def _resolved(
    given: Mapping[str, Any],
    layers: Sequence[tuple[str, Mapping[str, Any]]],
    sources: str,
    described: Behaviour | None,
) -> Experiment:
    env = given.get("env", "")
    compass_walker = env.removeprefix("coachable.envs:") == COMPASS_WALKER
    of_plant = not env or compass_walker
    for key in _OF_ENVIRONMENTS if of_plant else _OF_PLANTS:
        if key in given:
            robots = "Gymnasium environments" if of_plant else "plants"
            raise PlanError(f"{sources}: {key} is for {robots}; this plan trains {env or 'a plant'}")
    defaults = dict(_DEFAULTS_OF_PLANTS if of_plant else _DEFAULTS_OF_ENVIRONMENTS)
    if compass_walker:
        defaults["count"] = 1
    seeds = structure_given(_Seeds, given.get("seeds", {}), sources, PlanError, "seeds")
    # Plans from when only stable-baselines3 trained environments name it by its table alone.
    if not of_plant and given.get("sb3"):
        defaults["trainer"] = "sb3-ppo"
    trainer = _trainer(given.get("trainer", defaults["trainer"]), given, sources, of_plant=of_plant)
    problem, described_by = (_plant_problem if of_plant else _environment_problem)(given, sources, described)
    setup_type = RewardSetup if of_plant else DescribedSetup
    setups: tuple[Setup, ...] = (_described_setup(problem.behaviour),)
    if of_plant:
        setups = (PAPER_SETUPS["orthant"],) if compass_walker else tuple(PAPER_SETUPS.values())
    for source, data in layers:
        if "setups" in data:
            setups = _setups(setup_type, data["setups"], source, setups)
        if "weight" in data:
            setups = tuple(_weighted(setup, data["weight"], source) for setup in setups)
    name = given.get("name") or re.sub(r"[^A-Za-z0-9_+-]+", "-", env.rpartition("/")[2]).strip("-")
    if not name:
        raise PlanError(f'{layers[0][0]}: the plan has no name; add a line such as name = "mine"')
    try:
        return Experiment(
            name=name,
            problem=problem,
            described_by=described_by,
            setups=setups,
            trainer=trainer,
            first_seed=seeds.get("first", 0),
            num_seeds=seeds.get("count", defaults["count"]),
            deterministic=_rules(given.get("deterministic", ("clipped-mean",))),
            **{
                key: given.get(key, defaults[key])
                for key in ("steps", "evaluate_every", "evaluation_episodes")
                if key in given or key in defaults
            },
        )
    except PlanError as error:
        raise PlanError(f"{sources}: {error}") from None


def _with_fine(variant: Any) -> Any:
    """A plant's reward form, where `schedule` charges in full for a phase that was passed over.

    In a Gymnasium environment, where an episode may be worth ending, a large fine can teach just that, and
    one that is spread is learned with more slowly.
    """
    table = {"form": variant} if isinstance(variant, str) else variant
    if not isinstance(table, Mapping) or table.get("form") != "schedule" or "skip_fine" in table:
        return variant
    return {**table, "skip_fine": 1.0}


def _described_setup(behaviour: Behaviour) -> DescribedSetup:
    """What is paid in a Gymnasium environment unless a plan says: the description alone, and staying alive.

    The form is `schedule`, where every phase on a cycle has a limit. Being alive pays as much as being in
    another phase than the expected one costs, so that it never pays to end the episode; for the same reason
    the fine for a phase that was passed over is spread over the steps that follow.
    """
    described = DescribedSetup(name="described", terms={"alive": 1.0})
    form = {"form": "schedule", "skip_fine": 0.1, "fine_spread": True}
    scheduled = dataclasses.replace(described, reward_variant=form, observe="memory")
    return scheduled if has_expected_run(behaviour) else described


def _rules(given: str | Sequence[str]) -> Any:
    return (given,) if isinstance(given, str) else tuple(given)


def _plant_problem(
    given: Mapping[str, Any], sources: str, described: Behaviour | None
) -> tuple[Problem, str]:
    for key, choices in _CHOICES.items():
        if key in given and given[key] not in choices:
            raise PlanError(f"{sources}: {key} = {given[key]!r}: {suggestion(str(given[key]), choices)}")
    semantics = given.get("semantics", "paper")
    variant = _with_fine(given.get("reward_variant", _VARIANTS[semantics]))
    try:
        form_from_data(variant)
    except ParameterError as error:
        raise PlanError(f"{sources}: reward_variant: {error}") from None
    table = dict(given.get("plant", {}))
    kind = plant_class(table.pop("kind", "compass"))
    numbers = structure_given(parameters_type(kind), table, sources, PlanError, "plant")
    plant = kind(parameters_type(kind)(**numbers))
    described_by = given.get("behaviour") or plant.behaviour_under(semantics)
    return PlantProblem(
        behaviour=described or load_behaviour(described_by),
        plant=plant,
        semantics=semantics,
        reward_variant=variant,
        clock=given.get("clock", "free"),
    ), described_by


def _environment_problem(
    given: Mapping[str, Any], sources: str, described: Behaviour | None
) -> tuple[Problem, str]:
    described_by = given.get("behaviour", "")
    if not described_by:
        raise PlanError(f"{sources}: which behaviour? Give --behaviour, a shipped name or a file")
    return EnvironmentProblem(
        behaviour=described or load_behaviour(described_by),
        env=given["env"],
        env_options=given.get("env_options", {}),
        signals=given.get("signals", {}),
        dt=given.get("dt"),
        on_nan=given.get("on_nan", "raise"),
        mirror_image=given.get("mirror"),
    ), described_by


def _trainer(name: str, given: Mapping[str, Any], sources: str, *, of_plant: bool) -> Trainer:
    """The trainer of a name, with its table of settings.

    A name is `ppo`, one of stable-baselines3's, or `module:Class` of a trainer of one's own. The table
    `settings` is any trainer's, and is laid over that of the trainer's own name.
    """
    table = "ppo" if name == "ppo" else "sb3" if name in _ALGORITHMS else "settings"
    for other in ("ppo", "sb3"):
        if other != table and given.get(other):
            raise PlanError(
                f"{sources}: the table {other} is not for trainer = {name!r}; its table is {table}"
            )
    settings = {**given.get(table, {}), **given.get("settings", {})}
    try:
        if name == "ppo":
            if of_plant:
                return PPO(PPOConfig(**structure_given(PPOConfig, settings, "the trainer", PlanError, "ppo")))
            given_here = structure_given(EnvironmentPPOConfig, settings, "the trainer", PlanError, "ppo")
            return EnvironmentPPO(EnvironmentPPOConfig(**given_here))
        if name in _ALGORITHMS:
            return StableBaselines3(name, settings)  # pyright: ignore[reportArgumentType]
    except PlanError as error:
        raise PlanError(f"{sources}: {error}") from None
    module, colon, attribute = name.partition(":")
    if not colon:
        hint = suggestion(name, ("ppo", *_ALGORITHMS))
        raise PlanError(f"{sources}: trainer = {name!r}: {hint}, or MODULE:CLASS for one of your own")
    try:
        kind = getattr(import_module(module), attribute)
        # Nothing else is called, for a plan's settings could make anything of `subprocess:Popen`.
        if not (isinstance(kind, type) and issubclass(kind, Trainer)):
            raise PlanError(f"{sources}: trainer = {name!r} is no Trainer; see docs/extending.md")
        return kind(**settings)
    except (ImportError, AttributeError, TypeError) as error:
        raise PlanError(f"{sources}: trainer = {name!r} cannot be made: {error}") from None


def _setups(kind: type[Setup], value: Any, source: str, below: tuple[Setup, ...]) -> tuple[Setup, ...]:
    known = {setup.name: setup for setup in below}
    if kind is RewardSetup:
        known = {**PAPER_SETUPS, **known}
    if isinstance(value, Mapping):
        return tuple(_setup(kind, name, weights, source) for name, weights in value.items())
    for name in value:
        if name not in known:
            raise PlanError(f"{source}: unknown setup {name!r}; {suggestion(name, known)}")
    return tuple(known[name] for name in value)


def _setup(kind: type[Setup], name: str, weights: Any, source: str) -> Setup:
    key = f"setups.{name}"
    if isinstance(weights, Mapping) and "append_phase" in weights and kind is DescribedSetup:
        # What format_version 1 called it.
        weights = dict(weights)
        weights["observe"] = "memory" if weights.pop("append_phase") else "nothing"
    given = structure_given(kind, weights, source, PlanError, key, without=("name",))
    if kind is RewardSetup and given.get("reward_variant") is not None:
        given["reward_variant"] = _with_fine(given["reward_variant"])
    try:
        if kind is RewardSetup and name in PAPER_SETUPS:
            return dataclasses.replace(PAPER_SETUPS[name], **given)
        return kind(name=name, **given)
    except CoachableError as error:
        raise PlanError(f"{source}: {key}: {error}") from None


def _weighted(setup: Setup, weight: float, source: str) -> Setup:
    if not isinstance(setup, DescribedSetup):
        raise PlanError(f"{source}: the weight of a plant's reward is in its setup's table")
    return dataclasses.replace(setup, weight=real_number(weight, "weight", PlanError))


def trainer_settings(name_or_path: str) -> dict[str, Any]:
    """A trainer's settings: those that ship under a name, or a TOML file's.

    **Raises:** `PlanError` for one that is neither.
    """
    path = Path(name_or_path)
    if path.is_file():
        return parse_toml(read_text(path, error=PlanError), str(path), PlanError)
    if name_or_path in shipped_settings():
        file = _SHIPPED_SETTINGS / f"{name_or_path}.toml"
        return parse_toml(file.read_text(encoding="utf-8"), f"settings {name_or_path!r}", PlanError)
    hint = suggestion(name_or_path, shipped_settings())
    raise PlanError(f"{name_or_path!r} are neither settings that ship nor a file; {hint}")


def _options(options: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """The layer of options that are given, as plan data."""
    given = {key: value for key, value in options.items() if value is not None}
    if "seeds" in given and not isinstance(given["seeds"], Mapping):
        given["seeds"] = {"count": given["seeds"]}
    if "behaviour" in given:
        given["behaviour"] = str(given["behaviour"])
    return "the options", given


def _plain(data: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a plan among those of a layer: options may also weight setups."""
    return {key: value for key, value in data.items() if key != "weight"}


def _names(folder: Any) -> list[str]:
    names = (entry.name for entry in folder.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))
