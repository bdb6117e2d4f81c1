"""The run folder, format_version 1, for its readers: tables, policies and trajectories, each checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from safetensors import SafetensorError
from safetensors.numpy import load

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.text.parser import parse
from coachable.experiments.plan import Lane, Study, parse_plan
from coachable.experiments.run_folder.schemas import FORMAT_VERSION, GAITS, SCHEMAS, TRAINING_SCHEMAS
from coachable.experiments.training import Training, parse_training
from coachable.foundation.data import parse_json, structure
from coachable.foundation.errors import BehaviourError, PlanError, RunFolderError
from coachable.foundation.files import read_bytes, read_text
from coachable.foundation.suggestion import suggestion
from coachable.foundation.tables import table_from

if TYPE_CHECKING:
    from coachable.learning.policy import Policy

Which = Literal["last", "best"]
BASELINE = "virtual-gravity"
"""The lane under which the baseline's trajectory is kept."""

Plan = TypeVar("Plan", "Study", "Training")


@dataclass(frozen=True)
class _Manifest:
    """What the manifest of every run has."""

    status: str
    versions: Mapping[str, Any]
    platform: Mapping[str, Any]
    device_layout: Mapping[str, Any]
    resumed_under: tuple[Any, ...]
    reward_hashes: Mapping[str, Any]
    files: Mapping[str, str]


@dataclass(frozen=True)
class _StudyManifest(_Manifest):
    baseline: Mapping[str, Any]


@dataclass(frozen=True)
class _TrainingManifest(_Manifest):
    env: str


@dataclass(frozen=True, eq=False)
class StoredRun(Generic[Plan]):
    """What was left in a folder, complete or under way. Reading changes nothing.

    Every method raises `RunFolderError` naming the file that is missing or damaged.
    """

    path: Path
    plan: Plan
    behaviour: Behaviour
    manifest: Mapping[str, Any]

    @property
    def status(self) -> str:
        """`running`, `interrupted` or `complete`. A run whose process was killed still says `running`."""
        return self.manifest["status"]

    @property
    def lanes(self) -> tuple[Lane, ...]:
        """Every (setup, seed), setup by setup."""
        return self.plan.lanes

    def lane(self, setup: str, seed: int) -> Lane:
        """The lane of this setup and seed, which the plan must have."""
        names = [s.name for s in self.plan.setups]
        if setup not in names:
            raise RunFolderError(f"{self.path} has no setup {setup!r}; {suggestion(setup, names)}")
        if seed not in self.plan.seeds:
            seeds = self.plan.seeds
            raise RunFolderError(f"{self.path} has no seed {seed}; it has {seeds[0]} to {seeds[-1]}")
        return Lane(setup, seed)

    def policy(self, setup: str, seed: int, which: Which = "last") -> Policy:
        """The lane's learned controller: the `last`, or the `best` by evaluation return."""
        return self._files.policy(self.lane(setup, seed), which)

    @property
    def _files(self) -> RunFiles:
        return RunFiles(self.path, self.manifest)


@dataclass(frozen=True, eq=False)
class Run(StoredRun[Study]):
    """What a study of the compass walker left in its folder."""

    @staticmethod
    def open(path: str | Path) -> Run:
        """The run in this folder."""
        files = RunFiles.open(path)
        if files.kind != "study":
            raise RunFolderError(
                f"{path} holds the training of {files.manifest['env']!r}, not a study of the compass walker; "
                "there are `coachable table`, `watch` and `export` for it"
            )
        return Run(files.path, files.plan(parse_plan), files.behaviour(), files.manifest)

    @property
    def baseline(self) -> Mapping[str, Any]:
        """The virtual gravity controller's episode under the study's rewards.

        `hip_x`, `foot_x` [m], `length`, `fell`, `share_in_cycle`, `terms` (sums by name), `returns` by setup.
        """
        return self.manifest["baseline"]

    def table(self, name: str) -> pa.Table:
        """`episodes`, `evaluations`, `trajectories` or `survival`, columns as in `schemas.py`."""
        if name not in SCHEMAS:
            raise RunFolderError(f"a run has no table {name!r}; {suggestion(name, SCHEMAS)}")
        return self._files.table(name, SCHEMAS[name])

    def columns(self, name: str) -> dict[str, np.ndarray]:
        """The same table as NumPy arrays by column."""
        return _columns(self.table(name))

    def trajectory(self, setup: str, seed: int, which: Which = "last") -> dict[str, np.ndarray]:
        """The stored evaluation episode of one lane, as NumPy arrays by column."""
        return self._trajectory(self.lane(setup, seed).name, which)

    def baseline_trajectory(self) -> dict[str, np.ndarray]:
        """The stored episode of the virtual gravity controller, as NumPy arrays by column."""
        return self._trajectory(BASELINE, "baseline")

    def _trajectory(self, lane: str, which: str) -> dict[str, np.ndarray]:
        table = self.table("trajectories")
        rows = table.filter((pc.field("lane") == lane) & (pc.field("which") == which))
        if not len(rows):
            raise RunFolderError(
                f"{self.path / 'trajectories.parquet'} has no trajectory {which!r} of {lane}"
            )
        return _columns(rows.drop_columns(["lane", "which"]))


@dataclass(frozen=True, eq=False)
class TrainingRun(StoredRun[Training]):
    """What a training in somebody's environment left in its folder."""

    @staticmethod
    def open(path: str | Path) -> TrainingRun:
        """The training in this folder."""
        files = RunFiles.open(path)
        if files.kind != "training":
            raise RunFolderError(f"{path} holds a study of the compass walker, not a training")
        return TrainingRun(files.path, files.plan(parse_training), files.behaviour(), files.manifest)

    def columns(self, name: str) -> dict[str, np.ndarray]:
        """`episodes` or `evaluations` as NumPy arrays, columns as in `schemas.py`."""
        if name not in TRAINING_SCHEMAS:
            raise RunFolderError(f"a training has no table {name!r}; {suggestion(name, TRAINING_SCHEMAS)}")
        return _columns(self._files.table(name, TRAINING_SCHEMAS[name]))

    def gaits(self) -> dict[str, np.ndarray]:
        """What `coachable gait` found, as NumPy arrays, columns as in `schemas.py`."""
        if not (self.path / "gaits.parquet").exists():
            raise RunFolderError(f"{self.path} tells no gaits yet; ask `coachable gait {self.path}`")
        return _columns(self._files.table("gaits", GAITS))


@dataclass(frozen=True, eq=False)
class RunFiles:
    """The files that all run folders have, each read with its check."""

    path: Path
    manifest: Mapping[str, Any]

    @staticmethod
    def open(path: str | Path) -> RunFiles:
        """The folder's files."""
        path = Path(path)
        if not path.is_dir():
            raise RunFolderError(f"{path} is not a folder; give the --out of a study")
        if not (path / "manifest.json").exists():
            raise RunFolderError(f"{path} is not a run folder: it has no manifest.json")
        manifest = _json(path / "manifest.json")
        version = manifest.get("format_version")
        if version != FORMAT_VERSION:
            raise RunFolderError(
                f"{path} has format_version {version!r}; this coachable reads {FORMAT_VERSION}. "
                "Use the version of coachable that wrote it"
            )
        files = RunFiles(path, manifest)
        kind = _TrainingManifest if files.kind == "training" else _StudyManifest
        known = {field.name: manifest[field.name] for field in fields(kind) if field.name in manifest}
        structure(kind, known, f"{path / 'manifest.json'} is damaged", RunFolderError)
        return files

    @property
    def kind(self) -> Literal["study", "training"]:
        """Whether the compass walker was studied, or a robot trained in an environment of Gymnasium's."""
        return "training" if "env" in self.manifest else "study"

    def plan(self, parse: Callable[[str, str], Plan]) -> Plan:
        """The resolved plan."""
        path = self.path / "plan.toml"
        try:
            return parse(read_text(path, self._hash(path)), str(path))
        except PlanError as error:
            raise RunFolderError(f"{path} is damaged: {error}") from None

    def behaviour(self) -> Behaviour:
        """The described behaviour."""
        path = self.path / "behaviour.behaviour"
        try:
            return parse(read_text(path, self._hash(path)))
        except BehaviourError as error:
            raise RunFolderError(f"{path} is damaged: {error}") from None

    def table(self, name: str, schema: pa.Schema) -> pa.Table:
        """A table, with the columns of the schema."""
        path = self.path / f"{name}.parquet"
        return table_from(self._read(path), path, schema)

    def policy(self, lane: Lane, which: Which) -> Policy:
        """A lane's learned controller."""
        from coachable.learning.policy import Policy

        stem = self.path / "policies" / f"{lane.name}-{which}"
        weights, description = stem.with_name(f"{stem.name}.safetensors"), stem.with_name(f"{stem.name}.json")
        try:
            return Policy.of(load(self._read(weights)), _json(description, self._hash(description)))
        except (SafetensorError, RunFolderError) as error:
            if isinstance(error, RunFolderError) and str(self.path) in str(error):
                raise
            raise RunFolderError(f"{weights} is damaged: {error}") from None

    def _hash(self, path: Path) -> str | None:
        return self.manifest["files"].get(path.relative_to(self.path).as_posix())

    def _read(self, path: Path) -> bytes:
        if not path.exists() and self.manifest["status"] != "complete":
            raise RunFolderError(
                f"{path} is not there yet: the run is {self.manifest['status']}. "
                f"Run its {self.kind} again to go on"
            )
        return read_bytes(path, self._hash(path))


def load_run(path: str | Path) -> Run:
    """The run in a folder that `coachable study` wrote.

    **Raises:** `RunFolderError` naming what is wrong with it.
    """
    return Run.open(path)


def open_run(path: str | Path) -> Run | TrainingRun:
    """The study or the training in a folder.

    **Raises:** `RunFolderError` naming what is wrong with it.
    """
    return (Run if RunFiles.open(path).kind == "study" else TrainingRun).open(path)


def _columns(table: pa.Table) -> dict[str, np.ndarray]:
    columns = {name: table[name].to_numpy() for name in table.column_names}
    return {
        name: column.astype(str) if column.dtype == object else column for name, column in columns.items()
    }


def _json(path: Path, sha256: str | None = None) -> dict[str, Any]:
    return parse_json(read_bytes(path, sha256), str(path), RunFolderError)
