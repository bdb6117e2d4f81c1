"""The run folder for its readers, format_version 1 and 2: tables, policies and trajectories, each checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from safetensors import SafetensorError
from safetensors.numpy import load

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.text.parser import parse
from coachable.envs.squashing import Deterministic
from coachable.experiments.experiment import Experiment, Lane, Which
from coachable.experiments.plan import parse_plan
from coachable.experiments.run_folder.schemas import GAITS, READABLE, schemas
from coachable.foundation.data import parse_json, structure
from coachable.foundation.errors import BehaviourError, PlanError, RunFolderError
from coachable.foundation.files import hash_of, read_bytes, read_text
from coachable.foundation.suggestion import suggestion
from coachable.foundation.tables import table_from

if TYPE_CHECKING:
    from coachable.learning.policy import Policy
    from coachable.rewards.expected_run import ExpectedRunFollower


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
    baseline: Mapping[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class Run:
    """What an experiment left in its folder, complete or under way. Reading changes nothing.

    Every method raises `RunFolderError` naming the file that is missing or damaged.
    """

    path: Path
    experiment: Experiment
    manifest: Mapping[str, Any]

    @staticmethod
    def open(path: str | Path) -> Run:
        """The run in this folder."""
        path = Path(path)
        if not path.is_dir():
            raise RunFolderError(f"{path} is not a folder; give the --out of `coachable train`")
        if not (path / "manifest.json").exists():
            raise RunFolderError(f"{path} is not a run folder: it has no manifest.json")
        manifest = _manifest(path / "manifest.json")
        hashes = manifest["files"]
        text = read_text(path / "behaviour.behaviour", hashes.get("behaviour.behaviour"))
        try:
            behaviour = parse(text)
        except BehaviourError as error:
            raise RunFolderError(f"{path / 'behaviour.behaviour'} is damaged: {error}") from None
        plan = path / "plan.toml"
        try:
            experiment = parse_plan(read_text(plan, hashes.get("plan.toml")), str(plan), described=behaviour)
        except PlanError as error:
            raise RunFolderError(f"{plan} is damaged: {error}") from None
        return Run(path, experiment, manifest)

    @property
    def behaviour(self) -> Behaviour:
        """The described behaviour."""
        return self.experiment.behaviour

    @cached_property
    def follower(self) -> ExpectedRunFollower | None:
        """Follows the expected run along a walk; `None` where a phase on a cycle has no limit."""
        from coachable.rewards.expected_run import ExpectedRunFollower

        return ExpectedRunFollower.of(self.behaviour)

    @property
    def status(self) -> str:
        """`running`, `interrupted` or `complete`. A run whose process was killed stays `running`."""
        return self.manifest["status"]

    @property
    def lanes(self) -> tuple[Lane, ...]:
        """Every (setup, seed), in the order of training."""
        return self.experiment.lanes

    @property
    def baseline(self) -> Mapping[str, Any] | None:
        """The episode of the plant's baseline controller under the experiment's rewards; `None` without one.

        `hip_x`, `foot_x` [m], `length`, `fell`, `share_in_cycle`, `terms` (sums by name), `returns` by setup.
        """
        return self.manifest.get("baseline")

    def lane(self, setup: str | None = None, seed: int | None = None) -> Lane:
        """The lane of this setup and seed, which the experiment must have; by default its first ones."""
        names, seeds = self.experiment.setup_names, self.experiment.seeds
        setup, seed = names[0] if setup is None else setup, seeds[0] if seed is None else seed
        if setup not in names:
            raise RunFolderError(f"{self.path} has no setup {setup!r}; {suggestion(setup, names)}")
        if seed not in seeds:
            raise RunFolderError(f"{self.path} has no seed {seed}; it has {seeds[0]} to {seeds[-1]}")
        return Lane(setup, seed)

    def policy(
        self, setup: str, seed: int, which: Which = "last", deterministic: Deterministic | None = None
    ) -> Policy:
        """The lane's learned controller: the `last`, or the `best` by evaluation return.

        **Arguments:** `deterministic`, what it does when it does not explore, by default as it was kept.

        **Raises:** `ParameterError` for a rule that it cannot follow; see `Policy.acting`.
        """
        from coachable.learning.policy import Policy

        stem = f"policies/{self.lane(setup, seed).name}-{which}"
        weights = self.path / f"{stem}.safetensors"
        try:
            described = self.path / f"{stem}.json"
            description = parse_json(self._read(f"{stem}.json"), str(described), RunFolderError)
            policy = Policy.of(self._tensors(stem), description)
        except RunFolderError as error:
            if isinstance(error, RunFolderError) and str(self.path) in str(error):
                raise
            raise RunFolderError(f"{weights} is damaged: {error}") from None
        return policy if deterministic is None else policy.acting(deterministic)

    def diverged(self) -> tuple[Lane, ...]:
        """The lanes whose last policy holds numbers that are not finite: their training diverged."""
        return tuple(
            lane
            for lane in self.lanes
            if (self.path / f"policies/{lane.name}-last.safetensors").exists()
            and not all(
                np.isfinite(array).all() for array in self._tensors(f"policies/{lane.name}-last").values()
            )
        )

    def _tensors(self, stem: str) -> dict[str, np.ndarray]:
        """The arrays of a policy's file."""
        data = self._read(f"{stem}.safetensors")
        try:
            return load(data)
        # What numbers that NumPy does not have, such as BF16, raise depends on the version.
        except (SafetensorError, KeyError, TypeError, ValueError, AttributeError) as error:
            path = self.path / f"{stem}.safetensors"
            raise RunFolderError(f"{path} is damaged: its arrays cannot be read: {error!r}") from None

    def policy_sha256(self, setup: str, seed: int, which: Which = "last") -> str:
        """The hash of the file with the lane's weights."""
        return hash_of(self._read(f"policies/{self.lane(setup, seed).name}-{which}.safetensors"))

    def has_table(self, name: str) -> bool:
        """Whether a table has been written."""
        return (self.path / f"{name}.parquet").exists()

    def table(self, name: str) -> pa.Table:
        """A table of the run, columns as in `schemas`; `gaits` is there once the gaits were measured."""
        if name == "gaits":
            if not self.has_table(name):
                raise RunFolderError(
                    f"{self.path} has no gaits yet; measure them: coachable gait {self.path}"
                )
            schema = GAITS
        else:
            known = schemas(self.experiment)
            if name not in known:
                robot = self.experiment.problem.robot
                raise RunFolderError(f"a run of {robot} has no table {name!r}; {suggestion(name, known)}")
            schema = known[name]
        return table_from(self._read(f"{name}.parquet"), self.path / f"{name}.parquet", schema)

    def columns(self, name: str) -> dict[str, np.ndarray]:
        """The same table as NumPy arrays by column."""
        return _columns(self.table(name))

    def trajectory(self, setup: str, seed: int, which: Which = "last") -> dict[str, np.ndarray]:
        """The stored evaluation episode of one lane of a plant, as NumPy arrays by column."""
        return self._trajectory(self.lane(setup, seed).name, which)

    def baseline_trajectory(self) -> dict[str, np.ndarray]:
        """The stored episode of the baseline controller, as NumPy arrays by column."""
        if self.baseline is None:
            raise RunFolderError(f"{self.path} has no baseline")
        return self._trajectory(self.baseline["controller"], "baseline")

    def _trajectory(self, lane: str, which: str) -> dict[str, np.ndarray]:
        table = self.table("trajectories")
        rows = table.filter((pc.field("lane") == lane) & (pc.field("which") == which))
        if not len(rows):
            raise RunFolderError(
                f"{self.path / 'trajectories.parquet'} has no trajectory {which!r} of {lane}"
            )
        return _columns(rows.drop_columns(["lane", "which"]))

    def _read(self, name: str) -> bytes:
        path = self.path / name
        if not path.exists() and self.status != "complete":
            raise RunFolderError(
                f"{path} is not there yet: the run is {self.status}. "
                "Give the command that began it again to go on"
            )
        return read_bytes(path, self.manifest["files"].get(name))


def open_run(path: str | Path) -> Run:
    """The run in a folder.

    **Raises:** `RunFolderError` naming what is wrong with it.
    """
    return Run.open(path)


def _manifest(path: Path) -> dict[str, Any]:
    manifest = parse_json(read_text(path), str(path), RunFolderError)
    version = manifest.get("format_version")
    if version not in READABLE:
        raise RunFolderError(
            f"{path.parent} has format_version {version!r}; this coachable reads "
            f"{' and '.join(map(str, READABLE))}. Use the version of coachable that wrote it"
        )
    known = {field.name: manifest[field.name] for field in fields(_Manifest) if field.name in manifest}
    structure(_Manifest, known, f"{path} is damaged", RunFolderError)
    return manifest


def _columns(table: pa.Table) -> dict[str, np.ndarray]:
    columns = {name: table[name].to_numpy() for name in table.column_names}
    return {
        name: column.astype(str) if column.dtype == object else column for name, column in columns.items()
    }
