"""Arguments that several commands have, each with one name, one meaning and one help text."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from coachable.foundation.errors import CoachableError

if TYPE_CHECKING:
    from coachable.plants.plant import Plant

Semantics = Literal["paper", "released-code"]
Clock = Literal["free", "touchdown"]
Which = Literal["last", "best"]

DEFAULT_PLANT = "compass"


def option(metavar: str, help: str, *, otherwise: str = "") -> object:
    """How an option that may be left out is shown: what to write, what it means, what holds without it."""
    return arg(metavar=metavar, help=help, help_behavior_hint=_default(otherwise))


def output(metavar: str, help: str, *, otherwise: str = "") -> object:
    """How `-o`, `--out` is shown: where the output goes; a file's suffix is its format."""
    hint = _default(otherwise) if otherwise else None
    return arg(metavar=metavar, help=help, help_behavior_hint=hint, aliases=("-o",))


def _default(otherwise: str) -> str:
    return f"(default: {otherwise})" if otherwise else ""


RunFolder = Annotated[Positional[Path], arg(metavar="RUN", help="A run folder, the --out of train.")]
BehaviourName = Annotated[
    Positional[str], arg(metavar="BEHAVIOUR", help="A behaviour: a shipped name or a file.")
]
LaneSetup = Annotated[str | None, option("NAME", "The lane's setup.", otherwise="the plan's first")]
LaneSeed = Annotated[int | None, option("N", "The lane's seed.", otherwise="the plan's first")]
WhichPolicy = Annotated[
    Which,
    arg(help="The policy after the last update, or the one with the best evaluation return."),
]
DeterministicRule = Annotated[
    Literal["clipped-mean", "expected-action"] | None,
    option(
        "clipped-mean|expected-action",
        "What a Gaussian policy does when it does not explore: its mean, clipped, or the mean of the actions "
        "that it applies.",
        otherwise="the run's",
    ),
]
PlantOfBaseline = Annotated[
    str | None,
    option("NAME|MODULE:CLASS", "The plant of a baseline; a run has its own.", otherwise=DEFAULT_PLANT),
]
BehaviourOfBaseline = Annotated[
    str | None,
    option(
        "NAME|FILE", "The behaviour that a baseline is to follow; a run has its own.", otherwise="the plant's"
    ),
]
SemanticsOfBaseline = Annotated[Semantics, arg(help="Of a baseline; a run has its own.")]
BASELINE = (
    "a baseline, such as virtual-gravity or virtual-gravity:slope=-0.05 (`coachable baseline` lists them)"
)
"""How help texts say what may stand for a baseline."""
Trust = Annotated[
    bool, arg(help="Import the modules that plans, runs and counterexamples from elsewhere name.")
]
Json = Annotated[bool, arg(help="Print the numbers as JSON, and write no file.")]


def plant_of_baseline(name: str | None) -> Plant:
    """The plant of a name, or the default one.

    **Raises:** `ParameterError` if there is none.
    """
    from coachable.plants.named import make_plant

    return make_plant(name or DEFAULT_PLANT)


def is_baseline(name: str, plant: Plant) -> bool:
    """Whether a word names one of a plant's written controllers, with or without settings."""
    return name.partition(":")[0] in plant.controllers()


def say_imports(trust: bool, *paths: str | Path | None, known: Collection[str] = ()) -> None:
    """Say which modules are imported because plans, run folders and counterexamples name them.

    **Arguments:** `known`, those that need not be said.

    **Raises:** `PlanError` for those that something from outside of the current folder names, unless `trust`.
    """
    from coachable.experiments.named_modules import require_trusted

    for path in paths:
        if path is not None and (modules := require_trusted(path, trust, known)):
            print(f"coachable: importing {', '.join(modules)}, as {path} says", file=sys.stderr)


def print_json(data: object) -> None:
    """Print one JSON document; a number that is not finite becomes `null`."""
    from coachable.foundation.data import json_text

    print(json_text(data))


def require_suffix(path: Path, suffixes: Sequence[str], *, or_else: str = "") -> str:
    """The suffix of an output file, in lower case.

    **Raises:** `CoachableError` naming the suffixes that work, and `or_else`, what may be given instead.
    """
    if (suffix := path.suffix.lower()) not in suffixes:
        raise CoachableError(f"{path}: give a file that ends in {', '.join(suffixes)}{or_else}")
    return suffix


def require_folder(path: Path | None) -> None:
    """Refuse an output that is named like a file where several files are written.

    **Raises:** `CoachableError` if the path is a file, or ends as files do.
    """
    if path is not None and not path.is_dir() and (path.is_file() or path.suffix[1:].isalpha()):
        raise CoachableError(f"{path}: several files are written; give a folder")


def refuse_out_with_json(out: Path | None) -> None:
    """**Raises:** `CoachableError` if there is an output for files although `--json` writes none."""
    if out is not None:
        raise CoachableError("--json prints the numbers and writes no file; leave out --json, or --out")


def require_no_input(out: Path | None, *inputs: Path) -> None:
    """Refuse an output that is one of the files that are read for it.

    **Arguments:** `inputs`, files, and run folders, whose own files are all inputs.

    **Raises:** `CoachableError` naming the file.
    """
    if out is None:
        return
    for path in inputs:
        if _is_same(out, path) and not path.is_dir():
            raise CoachableError(f"{out} is what is read here; give another file for the output")
        own = next((folder for folder in out.absolute().parents if _is_same(folder, path)), None)
        if own is not None and (own / "manifest.json").exists() and _is_of_run(out.absolute(), own):
            raise CoachableError(f"{out} is a file of the run itself; give another file for the output")


_OF_A_RUN = ("plan.toml", "manifest.json", "behaviour.behaviour", "automaton.svg", "lock")
_FOLDERS_OF_A_RUN = ("policies", "checkpoints", "passports", "certificates", "counterexamples")


def _is_of_run(path: Path, run: Path) -> bool:
    first, *others = path.relative_to(run).parts
    if others:
        return first in _FOLDERS_OF_A_RUN
    return first in _OF_A_RUN or Path(first).suffix == ".parquet"


def _is_same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except (OSError, ValueError):
        return False
