"""Counterexamples as files: `RUN/counterexamples/LANE-N.json`, format_version 1; docs/counterexamples.md.

A file holds all that it takes to look at the fall, and all that it takes to simulate it anew but the policy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from coachable.automata.tracker import Tracker
from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.drawing.motion import Motion
from coachable.experiments.walks import TitledMotion
from coachable.foundation.data import json_text, parse_json, structure
from coachable.foundation.errors import CoachableError, RunFolderError
from coachable.foundation.files import make_folder, read_text, write_atomic
from coachable.plants.named import name_of, parameters_from, plant_class
from coachable.plants.plant import Plant
from coachable.verification.falsification.falsify import Counterexample, Falsification

FORMAT_VERSION = 1


def write_counterexamples(
    folder: Path,
    lane: str,
    results: Sequence[Falsification],
    plant: Plant,
    behaviour: Behaviour,
) -> tuple[Path, ...]:
    """Write a lane's counterexamples into the folder `counterexamples` of a run, in place of all older ones.

    **Arguments:** `folder`, the run's; `lane`, its name or a baseline's; `behaviour`, whose phases the walk
    is drawn with.

    **Returns:** where they are, LANE-1.json first; nothing is written where there are none.
    """
    found = [(one, result) for result in results for one in result.counterexamples]
    return write_numbered(
        folder,
        lane,
        [
            _data(lane, number, one, result, plant, behaviour)
            for number, (one, result) in enumerate(found, start=1)
        ],
    )


def write_numbered(folder: Path, lane: str, files: Sequence[Mapping[str, Any]]) -> tuple[Path, ...]:
    """Write the data of a lane's counterexamples, LANE-1.json first, in place of all older ones.

    **Returns:** where they are.
    """
    place = folder / "counterexamples"
    if files or place.is_symlink():
        place = make_folder(folder, "counterexamples")
    paths = tuple(place / f"{lane}-{number}.json" for number in range(1, len(files) + 1))
    for path, data in zip(paths, files, strict=True):
        write_atomic(path, json_text(data, indent=None) + "\n")
    for old in place.glob("*.json"):
        stem, _, number = old.stem.rpartition("-")
        if stem == lane and number.isdecimal() and old not in paths:
            old.unlink()
    return paths


def read_counterexample(path: Path) -> dict[str, Any]:
    """A counterexample's file as plain data; that of a Gymnasium environment has a key `environment`.

    **Raises:** `RunFolderError` if the file is missing, no JSON object, or of another version.
    """
    data = parse_json(read_text(path), str(path), RunFolderError)
    version = data.get("format_version")
    if version != FORMAT_VERSION:
        raise RunFolderError(
            f"{path} has format_version {version!r}; this coachable reads {FORMAT_VERSION}. "
            "Use the version of coachable that wrote it"
        )
    return data


def load_counterexample(path: Path) -> TitledMotion:
    """The motion of a plant's counterexample, to be drawn.

    **Raises:** `RunFolderError` if the file is missing, of another version, or damaged.
    """
    data = read_counterexample(path)
    damaged = f"{path} is damaged, or no counterexample"
    file = structure(_File, data, damaged, RunFolderError)
    try:
        kind = plant_class(file.plant_class)
        plant, behaviour = kind(parameters_from(kind, file.plant)), parse(file.behaviour)
    except CoachableError as error:
        raise RunFolderError(f"{damaged}: {error}") from None
    columns = ("t", *plant.state_names, *plant.control_names, "foot_x", "phase")
    if missing := [name for name in columns if name not in file.walk]:
        raise RunFolderError(f"{damaged}: walk lacks {missing[0]!r}")
    walk = {name: np.array(file.walk[name]) for name in columns}
    if len({len(column) for column in walk.values()}) != 1 or not len(walk["t"]):
        raise RunFolderError(f"{path} is damaged: the columns of its walk are not of one length")
    motion = Motion.of(plant, walk | {"phase": walk["phase"].astype(int)})
    return TitledMotion(f"{file.lane}, counterexample {file.number}", motion, behaviour)


@dataclass(frozen=True)
class _File:
    """What a counterexample's file holds; docs/counterexamples.md documents each key."""

    format_version: int
    lane: str
    number: int
    found_by: str
    perturbation: Mapping[str, Any]
    size: float
    x0: tuple[float, ...]
    disturbance: tuple[tuple[float, ...], ...]
    clock: str
    seconds: float
    plant: Mapping[str, float]
    falls_after: Mapping[str, float]
    behaviour: str
    walk: Mapping[str, tuple[float, ...]]
    plant_class: str = "compass"
    """Files of the compass walker from before there were other plants do not name it."""


def _data(
    lane: str,
    number: int,
    one: Counterexample,
    result: Falsification,
    plant: Plant,
    behaviour: Behaviour,
) -> dict[str, Any]:
    return {
        "format_version": FORMAT_VERSION,
        "lane": lane,
        "number": number,
        "found_by": one.fall.found_by,
        "perturbation": {"kind": type(result.perturbation).__name__, **asdict(result.perturbation)},
        "size": one.size,
        "x0": one.x0.tolist(),
        "disturbance": one.disturbance.tolist(),
        "clock": result.clock,
        "seconds": result.seconds,
        "plant_class": name_of(type(plant)),
        "plant": asdict(plant.parameters),
        "falls_after": {"jax": one.fall.time, "scipy": one.walk.seconds},
        "behaviour": to_text(behaviour),
        "walk": {name: column.tolist() for name, column in _walk(one, plant, behaviour).items()},
    }


def _walk(one: Counterexample, plant: Plant, behaviour: Behaviour) -> Mapping[str, np.ndarray]:
    """The walk as SciPy has it, column by column, with the phase of each sample."""
    states: dict[str, np.ndarray] = dict(zip(plant.state_names, one.walk.states.T, strict=True))
    controls = dict(zip(plant.control_names, one.walk.controls.T, strict=True))
    tracker = Tracker.of(behaviour)
    phase = tracker.along(states, tracker.none_yet)
    return {"t": one.walk.time, **states, **controls, "foot_x": one.walk.foot_x, "phase": phase}
