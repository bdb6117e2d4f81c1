"""Study plans: from a file, a shipped name, and options on top, to a resolved `Study`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import fields
from importlib import resources
from pathlib import Path
from typing import Any

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.library import SHIPPED, load_behaviour
from coachable.experiments.study import Lane as Lane
from coachable.experiments.study import Seeds, check_choices
from coachable.experiments.study import Study as Study
from coachable.experiments.study import differences as differences
from coachable.foundation.data import parse_toml, structure, structure_given
from coachable.foundation.errors import CoachableError, PlanError
from coachable.foundation.files import read_text
from coachable.foundation.suggestion import suggestion
from coachable.learning.config import PPOConfig
from coachable.plants.compass import STATE_NAMES, CompassParameters
from coachable.rewards.setup import PAPER_SETUPS, RewardSetup

IMPLIED = {
    "paper": {"reward_variant": "stay", "behaviour": "compass-walking"},
    "released-code": {"reward_variant": "released", "behaviour": "compass-walking-released"},
}
_SHIPPED = resources.files("coachable.experiments") / "plans"


def shipped_plans() -> list[str]:
    """Names of the plans that come with the package."""
    return sorted(
        entry.name.removesuffix(".toml") for entry in _SHIPPED.iterdir() if entry.name.endswith(".toml")
    )


def load_plan(name_or_path: str | Path, **options: Any) -> Study:
    """A study from a shipped plan or a TOML file, with options on top of it.

    **Arguments:** `options`, where not None, replace the file's keys (`semantics`, `reward_variant`,
    `behaviour`, `clock`, `trainer`, `steps`, `evaluate_every`, `name`), `seeds` (a count, or a table with
    `first` and `count`) and `setups` (names, of the file's setups or the paper's).

    What neither the file nor an option says is the default; `released-code` semantics bring their own reward
    variant and behaviour unless one is said. A behaviour is a name that ships or a file, which in a plan's
    file is looked for from the folder of the plan.

    **Raises:** `PlanError` naming the file and the key, with the nearest one that is known.
    """
    if Path(name_or_path).is_file():
        path = Path(name_or_path)
        return parse_plan(read_text(path, error=PlanError), str(path), path.parent, **options)
    if (name := str(name_or_path)) in shipped_plans():
        source, text = f"plan {name!r}", (_SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
        return parse_plan(text, source, **options)
    raise PlanError(f"{name!r} is neither a plan that ships nor a file; {suggestion(name, shipped_plans())}")


def parse_plan(text: str, source: str, folder: Path | None = None, **options: Any) -> Study:
    """`load_plan` for TOML text that messages call `source`, with a behaviour's file in `folder`."""
    data = parse_toml(text, source, PlanError)
    behaviour = data.get("behaviour")
    if folder is not None and isinstance(behaviour, str) and behaviour not in SHIPPED:
        data["behaviour"] = str(folder / behaviour)
    return resolve((source, data), ("the options", _said(options)))


def behaviour_of(study: Study) -> Behaviour:
    """The behaviour that a study trains.

    **Raises:** `BehaviourError` if it cannot be read, `PlanError` if it speaks of what the walker has not.
    """
    behaviour = load_behaviour(study.behaviour)
    for signal in behaviour.signal_names:
        if signal not in STATE_NAMES:
            raise PlanError(
                f"behaviour {study.behaviour!r}: the compass walker has no signal {signal!r}; "
                + suggestion(signal, STATE_NAMES)
            )
    return behaviour


def with_options(study: Study, **options: Any) -> Study:
    """A study with what the options say, as in `load_plan`; those that are None say nothing."""
    implied = IMPLIED[study.semantics].items()
    data = {key: value for key, value in study.to_data().items() if (key, value) not in implied}
    return resolve((f"study {study.name!r}", data), ("the options", _said(options)))


def resolve(*layers: tuple[str, Mapping[str, Any]]) -> Study:
    """A study from layers of plan data, (where it comes from, nested tables), later ones winning key by key.

    A layer's `setups` replace those below as a whole: a table of weights by name (those left out are the
    paper's, or the defaults of `RewardSetup`), or a list of names taken from the layers below or the paper.
    """
    known = {field.name for field in fields(Study)} - {"first_seed", "num_seeds"} | {"seeds"}
    merged: dict[str, Any] = {}
    setups = Study.setups
    for source, data in layers:
        for key, value in data.items():
            if key not in known:
                raise PlanError(f"{source}: unknown key {key!r}; {suggestion(key, sorted(known))}")
            if key == "setups":
                setups = _setups(value, source, setups)
            elif key == "seeds":
                given = structure_given(Seeds, value, source, PlanError, key)
                merged |= {f"{k}_seed" if k == "first" else "num_seeds": v for k, v in given.items()}
            elif key in ("plant", "ppo"):
                kind = CompassParameters if key == "plant" else PPOConfig
                merged[key] = merged.get(key, {}) | structure_given(kind, value, source, PlanError, key)
            elif key == "sb3":
                settings = structure(Mapping[str, Any], value, source, PlanError, key)
                merged[key] = {**merged.get(key, {}), **settings}
            else:
                merged |= structure_given(Study, {key: value}, source, PlanError)
    if "name" not in merged:
        raise PlanError(f'{layers[0][0]}: the plan has no name; add a line such as name = "mine"')
    sources = " with ".join(source for source, data in layers if data)
    try:
        check_choices(merged)
        parameters = CompassParameters(**merged.pop("plant", {}))
        ppo = PPOConfig(**merged.pop("ppo", {}))
        implied = IMPLIED.get(merged.get("semantics", "paper"), {})
        return Study(**{**implied, **merged, "setups": setups, "plant": parameters, "ppo": ppo})
    except CoachableError as error:
        raise PlanError(f"{sources}: {error}") from None


def _said(options: Mapping[str, Any]) -> dict[str, Any]:
    said = {key: value for key, value in options.items() if value is not None}
    return said | ({"seeds": {"count": said["seeds"]}} if isinstance(said.get("seeds"), int) else {})


def _setups(value: Any, source: str, below: tuple[RewardSetup, ...]) -> tuple[RewardSetup, ...]:
    known = dict(PAPER_SETUPS) | {setup.name: setup for setup in below}
    if isinstance(value, Mapping):
        return tuple(_setup(name, weights, source) for name, weights in value.items())
    if not isinstance(value, list | tuple) or not all(isinstance(name, str) for name in value):
        raise PlanError(f"{source}: setups must be tables of weights or a list of names, got {value!r}")
    for name in value:
        if name not in known:
            raise PlanError(f"{source}: unknown setup {name!r}; {suggestion(name, known)}")
    return tuple(known[name] for name in value)


def _setup(name: str, weights: Any, source: str) -> RewardSetup:
    said = structure_given(RewardSetup, weights, source, PlanError, f"setups.{name}", without=("name",))
    try:
        if name in PAPER_SETUPS:
            return dataclasses.replace(PAPER_SETUPS[name], **said)
        return RewardSetup(name=name, **said)
    except CoachableError as error:
        raise PlanError(f"{source}: setups.{name}: {error}") from None
