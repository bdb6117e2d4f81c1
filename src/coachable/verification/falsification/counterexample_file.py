"""Counterexamples as files: `RUN/counterexamples/LANE-N.json`, format_version 1; docs/counterexamples.md.

A file holds all that it takes to look at the fall, and all that it takes to simulate it anew but the policy.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from coachable.automata.tracker import Tracker
from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.experiments.walks import WalkToShow
from coachable.foundation.errors import CoachableError, RunFolderError
from coachable.foundation.files import read_bytes, write_atomic
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
    place = folder / "counterexamples"
    found = [(one, result) for result in results for one in result.counterexamples]
    paths = tuple(place / f"{lane}-{number}.json" for number in range(1, len(found) + 1))
    if paths:
        place.mkdir(exist_ok=True)
    for number, (path, (one, result)) in enumerate(zip(paths, found, strict=True), start=1):
        data = _data(lane, number, one, result, plant, behaviour)
        write_atomic(path, json.dumps(data, ensure_ascii=False, allow_nan=False) + "\n")
    for old in place.glob("*.json"):
        stem, _, number = old.stem.rpartition("-")
        if stem == lane and number.isdecimal() and old not in paths:
            old.unlink()
    return paths


def load_counterexample(path: Path) -> WalkToShow:
    """The walk of a counterexample's file, to be drawn.

    **Raises:** `RunFolderError` if the file is missing, of another version, or damaged.
    """
    try:
        data = json.loads(read_bytes(path))
        version = data["format_version"]
        if version != FORMAT_VERSION:
            raise RunFolderError(
                f"{path} has format_version {version!r}; this coachable reads {FORMAT_VERSION}. "
                "Use the version of coachable that wrote it"
            )
        plant = plant_class(data.get("plant_class", "compass"))
        columns = ("t", *plant.state_names, *plant.control_names, "foot_x", "phase")
        walk = {name: np.array(data["walk"][name], float) for name in columns}
        if len({len(column) for column in walk.values()}) != 1 or not len(walk["t"]):
            raise RunFolderError(f"{path} is damaged: the columns of its walk are not of one length")
        return WalkToShow(
            title=f"{data['lane']}, counterexample {data['number']}",
            trajectory=walk | {"phase": walk["phase"].astype(int)},
            behaviour=parse(data["behaviour"]),
            parameters=parameters_from(plant, data["plant"]),
        )
    except RunFolderError:
        raise
    except (ValueError, TypeError, CoachableError) as error:
        raise RunFolderError(f"{path} is damaged, or no counterexample: {error}") from None
    except KeyError as error:
        raise RunFolderError(f"{path} is damaged, or no counterexample: it lacks {error}") from None


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
