"""The run folder, format_version 1, for its writer: begun, checked before it is continued, completed."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.text.printer import to_text
from coachable.diagram.draw import automaton_svg
from coachable.experiments.plan import Study, differences
from coachable.experiments.run_folder.provenance import environment, environment_differences
from coachable.experiments.run_folder.reader import Run, TrainingRun
from coachable.experiments.run_folder.schemas import FORMAT_VERSION, SCHEMAS
from coachable.experiments.training import Training
from coachable.foundation.errors import RunFolderError
from coachable.foundation.files import hash_of, read_bytes, write_atomic
from coachable.foundation.tables import table_bytes
from coachable.rewards.reward_hash import hash_of_paid, reward_hash

_FIRST_FILES = ("plan.toml", "behaviour.behaviour", "automaton.svg")


class RunFolder:
    """A run folder open for writing; its lock must be held.

    The manifest is written last when a folder is begun and when it is completed, so what it says is there is
    there.
    """

    def __init__(self, path: Path, manifest: dict[str, Any]):
        self.path = path
        self.manifest = manifest
        self._since = time.perf_counter(), time.process_time()

    @staticmethod
    def begin(
        path: Path,
        plan: Study | Training,
        behaviour: Behaviour,
        group_widths: tuple[int, ...],
        **about: Any,
    ) -> RunFolder:
        """A new run folder, with what it is `about` in its manifest.

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
                "device_layout": {"group_widths": list(group_widths)},
                "resumed_under": [],
                "reward_hashes": _reward_hashes(plan, behaviour),
                **about,
                "wall_seconds": 0.0,
                "cpu_seconds": 0.0,
                "files": {},
            },
        )
        folder.make_folders()
        folder.write("plan.toml", plan.to_toml())
        folder.write("behaviour.behaviour", to_text(behaviour))
        folder.write("automaton.svg", automaton_svg(behaviour))
        folder.write_manifest()
        return folder

    @staticmethod
    def resume(
        run: Run | TrainingRun,
        plan: Study | Training,
        behaviour: Behaviour,
        allow_different_layout: bool = False,
    ) -> RunFolder:
        """The folder of a run that is to go on. A complete one is checked file by file.

        **Raises:** `RunFolderError` if it belongs to another plan or behaviour, showing the difference; if a
        file is missing or damaged, naming it; or if versions or machine are others than those it was begun
        with.
        """
        path, manifest = run.path, dict(run.manifest)
        same = run.behaviour == behaviour
        # The text counts, not where it lies.
        if changed := differences(run.plan, replace(plan, behaviour=run.plan.behaviour) if same else plan):
            raise RunFolderError(
                f"{path} belongs to another plan. Its plan → this one:\n  "
                + "\n  ".join(changed)
                + "\nName another folder with --out, or give the plan it belongs to"
            )
        if not same or manifest["reward_hashes"] != _reward_hashes(plan, behaviour):
            raise RunFolderError(
                f"{path} was begun with another description of {plan.behaviour!r}; "
                "name another folder with --out"
            )
        folder = RunFolder(path, manifest)
        if run.status == "complete":
            for name, sha256 in manifest["files"].items():
                read_bytes(path / name, sha256)
            return folder
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
    def group_widths(self) -> tuple[int, ...]:
        """How many lanes each group has."""
        return tuple(self.manifest["device_layout"]["group_widths"])

    def make_folders(self) -> None:
        """Make the folders inside, where they are missing."""
        for name in ("checkpoints", "policies"):
            (self.path / name).mkdir(exist_ok=True)

    def checkpoint(self, group: int) -> Path:
        """Where the checkpoint of a group lies."""
        return self.path / "checkpoints" / f"group-{group:03d}.safetensors"

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

    def complete(self, tables: Iterable[str] = SCHEMAS) -> None:
        """Say that everything is there, with the hash of every file; checkpoints are no longer needed."""
        names = [*_FIRST_FILES, *(f"{name}.parquet" for name in tables)]
        names += sorted(f"policies/{path.name}" for path in (self.path / "policies").iterdir())
        self.manifest["files"] = {name: hash_of(read_bytes(self.path / name)) for name in names}
        self.write_manifest("complete")
        self.remove_checkpoints()

    def remove_checkpoints(self) -> None:
        """Remove what only an unfinished run needs."""
        shutil.rmtree(self.path / "checkpoints", ignore_errors=True)


def _reward_hashes(plan: Study | Training, behaviour: Behaviour) -> dict[str, str]:
    if isinstance(plan, Study):
        variant, semantics = plan.reward_variant, plan.semantics
        return {setup.name: reward_hash(behaviour, variant, semantics, setup) for setup in plan.setups}
    return {
        setup.name: hash_of_paid(
            behaviour,
            setup.reward_variant,
            weight=repr(setup.weight + 0.0),
            replace=setup.replace,
            terms={name: repr(weight + 0.0) for name, weight in sorted(setup.terms.items())},
            cycle_bonus=repr(setup.cycle_bonus + 0.0),
            signals=dict(sorted(plan.signals.items())),
        )
        for setup in plan.setups
    }
