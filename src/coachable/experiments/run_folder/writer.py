"""The run folder, format_version 2, for its writer: begun, checked before it is continued, completed."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from coachable.behaviours.text.printer import to_text
from coachable.diagram.draw import automaton_svg
from coachable.experiments.experiment import Experiment, differences
from coachable.experiments.run_folder.provenance import environment, environment_differences
from coachable.experiments.run_folder.reader import Run
from coachable.experiments.run_folder.schemas import FORMAT_VERSION
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import hash_of, make_folder, read_bytes, write_atomic
from coachable.foundation.tables import table_bytes

_FIRST_FILES = ("plan.toml", "behaviour.behaviour", "automaton.svg")


class RunFolder:
    """A run folder open for writing; its lock must be held.

    The manifest is written last when a folder is begun and when it is completed, so what it lists is there
    there.
    """

    def __init__(self, path: Path, manifest: dict[str, Any]):
        self.path = path
        self.manifest = manifest
        self._since = time.perf_counter(), time.process_time()

    @staticmethod
    def begin(
        path: Path,
        experiment: Experiment,
        batch_sizes: tuple[int, ...],
        baseline: Mapping[str, Any] | None,
    ) -> RunFolder:
        """A new run folder, with the baseline's episode in its manifest.

        **Raises:** `RunFolderError` if other files are there.
        """
        others = [
            entry.name
            for entry in path.iterdir()
            if entry.name not in (*_FIRST_FILES, "checkpoints", "policies", "lock")
            and not entry.name.endswith(".part")
        ]
        if others:
            raise RunFolderError(
                f"{path} is no run folder, but holds {others[0]!r}; name an empty or a new folder with --out"
            )
        folder = RunFolder(
            path,
            {
                "format_version": FORMAT_VERSION,
                "status": "running",
                **environment(),
                "device_layout": {"batch_sizes": list(batch_sizes)},
                "resumed_under": [],
                "reward_hashes": experiment.reward_hashes(),
                "baseline": baseline,
                "wall_seconds": 0.0,
                "cpu_seconds": 0.0,
                "files": {},
            },
        )
        folder.make_folders()
        folder.write("plan.toml", experiment.to_toml())
        folder.write("behaviour.behaviour", to_text(experiment.behaviour))
        folder.write("automaton.svg", automaton_svg(experiment.behaviour))
        folder.write_manifest()
        return folder

    @staticmethod
    def resume(run: Run, experiment: Experiment, allow_different_layout: bool = False) -> RunFolder:
        """The folder of a run that is to go on. A complete one is checked file by file.

        **Raises:** `RunFolderError` if it belongs to another plan or behaviour, showing the difference; if a
        file is missing or damaged, naming it; if it is unfinished and of format_version 1; or if versions or
        machine are others than those it was begun with.
        """
        path, manifest = run.path, dict(run.manifest)
        # Descriptions have not always been kept with what is whose mirror image.
        same = run.behaviour == replace(experiment.behaviour, symmetry=run.behaviour.symmetry)
        # The text counts, not where it lies.
        ours = replace(experiment, described_by=run.experiment.described_by) if same else experiment
        if changed := differences(run.experiment, ours):
            raise RunFolderError(
                f"{path} belongs to another plan. Its plan → this one:\n  "
                + "\n  ".join(changed)
                + "\nName another folder with --out, or give the plan it belongs to"
            )
        if not same or manifest["reward_hashes"] != experiment.reward_hashes():
            raise RunFolderError(
                f"{path} was begun with another description of {experiment.described_by!r}; "
                "name another folder with --out"
            )
        folder = RunFolder(path, manifest)
        if run.status == "complete":
            for name, sha256 in manifest["files"].items():
                read_bytes(path / name, sha256)
            return folder
        if manifest["format_version"] != FORMAT_VERSION:
            raise RunFolderError(
                f"{path} is unfinished and of format_version {manifest['format_version']}, which this "
                f"coachable reads but cannot go on with: it writes {FORMAT_VERSION}. Name another folder "
                "with --out, or finish it with the version that began it"
            )
        now = environment()
        if changed := environment_differences((manifest["resumed_under"] or [manifest])[-1], now):
            if not allow_different_layout:
                raise RunFolderError(
                    f"{path} was begun under other conditions, which would show in the last bits:\n  "
                    + "\n  ".join(changed)
                    + "\nGo on all the same with --allow-different-layout"
                )
            manifest["resumed_under"] = [*manifest["resumed_under"], now]
        for half_written in path.rglob(".*.part"):
            half_written.unlink()
        manifest["status"] = "running"
        folder.make_folders()
        folder.write_manifest()
        return folder

    @property
    def batch_sizes(self) -> tuple[int, ...]:
        """How many lanes each batch has."""
        return tuple(self.manifest["device_layout"]["batch_sizes"])

    def make_folders(self) -> None:
        """Make the folders inside, where they are missing."""
        for name in ("checkpoints", "policies"):
            make_folder(self.path, name)

    def checkpoint(self, batch: int) -> Path:
        """Where the checkpoint of a batch lies."""
        return self.path / "checkpoints" / f"batch-{batch:03d}.safetensors"

    def write(self, name: str, data: bytes | str) -> None:
        """Write a file of the folder."""
        write_atomic(self.path / name, data)

    def write_table(self, name: str, table: pa.Table) -> None:
        """Write a table of the folder."""
        self.write(f"{name}.parquet", table_bytes(table))

    def write_manifest(self, status: str | None = None) -> None:
        """Write the manifest, with the time spent since it was written last added to that spent before."""
        wall, cpu = time.perf_counter(), time.process_time()
        self.manifest["wall_seconds"] += wall - self._since[0]
        self.manifest["cpu_seconds"] += cpu - self._since[1]
        self._since = wall, cpu
        if status is not None:
            self.manifest["status"] = status
        self.write("manifest.json", json.dumps(self.manifest, indent=2, ensure_ascii=False) + "\n")

    def complete(self, tables: Iterable[str]) -> None:
        """Say that everything is there, with the hash of every file; checkpoints are no longer needed."""
        names = [*_FIRST_FILES, *(f"{name}.parquet" for name in tables)]
        names += sorted(f"policies/{path.name}" for path in (self.path / "policies").iterdir())
        self.manifest["files"] = {name: hash_of(read_bytes(self.path / name)) for name in names}
        self.write_manifest("complete")
        self.remove_checkpoints()

    def remove_checkpoints(self) -> None:
        """Remove what only an unfinished run needs."""
        shutil.rmtree(self.path / "checkpoints", ignore_errors=True)
